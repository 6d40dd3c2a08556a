"""Statistics of silhouettes on analytic shapes, and the rule that selects upright people."""

import math

import numpy as np
import pytest

from kpopnet.camera import Camera
from kpopnet.skeleton import Joint
from synth.realism import shapes
from synth.realism.selection import is_standing, is_upright
from synth.realism.shapes import Frame

CAMERA = Camera.centred(285.0, 320, 240)
Z_M = 2.85  # one pixel is one centimetre


def standing_joints() -> np.ndarray:
    """(15, 3) metres: a person of 1.7 m who faces the camera, hands down, feet 20 cm apart."""
    joints = np.zeros((15, 3))
    heights = {Joint.HEAD: 1.6, Joint.NECK: 1.4, Joint.TORSO: 1.15}
    for joint, height in heights.items():
        joints[joint] = 0, -height, Z_M
    pairs = {
        "SHOULDER": (0.2, 1.4),
        "ELBOW": (0.25, 1.1),
        "HAND": (0.28, 0.8),
        "HIP": (0.1, 0.9),
        "KNEE": (0.1, 0.5),
        "FOOT": (0.1, 0.05),
    }
    for name, (x, height) in pairs.items():
        joints[Joint[f"RIGHT_{name}"]], joints[Joint[f"LEFT_{name}"]] = (-x, -height, Z_M), (x, -height, Z_M)
    return joints


def frame(depth_m: np.ndarray, joints_camera_m: np.ndarray | None = None) -> Frame:
    return Frame("drawn", depth_m.astype(np.float32), CAMERA, standing_joints() if joints_camera_m is None else joints_camera_m)


def blocks(*boxes: tuple[int, int, int, int]) -> Frame:
    """A frame in which boxes of rows y0 to y1 and columns x0 to x1 lie Z_M away."""
    depth_m = np.zeros((240, 320))
    for y0, y1, x0, x1 in boxes:
        depth_m[y0:y1, x0:x1] = Z_M
    return frame(depth_m)


PERSON = blocks((40, 120, 140, 180), (120, 192, 142, 158), (120, 192, 162, 178), (192, 200, 138, 182))
"""160 pixels high: a trunk 40 wide, two legs of 16, a block of feet of 44."""


OF_WHOLE_BODIES = (
    shapes.area_share,
    shapes.shins_width,
    shapes.thighs_width,
    shapes.feet_width_cm,
    shapes.outline_shape,
    shapes.raggedness,
)


def test_widths_and_area_of_a_person_of_blocks() -> None:
    area_px = 80 * 40 + 2 * 72 * 16 + 8 * 44
    assert shapes.area_share(PERSON) == pytest.approx(area_px / 160**2)
    assert shapes.shins_width(PERSON) == pytest.approx(32 / 160)
    assert shapes.thighs_width(PERSON) == pytest.approx(32 / 160)
    assert shapes.feet_width_cm(PERSON) == pytest.approx(44, rel=1e-6)
    assert shapes.distance_m(PERSON) == pytest.approx(Z_M)


def test_legs_that_touch_have_no_width_of_shins_but_one_of_thighs() -> None:
    closed = blocks((40, 120, 140, 180), (120, 200, 144, 176))
    assert math.isnan(shapes.shins_width(closed))
    assert shapes.thighs_width(closed) == pytest.approx(32 / 160)


def test_specks_beside_the_person_change_no_measure_of_the_body() -> None:
    depth_m = PERSON.depth_m.copy()
    depth_m[230, 20] = depth_m[5, 300] = Z_M
    for measure in (shapes.area_share, shapes.shins_width, shapes.feet_width_cm, shapes.outline_shape, shapes.raggedness):
        assert measure(frame(depth_m)) == measure(PERSON)


def test_a_silhouette_at_the_border_is_cut_and_has_no_height() -> None:
    cut = blocks((100, 240, 140, 180))
    assert shapes.is_cut(cut) == 1 and shapes.is_cut(PERSON) == 0
    assert all(math.isnan(measure(cut)) for measure in OF_WHOLE_BODIES)


def test_an_empty_frame_has_no_statistics() -> None:
    empty = blocks()
    assert all(
        math.isnan(measure(empty)) for measure in (shapes.distance_m, shapes.is_cut, shapes.area_share, shapes.hole_share)
    )
    assert all(math.isnan(measure(empty)) for measure in (shapes.roughness_steps, shapes.ridge_share, shapes.feet_width_cm))


def test_the_outline_of_a_disc_is_round_and_teeth_make_it_longer() -> None:
    v, u = np.mgrid[:240, :320]
    disc = np.where((v - 120) ** 2 + (u - 160) ** 2 < 80**2, Z_M, 0)
    assert shapes.outline_shape(frame(disc)) == pytest.approx(4 * math.pi, rel=0.15)  # of pixels: up to 8 % too long
    assert shapes.raggedness(frame(disc)) == pytest.approx(1, abs=0.03)
    toothed = disc.copy()
    toothed[::2, :160] = 0
    toothed[41:199, 158:162] = Z_M
    assert shapes.outline_shape(frame(toothed)) > 20 * shapes.outline_shape(frame(disc))


