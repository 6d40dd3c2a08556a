"""The stand-in for SMMC-10: its content, its separation from training sets, and its files."""

import numpy as np
import pytest
from stand_ins import joints_world_m

from kpopnet.skeleton import Joint
from synth.body.markers import MARKERS, tracked_markers
from synth.simulated.smmc10_sim import JOINT_MARKERS, Smmc10Sim, Smmc10SimConfig

SHORT = Smmc10Sim(Smmc10SimConfig(seed=3, sequences=2), frames=(50, 56))


@pytest.fixture(scope="module")
def maker() -> Smmc10Sim:
    return Smmc10Sim(Smmc10SimConfig(seed=6))


@pytest.fixture(scope="module")
def motions(maker: Smmc10Sim) -> dict[int, np.ndarray]:
    """True joints (T, 15, 3) in the world of a few easy and difficult sequences."""
    takes = {index: maker.take(index) for index in (0, 18, 21, 23)}
    return {index: joints_world_m(maker.studio, take) for index, take in takes.items()}


def test_difficulty_increases(motions):
    def speed(index: int, *joints: Joint) -> float:
        """The 98th percentile of the speed after the start, metres per second."""
        step = np.diff(motions[index][50:, joints], axis=0)
        return float(np.quantile(np.linalg.norm(step, axis=-1).max(axis=1), 0.98)) * Smmc10Sim.fps

    feet, hands = (Joint.LEFT_FOOT, Joint.RIGHT_FOOT), (Joint.LEFT_HAND, Joint.RIGHT_HAND)
    assert speed(0, *feet) < 0.5 and 0.3 < speed(0, *hands) < 5
    assert speed(21, *feet) > 2.5 and speed(18, *hands) > 3.0

    def headings(index: int) -> int:
        across = motions[index][:, Joint.LEFT_HIP, :2] - motions[index][:, Joint.RIGHT_HIP, :2]
        return len(set((np.degrees(np.arctan2(across[:, 1], across[:, 0])) // 45).astype(int).tolist()))

    assert headings(23) == 8 and headings(0) <= 3


def test_the_markers_of_every_joint_are_near_it():
    film = SHORT.film(0)
    assert set(JOINT_MARKERS) == set(Joint)
    for joint, names in JOINT_MARKERS.items():
        positions = film.markers_camera_m[:, [list(MARKERS).index(name) for name in names]].mean(axis=1)
        distance = np.linalg.norm(positions - film.joints_camera_m[:, joint], axis=1)
        # Markers are near the joint but on the skin, so there is an offset between them.
        assert distance.max() < 0.15, joint
    hands = film.markers_camera_m[:, list(MARKERS).index("LWRI")] - film.joints_camera_m[:, Joint.LEFT_HAND]
    assert np.linalg.norm(hands, axis=1).min() > 0.01


def test_the_trunk_occludes_its_back_from_cameras_in_front(maker):
    scene, take = maker.studio.scene, maker.take(0)
    scene.set_person(take.played.person)
    scene.pose(take.played.local[0], take.played.hips_m[0])
    skin_m, offset_m = maker.studio.renderer.vertices_world_m(), 8 * scene.facing_world()

    def visible(place_m: np.ndarray) -> list[bool]:
        tracked = dict(zip(MARKERS, tracked_markers(skin_m, place_m).tolist(), strict=True))
        return [tracked[name] for name in ("STRN", "CLAV", "T10", "C7")]

    assert visible(offset_m) == [True, True, False, False]
    assert visible(-offset_m) == [False, False, True, True]
    assert visible(np.zeros(3)) == [True, True, True, True]
