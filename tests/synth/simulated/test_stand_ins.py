"""The stand-ins for EVAL and SMMC-10: what their sequences show, and the markers of the second."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from stand_ins import film_of, joints_world_m

from kpopnet.errors import InputError
from kpopnet.skeleton import Joint
from synth.body.markers import MARKERS, tracked_markers
from synth.motion.choreography.programmes import Y_POSE_S
from synth.motion.skeleton import Motion
from synth.scene.mesh import about_z
from synth.scene.room import Room
from synth.simulated.film import DISTANCE_RANGE_M, Take
from synth.simulated.generator import is_faulty
from synth.simulated.stand_ins import JOINT_MARKERS, EvalSim, EvalSimConfig, Smmc10Sim, Smmc10SimConfig

FPS, KINDS = EvalSim.fps, EvalSim.kinds
HIPS, FEET, HANDS = ([Joint[f"{side}_{one}"] for side in ("LEFT", "RIGHT")] for one in ("HIP", "FOOT", "HAND"))


def num_headings(joints_m: np.ndarray) -> int:
    """How many of eight directions the hips face."""
    across = joints_m[:, HIPS[0], :2] - joints_m[:, HIPS[1], :2]
    return len(set((np.degrees(np.arctan2(across[:, 1], across[:, 0])) // 45).astype(int).tolist()))


@pytest.fixture(scope="module")
def maker() -> EvalSim:
    return EvalSim(EvalSimConfig(seed=6))


@pytest.fixture(scope="module")
def takes(maker: EvalSim) -> list[tuple[Take, np.ndarray]]:
    """The first sequence of each kind of KINDS, with the true joints (T, 15, 3) in the world."""
    return [(take, joints_world_m(maker.studio, take)) for take in map(maker.take, range(len(KINDS)))]


def test_every_kind_is_shown_three_times_by_different_people(maker):
    sequences = EvalSimConfig().sequences
    assert Counter(maker.kind(index) for index in range(sequences)) == Counter(KINDS * 3)
    assert len({np.ptp(maker.person(index).bare_m[:, 2]) for index in range(sequences)}) == sequences


def test_every_sequence_begins_in_the_y_pose_facing_the_camera(takes):
    for take, joints in takes:
        body = joints[: round(Y_POSE_S * FPS)]
        to_camera = -np.append(take.place_m[:2], 0) / np.linalg.norm(take.place_m[:2])
        across = body[:, Joint.LEFT_SHOULDER] - body[:, Joint.RIGHT_SHOULDER]
        across /= np.linalg.norm(across, axis=1, keepdims=True)
        assert (np.abs(across @ to_camera) < np.sin(np.radians(25))).all()
        leftwards = np.cross([0, 0, 1.0], to_camera)
        for side, sign in (("LEFT", 1), ("RIGHT", -1)):
            arm = body[:, Joint[f"{side}_HAND"]] - body[:, Joint[f"{side}_SHOULDER"]]
            rise = np.degrees(np.arctan2(arm[:, 2], sign * (arm @ leftwards)))
            assert (rise > 20).all() and (rise < 70).all()
            foot = body[:, Joint[f"{side}_FOOT"]] - body[:, HIPS].mean(axis=1)
            assert (sign * (foot @ leftwards) > 0.12).all() and (body[:, FEET, 2] < 0.2).all()
        assert np.linalg.norm(np.diff(body, axis=0), axis=-1).max() * FPS < 0.2
        # Afterwards they move.
        assert np.linalg.norm(joints[len(body) + 25] - body[-1], axis=-1).max() > 0.3


def test_bodies_touch_the_floor_and_stay_inside_image_and_room(maker, takes):
    for take, _ in takes:
        back, left, right = take.room.clear_m()
        lowest = []
        for frame in range(0, len(take.played), 9):
            maker.studio.pose(take.played, frame, take.place_m)
            skin_m = maker.studio.renderer.vertices_world_m()
            lowest.append(skin_m[:, 2].min())
            assert skin_m[:, 0].min() > left and skin_m[:, 0].max() < right
            assert skin_m[:, 1].min() > DISTANCE_RANGE_M[0] - 0.05
            assert skin_m[:, 1].max() < min(back, DISTANCE_RANGE_M[1] + 0.05)
            u, v, z = EvalSim.camera.project(take.view.to_camera(skin_m)).T
            assert z.min() > 0 and u.min() >= 0 and v.min() >= 0 and u.max() <= 319 and v.max() <= 239
        assert min(lowest) > -1e-4 and max(lowest) < 0.35 and np.median(lowest) < 0.03


def test_a_turned_motion_is_the_same_from_another_side(maker, takes):
    played = takes[0][0].played
    joints_m, turned_m = (
        maker.studio.joints_world_m(one.person, one.local[:40], one.hips_m[:40]) for one in (played, played.turned(0.7))
    )
    np.testing.assert_allclose(turned_m, joints_m @ about_z(0.7).T, atol=1e-5)


@pytest.mark.parametrize(("half_m", "clear"), [(0.004, True), (0.04, False)])
def test_furniture_hides_at_most_a_fiftieth_of_a_person(maker, takes, half_m: float, clear: bool) -> None:
    take, joints = takes[0]
    camera_m = take.view.position_m
    to_torso = joints[0, Joint.TORSO] - camera_m
    box = Room(*(np.array([one]) for one in (camera_m + 0.8 * to_torso / np.linalg.norm(to_torso), np.full(3, half_m), 0.0)))
    room = Room(*(np.concatenate([getattr(one, name) for one in (take.room, box)]) for name in vars(box)))
    assert maker.studio.is_clear(replace(take, room=room), maker.studio.furnish(room, take.view)) is clear


def test_each_kind_shows_its_motion(takes):
    shown = {kind: joints for kind, (_, joints) in zip(KINDS, takes, strict=True)}
    joints = shown["handstand"]
    upside_down = joints[:, Joint.HEAD, 2] < joints[:, HIPS, 2].min(axis=1) - 0.3
    assert (upside_down & (joints[:, FEET, 2].max(axis=1) > joints[:, Joint.LEFT_HIP, 2])).sum() > 20
    assert (shown["sitting"][:, HIPS, 2].max(axis=1) < 0.3).sum() > 30
    assert shown["kicks"][:, FEET, 2].max() > 0.5
    joints = shown["crossed_punches"]
    across, hands = joints[:, Joint.LEFT_SHOULDER] - joints[:, Joint.RIGHT_SHOULDER], joints[:, HANDS[0]] - joints[:, HANDS[1]]
    assert ((hands * across).sum(axis=1) < 0).sum() > 15
    assert num_headings(shown["turns"]) == 8


def test_difficulty_increases():
    maker = Smmc10Sim(Smmc10SimConfig(seed=6))
    motions = {index: joints_world_m(maker.studio, maker.take(index)) for index in (0, 18, 21, 23)}

    def speed(index: int, joints: list[Joint]) -> float:
        """The 98th percentile of the speed after the start, metres per second."""
        step = np.diff(motions[index][50:, joints], axis=0)
        return float(np.quantile(np.linalg.norm(step, axis=-1).max(axis=1), 0.98)) * Smmc10Sim.fps

    assert speed(0, FEET) < 0.5 and 0.3 < speed(0, HANDS) < 5
    assert speed(21, FEET) > 2.5 and speed(18, HANDS) > 3.0
    assert num_headings(motions[23]) == 8 and num_headings(motions[0]) <= 3


def test_the_markers_of_every_joint_are_near_it_on_the_skin():
    film = film_of(Smmc10Sim(Smmc10SimConfig(seed=3)), 0, frames=56)
    assert set(JOINT_MARKERS) == set(Joint)
    for joint, names in JOINT_MARKERS.items():
        positions = film.markers_m[:, [list(MARKERS).index(name) for name in names]].mean(axis=1)
        assert np.nanmax(np.linalg.norm(positions - film.joints_camera_m[:, joint], axis=1)) < 0.15, joint
    for joint in (Joint.HEAD, Joint.NECK, Joint.TORSO):  # in the middle
        sides = Counter(name[0] for name in JOINT_MARKERS[joint] if name not in ("C7", "CLAV"))
        assert sides["L"] == sides["R"]
    hands = film.markers_m[:, list(MARKERS).index("LWRI")] - film.joints_camera_m[:, Joint.LEFT_HAND]
    assert np.nanmin(np.linalg.norm(hands, axis=1)) > 0.01


def test_the_trunk_occludes_its_back_from_cameras_in_front(maker, takes):
    studio, played = maker.studio, takes[0][0].played
    studio.pose(played, 0, np.zeros(3))
    skin_m, offset_m = studio.renderer.vertices_world_m(), 8 * studio.scene.facing_world()
    for place_m, seen in ((offset_m, "1100"), (-offset_m, "0011"), (np.zeros(3), "1111")):
        tracked = dict(zip(MARKERS, tracked_markers(skin_m, place_m).tolist(), strict=True))
        assert [tracked[name] for name in ("STRN", "CLAV", "T10", "C7")] == [one == "1" for one in seen]


@pytest.mark.parametrize("fps", [25.0, 120.0])
@pytest.mark.parametrize("acceleration_m_s2", [40.0, 60.0])
def test_hips_that_accelerate_as_no_dancer_does_are_an_error_of_the_recording(fps: float, acceleration_m_s2: float) -> None:
    seconds = np.arange(10) / fps
    root_m = np.stack([0 * seconds, 0 * seconds, acceleration_m_s2 * seconds**2 / 2], axis=1)
    assert is_faulty(Motion(np.zeros((10, 23, 4)), root_m, fps, "", 0.8)) == (acceleration_m_s2 > 50)


def test_people_for_whom_nothing_fits_are_drawn_again(monkeypatch):
    maker, drawn = EvalSim(benchmark=EvalSimConfig(seed=3)), []

    def draw(self, rng, index, frames, people):
        drawn.append((people(0).bare_m, rng.random()))
        return None if len(drawn) < 250 else "take"

    monkeypatch.setattr(EvalSim, "draw", draw)
    assert maker.take(5) == "take"
    people, numbers = zip(*drawn, strict=True)
    assert len(set(numbers)) == len(numbers)  # no motion is tried twice
    changes = [k for k in range(1, len(people)) if not np.array_equal(people[k], people[k - 1])]
    assert changes == [100, 200]
    np.testing.assert_array_equal(people[0], maker.person(maker.first_person(5)).bare_m)
    monkeypatch.setattr(EvalSim, "draw", lambda *_: None)
    with pytest.raises(InputError, match="seq_05: none of 300 motions"):
        maker.take(5)
