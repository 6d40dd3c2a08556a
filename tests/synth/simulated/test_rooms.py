"""Films and images of rooms: scenes are what they are called, labels are true, and a sequence depends on its index alone."""

from dataclasses import replace

import numpy as np
import pytest
from fingerprints import fingerprint
from stand_ins import joints_world_m

from kpopnet.skeleton import Joint
from synth.scene.mesh import boxes, rod
from synth.scene.render import draw_mesh_m, whole_px
from synth.scene.scene import Scene
from synth.simulated import room_films
from synth.simulated.casts import CASTS
from synth.simulated.film import PERSON, Studio, pixels_of_people
from synth.simulated.room_films import RoomTake, render
from synth.simulated.rooms import KINDS, SINGLE, Rooms, RoomsConfig


@pytest.fixture(scope="module")
def maker() -> Rooms:
    return Rooms(RoomsConfig(seed=5), frames=(40, 50))


@pytest.fixture(scope="module")
def takes(maker: Rooms) -> dict[str, RoomTake]:
    """The first film of each kind."""
    return {kind: maker.take(KINDS.index(kind)) for kind in dict.fromkeys(KINDS) if kind != SINGLE}


def world_m(take: RoomTake) -> np.ndarray:
    """(T, P, 15, 3) true joints in the world."""
    studio = Studio(take.camera, "cpu")
    return np.stack([joints_world_m(studio, actor) for actor in take.actors], axis=1)


def test_the_scenes_are_what_they_are_called(takes: dict[str, RoomTake]) -> None:
    joints_m = {kind: world_m(take) for kind, take in takes.items() if take.actors}
    assert not takes["empty_room"].actors and len(takes["crowd"].actors) >= 3
    steps_m = {kind: np.linalg.norm(np.diff(one, axis=0), axis=-1).max() for kind, one in joints_m.items()}
    assert steps_m["alone_still"] < 0.02 < steps_m["alone_moving"]
    assert np.ptp(joints_m["lying"][:, 0, :, 2], axis=1).max() < 0.9 < np.ptp(joints_m["alone_still"][:, 0, :, 2], axis=1).min()
    assert joints_m["sitting"][:, :, [Joint.LEFT_HIP, Joint.RIGHT_HIP], 2].max() < 0.7
    assert np.linalg.norm(np.diff(joints_m["hug"][:, :, Joint.TORSO], axis=1), axis=-1).min() < 0.55
    side = joints_m["side_view_arms_up"][:, 0]
    assert (side[:, [Joint.LEFT_ELBOW, Joint.RIGHT_ELBOW], 2] > side[:, [Joint.LEFT_SHOULDER, Joint.RIGHT_SHOULDER], 2]).all()
    across, away = (one[:, :2] for one in (side[:, Joint.LEFT_SHOULDER] - side[:, Joint.RIGHT_SHOULDER], side[:, Joint.TORSO]))
    along, beside = np.abs((across * away).sum(axis=1)), np.abs((across * away[:, ::-1] * (1, -1)).sum(axis=1))
    assert (along > beside).all()
    for kind in ("crossing", "one_behind_the_other"):
        torsos_m = takes[kind].view(0).to_camera(joints_m[kind][:, :, Joint.TORSO])
        right = torsos_m[..., 0] / torsos_m[..., 2]
        assert len(np.unique(np.sign(right[:, 0] - right[:, 1]))) > 1


def test_cameras_hang_and_move_as_they_are_called(takes: dict[str, RoomTake]) -> None:
    assert takes["ceiling_camera"].view(0).position_m[2] >= 2.4
    forward = takes["ceiling_camera"].view(0).rotation[:, 2]
    assert forward[2] < -0.5
    moving = takes["moving_camera"]
    place_m = np.array([view.position_m for view in moving.views])
    turn = np.array([view.rotation for view in moving.views])
    assert len(moving.views) == len(moving) and np.ptp(place_m, axis=0).max() > 0.05
    assert np.linalg.norm(np.diff(place_m, axis=0), axis=1).max() < 0.08
    assert np.abs(np.diff(turn, axis=0)).max() < 0.06


