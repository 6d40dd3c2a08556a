"""The stand-ins for EVAL and SMMC-10: what their sequences show, and the markers of the second."""

from collections import Counter

import numpy as np
import pytest
from stand_ins import joints_world_m

from kpopnet.skeleton import Joint
from synth.body.markers import MARKERS, tracked_markers
from synth.motion.choreography.programmes import Y_POSE_S
from synth.scene.mesh import about_z
from synth.simulated.eval_sim import EvalSim, EvalSimConfig
from synth.simulated.film import DISTANCE_RANGE_M, Take
from synth.simulated.smmc10_sim import JOINT_MARKERS, Smmc10Sim, Smmc10SimConfig

CAMERA, FPS, KINDS = EvalSim.camera, EvalSim.fps, EvalSim.kinds


def num_headings(joints_m: np.ndarray) -> int:
    """How many of eight directions the hips face."""
    across = joints_m[:, Joint.LEFT_HIP, :2] - joints_m[:, Joint.RIGHT_HIP, :2]
    return len(set((np.degrees(np.arctan2(across[:, 1], across[:, 0])) // 45).astype(int).tolist()))


@pytest.fixture(scope="module")
def maker() -> EvalSim:
    return EvalSim(EvalSimConfig(seed=6))


@pytest.fixture(scope="module")
def takes(maker: EvalSim) -> dict[str, tuple[Take, np.ndarray]]:
    """The first eight sequences by kind, with their true joints (T, 15, 3) in the world."""
    found = {}
    for index in range(len(KINDS)):
        take = maker.take(index)
        found[f"{KINDS[index]}_{index}"] = take, joints_world_m(maker.studio, take)
    return found


def test_every_kind_is_shown_three_times_by_different_people(maker):
    sequences = EvalSimConfig().sequences
    assert Counter(maker.kind(index) for index in range(sequences)) == Counter(EvalSim.kinds * 3)
    assert len({maker.person(index).stature_m for index in range(sequences)}) == sequences


def test_every_sequence_begins_in_the_y_pose_facing_the_camera(takes):
    held = slice(0, round(Y_POSE_S * FPS))
    for take, joints in takes.values():
        body = joints[held]
        to_camera = -np.append(take.place_m[:2], 0) / np.linalg.norm(take.place_m[:2])
        across = body[:, Joint.LEFT_SHOULDER] - body[:, Joint.RIGHT_SHOULDER]
        across /= np.linalg.norm(across, axis=1, keepdims=True)
        assert (np.abs(across @ to_camera) < np.sin(np.radians(25))).all()
        leftwards = np.cross([0, 0, 1.0], to_camera)
        for side, sign in (("LEFT", 1), ("RIGHT", -1)):
            arm = body[:, Joint[f"{side}_HAND"]] - body[:, Joint[f"{side}_SHOULDER"]]
            rise = np.degrees(np.arctan2(arm[:, 2], sign * (arm @ leftwards)))
            assert (rise > 20).all() and (rise < 70).all()
            foot = body[:, Joint[f"{side}_FOOT"]] - body[:, [Joint.LEFT_HIP, Joint.RIGHT_HIP]].mean(axis=1)
            assert (sign * (foot @ leftwards) > 0.12).all() and (body[:, Joint[f"{side}_FOOT"], 2] < 0.2).all()
        assert np.linalg.norm(np.diff(body, axis=0), axis=-1).max() * FPS < 0.2
        # Afterwards they move.
        assert np.linalg.norm(joints[len(body) + 25] - body[-1], axis=-1).max() > 0.3


def test_bodies_touch_the_floor_and_stay_inside_image_and_room(maker, takes):
    scene, renderer = maker.studio.scene, maker.studio.renderer
    for take, _ in takes.values():
        scene.set_person(take.played.person)
        back, left, right = take.room.clear_m()
        lowest = []
        for frame in range(0, len(take.played), 9):
            scene.pose(take.played.local[frame], take.played.hips_m[frame] + take.place_m)
            skin = renderer.vertices_world_m()
            lowest.append(skin[:, 2].min())
            assert skin[:, 0].min() > left and skin[:, 0].max() < right
            assert skin[:, 1].min() > DISTANCE_RANGE_M[0] - 0.05 and skin[:, 1].max() < min(back, DISTANCE_RANGE_M[1] + 0.05)
            u, v, z = CAMERA.project(take.view.to_camera(skin)).T
            assert z.min() > 0 and u.min() >= 0 and v.min() >= 0 and u.max() <= 319 and v.max() <= 239
        assert min(lowest) > -1e-4 and max(lowest) < 0.35
        assert np.median(lowest) < 0.03


def test_a_turned_motion_is_the_same_from_another_side(maker, takes):
    played = next(iter(takes.values()))[0].played
    joints_m, turned_m = (
        maker.studio.joints_world_m(one.person, one.local[:40], one.hips_m[:40]) for one in (played, played.turned(0.7))
    )
    np.testing.assert_allclose(turned_m, joints_m @ about_z(0.7).T, atol=1e-5)


def test_each_kind_shows_its_motion(takes):
    def of(kind: str) -> tuple[Take, np.ndarray]:
        return next(found for name, found in takes.items() if name.startswith(kind))

    _, joints = of("handstand")
    upside_down = joints[:, Joint.HEAD, 2] < joints[:, [Joint.LEFT_HIP, Joint.RIGHT_HIP], 2].min(axis=1) - 0.3
    upside_down &= joints[:, [Joint.LEFT_FOOT, Joint.RIGHT_FOOT], 2].max(axis=1) > joints[:, Joint.LEFT_HIP, 2]
    assert upside_down.sum() > 20
    _, joints = of("sitting")
    assert (joints[:, [Joint.LEFT_HIP, Joint.RIGHT_HIP], 2].max(axis=1) < 0.3).sum() > 30
    _, joints = of("kicks")
    kicking = joints[:, [Joint.LEFT_FOOT, Joint.RIGHT_FOOT], 2].max(axis=1)
    assert kicking.max() > 0.5
    _, joints = of("crossed_punches")
    across = joints[:, Joint.LEFT_SHOULDER] - joints[:, Joint.RIGHT_SHOULDER]
    hands = joints[:, Joint.LEFT_HAND] - joints[:, Joint.RIGHT_HAND]
    assert ((hands * across).sum(axis=1) < 0).sum() > 15
    _, joints = of("turns")
    assert num_headings(joints) == 8


@pytest.fixture(scope="module")
def smmc10() -> Smmc10Sim:
    return Smmc10Sim(Smmc10SimConfig(seed=6))


@pytest.fixture(scope="module")
def motions(smmc10: Smmc10Sim) -> dict[int, np.ndarray]:
    """True joints (T, 15, 3) in the world of a few easy and difficult sequences."""
    takes = {index: smmc10.take(index) for index in (0, 18, 21, 23)}
    return {index: joints_world_m(smmc10.studio, take) for index, take in takes.items()}


def test_difficulty_increases(motions):
    def speed(index: int, *joints: Joint) -> float:
        """The 98th percentile of the speed after the start, metres per second."""
        step = np.diff(motions[index][50:, joints], axis=0)
        return float(np.quantile(np.linalg.norm(step, axis=-1).max(axis=1), 0.98)) * Smmc10Sim.fps

    feet, hands = (Joint.LEFT_FOOT, Joint.RIGHT_FOOT), (Joint.LEFT_HAND, Joint.RIGHT_HAND)
    assert speed(0, *feet) < 0.5 and 0.3 < speed(0, *hands) < 5
    assert speed(21, *feet) > 2.5 and speed(18, *hands) > 3.0

    assert num_headings(motions[23]) == 8 and num_headings(motions[0]) <= 3


def test_the_markers_of_every_joint_are_near_it():
    film = Smmc10Sim(Smmc10SimConfig(seed=3, sequences=2), frames=(50, 56)).film(0)
    assert set(JOINT_MARKERS) == set(Joint)
    for joint, names in JOINT_MARKERS.items():
        positions = film.markers_camera_m[:, [list(MARKERS).index(name) for name in names]].mean(axis=1)
        distance = np.linalg.norm(positions - film.joints_camera_m[:, joint], axis=1)
        # Markers are near the joint but on the skin, so there is an offset between them.
        assert distance.max() < 0.15, joint
    hands = film.markers_camera_m[:, list(MARKERS).index("LWRI")] - film.joints_camera_m[:, Joint.LEFT_HAND]
    assert np.linalg.norm(hands, axis=1).min() > 0.01


def test_the_trunk_occludes_its_back_from_cameras_in_front(smmc10):
    scene, take = smmc10.studio.scene, smmc10.take(0)
    scene.set_person(take.played.person)
    scene.pose(take.played.local[0], take.played.hips_m[0])
    skin_m, offset_m = smmc10.studio.renderer.vertices_world_m(), 8 * scene.facing_world()

    def visible(place_m: np.ndarray) -> list[bool]:
        tracked = dict(zip(MARKERS, tracked_markers(skin_m, place_m).tolist(), strict=True))
        return [tracked[name] for name in ("STRN", "CLAV", "T10", "C7")]

    assert visible(offset_m) == [True, True, False, False]
    assert visible(-offset_m) == [False, False, True, True]
    assert visible(np.zeros(3)) == [True, True, True, True]
