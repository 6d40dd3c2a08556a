"""People found upright: posture, heading, size, and what is refused."""

import numpy as np
import pytest
from cone_people import cone_body, cone_joints, draw_cones
from y_people import family, simulated

from kpopnet.camera import CAMERAS, Camera
from kpopnet.geometry.body import body_from_model, planar_pose
from kpopnet.geometry.depth_grid import build_depth_grid
from kpopnet.tracker.start import AVERAGE_MODEL, find_start, find_upright, sitting_pose
from synth.motion.limbs import upright

CAMERA = CAMERAS["kinect_v1"]


def found(joints_m: np.ndarray, size: float = 1.0, camera: Camera = CAMERA):
    body = body_from_model(AVERAGE_MODEL.scaled(size))
    return find_upright(build_depth_grid(draw_cones(joints_m, body, camera), camera))


@pytest.mark.parametrize(
    ("joints_m", "size"),
    [(planar_pose(AVERAGE_MODEL.scaled(size)) + np.array((0.2, -0.5, 3.0)), size) for size in (0.7, 0.9, 1.1)]
    + [(sitting_pose(AVERAGE_MODEL) + np.array((-0.3, -0.2, 2.7)), 1.0)],
    ids=["child", "small", "tall", "sitting"],
)
def test_a_standing_person_of_any_size_and_one_who_sits(joints_m: np.ndarray, size: float) -> None:
    upright_m, _ = found(joints_m, size)
    assert np.linalg.norm(upright_m - joints_m, axis=1).mean() < 0.06


def test_only_auto_starts_from_who_sits() -> None:
    depth_m = draw_cones(sitting_pose(AVERAGE_MODEL) + np.array((0.1, -0.2, 2.8)), body_from_model(AVERAGE_MODEL), CAMERA)
    grid = build_depth_grid(depth_m, CAMERA)
    standing, auto = (find_start(depth_m, grid, CAMERA, start)[1] for start in ("standing", "auto"))
    assert standing != AVERAGE_MODEL == auto, "a small person who stands, and one of average size who sits"


def test_the_size_does_not_depend_on_the_size_of_pixels() -> None:
    joints = planar_pose(AVERAGE_MODEL) + np.array((0, -0.5, 3.4))
    fine, coarse = (found(joints, camera=camera)[1].left_upper_leg_m for camera in (CAMERA, Camera.from_fov(58, 176, 144)))
    assert fine == pytest.approx(coarse, rel=0.02)


def test_raised_hands_a_lying_person_and_a_wall_are_refused() -> None:
    raised = cone_joints(60, 4)
    assert find_upright(build_depth_grid(draw_cones(raised, cone_body(raised), CAMERA), CAMERA)) is None
    lying = (planar_pose(AVERAGE_MODEL) + np.array((0, -0.5, 0)))[:, [1, 0, 2]] + np.array((0, 0.5, 3.0))
    assert found(lying) is None
    assert find_upright(build_depth_grid(np.full((CAMERA.height, CAMERA.width), 2.5, np.float32), CAMERA)) is None


def test_simulated_people_are_found() -> None:
    errors = []
    for depth_m, camera, joints_m in simulated(family(upright), 16, "train", 5):
        found = find_upright(build_depth_grid(depth_m, camera))
        errors.append(0.5 if found is None else np.linalg.norm(found[0] - joints_m, axis=1).mean())
    assert len(errors) > 2 and np.median(errors) < 0.07