def test_ragged_outlines_differ_from_spread_limbs() -> None:
    slim, spread = blocks((40, 200, 140, 180)), blocks((40, 60, 120, 200), (60, 200, 120, 132), (60, 200, 188, 200))
    assert shapes.outline_shape(spread) > 1.5 * shapes.outline_shape(slim)
    assert shapes.raggedness(spread) == pytest.approx(shapes.raggedness(slim), abs=0.05)
    depth_m = slim.depth_m.copy()
    depth_m[40:200:4, 140:142] = 0  # 40 notches of 2 pixels
    assert shapes.raggedness(frame(depth_m)) > shapes.raggedness(slim) + 0.15


def test_holes_count_and_the_loop_of_an_arm_does_not() -> None:
    block = blocks((40, 200, 100, 220)).depth_m.copy()
    block[60:64, 120:125] = 0  # 20 cm^2
    block[100, 150] = 0
    assert shapes.hole_share(frame(block)) == pytest.approx(21 / (160 * 120))
    block[120:140, 110:130] = 0  # 400 cm^2
    assert shapes.hole_share(frame(block)) == pytest.approx(21 / (160 * 120 - 400))


def test_roughness_is_the_noise_of_the_disparity_on_a_slope_and_ignores_outlines() -> None:
    steps = 120 + 0.2 * np.arange(320) + np.where(np.arange(320) > 160, 30, 0)
    slope = np.broadcast_to(steps, (240, 320))
    assert shapes.roughness_steps(frame(345 / slope)) < 1e-3
    noisy = slope + 0.3 * np.random.default_rng(0).normal(size=slope.shape)
    assert shapes.roughness_steps(frame(345 / noisy)) == pytest.approx(0.3, rel=0.03)


@pytest.mark.parametrize("width_px", [9, 15])
def test_the_ridge_is_the_middle_of_a_limb(width_px: int) -> None:
    assert 1 / width_px <= shapes.ridge_share(blocks((40, 200, 150, 150 + width_px))) <= 3 / width_px
    assert shapes.ridge_share(frame(np.full((240, 320), Z_M))) == 0  # no edge, no ridge


def test_joints_lie_behind_the_surface_by_their_own_depth() -> None:
    joints = standing_joints()
    joints[:, 1] += 0.9  # the middle of the body on the optical axis
    joints[Joint.RIGHT_KNEE, 2] += 0.06
    joints[Joint.LEFT_KNEE, 2] += 0.10
    wall = frame(np.full((240, 320), Z_M), joints)
    assert shapes.joint_depth_cm(wall, (Joint.RIGHT_KNEE, Joint.LEFT_KNEE)) == pytest.approx(8, abs=1e-3)
    assert shapes.joint_depth_cm(wall, (Joint.HEAD,)) == pytest.approx(0, abs=1e-3)
    assert math.isnan(shapes.joint_depth_cm(frame(np.zeros((240, 320)), joints), (Joint.HEAD,)))
    joints[Joint.HEAD] = np.nan
    assert math.isnan(shapes.joint_depth_cm(frame(np.full((240, 320), Z_M), joints), (Joint.HEAD,)))


def changed(**moves: tuple[float, float, float]) -> np.ndarray:
    """The standing joints with some of them moved, metres."""
    joints = standing_joints()
    for name, by_m in moves.items():
        joints[Joint[name]] += by_m
    return joints


def sitting() -> np.ndarray:
    """The same person on the floor, both legs stretched towards the camera."""
    joints = standing_joints()
    for side in ("RIGHT", "LEFT"):
        hip_m = joints[Joint[f"{side}_HIP"]]
        joints[Joint[f"{side}_KNEE"]], joints[Joint[f"{side}_FOOT"]] = hip_m - (0, 0, 0.4), hip_m - (0, 0, 0.8)
    return joints


@pytest.mark.parametrize(
    ("joints", "standing", "upright"),
    [
        (changed(), True, True),
        (changed(RIGHT_HAND=(0, -1.0, 0)), True, False),  # a hand above the head
        (changed(RIGHT_SHOULDER=(0.1, 0, 0.2), LEFT_SHOULDER=(-0.1, 0, -0.2)), True, False),  # turned by 63 degrees
        (changed(RIGHT_KNEE=(0, 0, -0.3)), False, False),  # bent
        (changed(RIGHT_KNEE=(0, -0.4, -0.4), RIGHT_FOOT=(0, -0.4, -0.8)), False, False),  # a foot in the air
        (changed(NECK=(0.3, 0, 0)), False, False),  # 31 degrees
        (sitting(), False, False),
        (changed(RIGHT_FOOT=(0, 0, np.nan)), False, False),
        (changed(RIGHT_KNEE=(-0.2, 0, 0), RIGHT_FOOT=(-0.4, 0, 0), LEFT_KNEE=(0.2, 0, 0), LEFT_FOOT=(0.4, 0, 0)), True, True),
    ],
)
def test_upright_people_stand_on_straight_legs_and_face_the_camera(joints, standing: bool, upright: bool) -> None:
    assert is_standing(joints[None]).tolist() == [standing]
    assert is_upright(joints[None]).tolist() == [upright]
