"""The stand-in for EVAL: its content, its separation from training sets, and its films."""

from collections import Counter

import numpy as np
import pytest
from stand_ins import joints_world_m

from kpopnet.skeleton import Joint
from synth.motion.choreography.programmes import Y_POSE_S
from synth.simulated.eval_sim import EvalSim, EvalSimConfig
from synth.simulated.film import DISTANCE_RANGE_M, Take

CAMERA, FPS, KINDS = EvalSim.camera, EvalSim.fps, EvalSim.kinds


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
    across = joints[:, Joint.LEFT_HIP, :2] - joints[:, Joint.RIGHT_HIP, :2]
    headings = np.degrees(np.arctan2(across[:, 1], across[:, 0]))
    assert len(set((headings // 45).astype(int).tolist())) == 8