def test_a_still_camera_shows_the_same_film(maker: Rooms, takes: dict[str, RoomTake]) -> None:
    still = Rooms(replace(maker.benchmark, still_cameras=True), frames=maker.frames).take(KINDS.index("moving_camera"))
    assert len(still.views) == 1 and still.view(3) is still.view(0)
    np.testing.assert_array_equal(still.view(0).rotation, takes["moving_camera"].views[len(still) // 2].rotation)
    np.testing.assert_allclose(world_m(still), world_m(takes["moving_camera"]), atol=1e-5)
    middle = len(still) // 2  # whose pose a still camera has
    [one], [other] = (list(render(take, range(middle, middle + 1))) for take in (still, takes["moving_camera"]))
    np.testing.assert_array_equal(one.depth_m, other.depth_m)


def test_people_touch_the_floor_or_their_bed_and_nothing_else(takes: dict[str, RoomTake]) -> None:
    for kind, take in takes.items():
        for actor in take.actors:
            skin_m = actor.played.skin_m + actor.place_m
            assert abs(skin_m[:, 2].min() - actor.place_m[2]) < 0.02, kind  # every seventh vertex
            assert np.linalg.norm(skin_m - take.view(0).position_m, axis=1).min() > 0.3, kind


def test_furniture_hides_a_part_of_those_behind_it(takes: dict[str, RoomTake]) -> None:
    take = takes["behind_furniture"]
    [clear] = render(take, range(len(take) // 2, len(take) // 2 + 1))
    share = pixels_of_people(clear.labels, len(clear.whole_px)) / clear.whole_px
    assert share.max() >= 0.5 and share.min() <= 0.85


def test_the_true_joints_lie_behind_the_skin_of_those_who_are_labelled(takes: dict[str, RoomTake]) -> None:
    tested = 0
    for kind, take in takes.items():
        if kind == "lying":  # they may show their legs before the trunk
            continue
        for clear in render(take, range(0, len(take), 15)):
            for person, joints_m in enumerate(clear.joints_camera_m):
                u, v, z = take.camera.project(joints_m[Joint.TORSO])
                if not (0 <= u < take.camera.width - 0.5 and 0 <= v < take.camera.height - 0.5):
                    continue
                if clear.labels[round(v), round(u)] == PERSON + person:
                    assert -0.02 < z - clear.depth_m[round(v), round(u)] < 0.35, kind
                    tested += 1
    assert tested > 15


def test_frames_and_images_depend_on_their_numbers_alone(maker: Rooms) -> None:
    index = KINDS.index("moving_camera")
    take = maker.take(index)
    [last] = maker.shots(index, take, range(7, 8))
    *_, again = maker.shots(index, Rooms(maker.benchmark, frames=maker.frames).take(index), range(5, 8))
    np.testing.assert_equal(last, again)
    first = KINDS.index(SINGLE)
    images = [maker.sequence(number, lambda: None) for number in range(first, first + 3)]
    other = Rooms(maker.benchmark).sequence(first + 2, lambda: None)
    np.testing.assert_array_equal(images[2].depth, other.depth)
    np.testing.assert_array_equal(images[2].joints_m, other.joints_m)
    assert all(len(image.depth) == 1 and (image.seen_px <= image.whole_px).all() for image in images)
    names = [name for image in images for name in image.people]
    assert len(names) == len(set(names)) > 0
    arms_m = np.concatenate(
        [image.joints_m[0, :, Joint.LEFT_ELBOW] - image.joints_m[0, :, Joint.LEFT_SHOULDER] for image in images]
    )
    assert len(set(np.linalg.norm(arms_m, axis=1).round(4).tolist())) == len(names)  # no person is in two images


def test_the_whole_of_a_plate_is_counted_beyond_the_border(takes: dict[str, RoomTake]) -> None:
    take = takes["alone_still"]
    scene = Scene(take.camera)
    scene.set_view(room_films.posed_view(np.zeros(3), 0.0, 0.0))
    half_px = take.camera.fx * 0.5 / 2.0
    pixels = []
    for x_m in (0.0, take.camera.width / take.camera.fx):  # in the middle, and half of it beyond the border
        plate = boxes([((x_m, 2.5, 0), (0.5, 0.5, 0.5))])  # its front is at 2 m
        pixels.append((whole_px(scene, plate), np.count_nonzero(draw_mesh_m(scene, plate))))
    (middle, shown), (cut, shown_cut) = pixels
    assert middle == shown == pytest.approx((2 * half_px) ** 2, rel=0.03)
    assert cut > 1.3 * shown_cut and middle <= cut < 1.8 * middle  # it shows a side, too


def test_clutter_is_inside_the_walls_and_not_too_near_the_camera(monkeypatch: pytest.MonkeyPatch) -> None:
    things, views = 0, (room_films.posed_view(np.array([0, 0, 1.5]), 0.2, 0.0),)
    monkeypatch.setattr(room_films, "BENCHMARK_CLUTTER", (lambda rng: rod(0.5, 0.7),))
    for seed in range(20):
        for mesh in room_films.draw_surroundings(np.random.default_rng(seed), "empty_room", views, ()) or []:
            if len(mesh.vertices_m) == len(rod(0.5, 0.7).vertices_m):
                assert np.linalg.norm(mesh.vertices_m[:, :2], axis=1).min() > room_films.NEAREST_M
                things += 1
    assert things > 10


@pytest.mark.parametrize(("kind", "shares", "shows"), [
    ("crowd", (0.2, 0.6), True), ("crowd", (0.2, 0.4), False),
    ("behind_furniture", (0.7,), True), ("behind_furniture", (0.95,), False), ("behind_furniture", (0.3,), False),
])  # fmt: skip
def test_half_of_a_person_must_show_and_furniture_hide_a_part(monkeypatch, kind: str, shares: tuple, shows: bool) -> None:
    labels = np.concatenate([np.full(round(100 * share), PERSON + k) for k, share in enumerate(shares)])[None]
    clear = room_films.ClearFrame(0, np.ones(labels.shape), labels, np.zeros((len(shares), 15, 3)), np.full(len(shares), 100))
    monkeypatch.setattr(room_films, "render", lambda take, numbers: iter([clear]))
    assert room_films._shows(kind, range(3)) is shows


@pytest.mark.parametrize("module", ["room_films", "rooms"])
def test_clutter_is_that_of_benchmarks(maker: Rooms, monkeypatch: pytest.MonkeyPatch, module: str) -> None:
    def forbidden(rng: np.random.Generator) -> None:
        raise AssertionError("a thing of the benchmark")

    monkeypatch.setattr(f"synth.simulated.{module}.BENCHMARK_CLUTTER", (forbidden,))
    fresh, first = Rooms(maker.benchmark, frames=(12, 12)), KINDS.index(SINGLE if module == "rooms" else "empty_room")
    with pytest.raises(AssertionError, match="of the benchmark"):
        _ = [fresh.sequence(number, lambda: None) for number in range(first, first + 12)]


def test_some_kinds_are_shown_in_turn() -> None:
    some = Rooms(RoomsConfig(kinds=["empty_room", "hug"], sequences=4))
    assert [some.kind(index) for index in range(4)] == ["hug", "empty_room"] * 2


def test_a_seed_casts_the_parts_that_it_cast() -> None:
    """Sets are published by their seeds: other parts need another version of the generator, and numbers here."""
    found = {}
    for kind, draw in CASTS.items():
        parts = [(one.motion.quats, one.motion.root_m, one.place_m, one[2:]) for one in draw(np.random.default_rng(6), 60)]
        found[kind] = sum(fingerprint(*part) for part in parts)
    assert Rooms.generator == 5 and found == pytest.approx(PUBLISHED, abs=2e-3)


PUBLISHED = {
    "alone_still": -0.7108,
    "alone_moving": 0.1314,
    "sitting": 2.1837,
    "lying": -0.2097,
    "behind_furniture": 2.7992,
    "crowd": 9.9758,
    "crossing": 4.6333,
    "hug": 2.5859,
    "one_behind_the_other": 2.3731,
    "side_view_arms_up": -0.4802,
    "ceiling_camera": 2.2117,
    "moving_camera": 2.2117,
    "empty_room": 0,
}
