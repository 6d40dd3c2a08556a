"""Depth of a user becomes metres: units are recognised by type, and refused where they contradict the numbers."""

import numpy as np
import pytest

from kpopnet.camera import CAMERAS, MOST_PIXELS, MOST_SIDE, Camera, depth_in_metres, sequence_in_metres, subsampled
from kpopnet.errors import InputError
from kpopnet.sources.camera_files import read_optics
from kpopnet.sources.folders import TUM_CAMERA


def person(depth: float, dtype: type) -> np.ndarray:
    """(2, 240, 320): a rectangle of 4 % of the pixels at this depth, 0 elsewhere."""
    image = np.zeros((2, 240, 320), dtype)
    image[:, 80:140, 100:150] = depth
    return image


def test_floating_point_millimetres_are_refused():
    with pytest.raises(InputError, match=r"depth sequence: .* 2580 m .* look like millimetres.*divide it by 1000"):
        sequence_in_metres(person(2580, np.float32), CAMERAS["kinect_v1"])


def test_metres_and_integer_millimetres_are_kept():
    for depth in (person(2.5, np.float32), person(2.5, np.float64), person(2500, np.uint16), person(2500, np.uint32)):
        np.testing.assert_array_equal(depth_in_metres(depth), person(2.5, np.float32))
    for shape in ((4, 4), (0, 4, 4)):
        np.testing.assert_array_equal(depth_in_metres(np.zeros(shape, np.float32)), np.zeros(shape))
    depth = person(2.5, np.float32)
    depth[:, 0, :100] = 3000.0  # single pixels far away are no millimetres
    np.testing.assert_array_equal(depth_in_metres(depth), depth)


def test_metres_as_integers_are_refused():
    with pytest.raises(InputError, match=r"farther away than 3 mm: these look like metres.*multiply by 1000"):
        depth_in_metres(person(3, np.uint16))
    few = np.zeros((240, 320), np.uint16)
    few[0, :20] = 3  # a covered lens has hot pixels
    assert depth_in_metres(few).max() == np.float32(0.003)
    near = person(3, np.uint16)  # a hand before a camera, whose unit is known
    np.testing.assert_allclose(depth_in_metres(near, unit_known=True), person(0.003, np.float32))


def test_a_picture_of_depth_is_refused_with_advice():
    with pytest.raises(InputError, match=r"got uint8; a picture of depth in 256 shades holds no distances"):
        depth_in_metres(person(200, np.uint8))


@pytest.mark.parametrize(
    "wrong",
    [(None, 1, 0, 0, 2, 2), (1, 1e-300, 0, 0, 2, 2), (1, 1, 0, np.nan, 2, 2), (1, 1, 0, 0, 2.5, 2), (1, 1, 0, 0, 2, 0)],
)
def test_what_is_no_camera_is_refused(wrong):
    with pytest.raises(InputError, match="a camera's"):
        Camera(*wrong)


def test_the_sizes_of_an_array_are_those_of_a_camera():
    """Numpy's small integers would overflow in a product."""
    depth_m, size = np.ones((1200, 1600), np.float32), np.array([1600, 1200], np.uint16)
    sizes = [subsampled(depth_m, Camera.centred(900.0, *those))[0].shape for those in (size, size.tolist())]
    assert sizes[0] == sizes[1] and max(sizes[0]) < 1600


@pytest.mark.parametrize(("width", "height"), [(1280, 720), (4096, 2048), (1, 100_000)])
def test_large_images_lose_pixels_and_none_moves(width, height):
    camera = Camera(800.0, 810.0, 0.4 * width, 0.6 * height, width, height)
    depth_m = np.random.default_rng(0).uniform(1, 4, (height, width)).astype(np.float32)
    fewer_m, theirs = subsampled(depth_m, camera)
    assert fewer_m.shape == (theirs.height, theirs.width) and fewer_m.size <= MOST_PIXELS and max(fewer_m.shape) <= MOST_SIDE
    assert (fewer_m is depth_m) == (width == 1280)
    row, column = theirs.height // 2, theirs.width // 3
    point_m = theirs.back_project([column, row, fewer_m[row, column]])
    u, v, z = camera.project(point_m)
    assert depth_m[round(v), round(u)] == np.float32(z) and abs(u - round(u)) < 1e-3 > abs(v - round(v))


@pytest.mark.parametrize(
    ("fx", "fy", "width", "height"), [(300.0, 450.0, 320, 361), (600.0, 300.0, 640, 240), (290.0, 300.0, 320, 240)]
)
def test_of_pixels_that_are_not_square_the_nearest_of_square_ones_are_taken(fx, fy, width, height):
    camera = Camera(fx, fy, 0.45 * width, 0.6 * height, width, height)
    depth_m = np.random.default_rng(0).uniform(1, 4, (2, height, width)).astype(np.float32)
    square_m, theirs = subsampled(depth_m, camera)
    assert theirs.fx / theirs.fy == pytest.approx(1, abs=0.05) and square_m.shape == (2, theirs.height, theirs.width)
    for row, column in ((0, 0), (theirs.height // 3, theirs.width // 2), (theirs.height - 1, theirs.width - 1)):
        u, v, _ = camera.project(theirs.back_project([column, row, 2.0]))
        near = depth_m[0, max(int(v - 0.01), 0) : int(v + 1.01) + 1, max(int(u - 0.01), 0) : int(u + 1.01) + 1]
        assert square_m[0, row, column] in near and -0.6 < u < width - 0.4 and -0.6 < v < height - 0.4


@pytest.mark.parametrize(("fx", "fy", "size"), [(30.0, 3000.0, (1, 32)), (3000.0, 30.0, (24, 1))])
def test_pixels_higher_than_twice_the_image_are_one_row(fx, fy, size):
    fewer_m, camera = subsampled(np.ones((24, 32), np.float32), Camera(fx, fy, 16, 12, 32, 24))
    assert fewer_m.shape == (camera.height, camera.width) == size


def test_what_is_no_depth_is_not_measured():
    depth = person(2.5, np.float64)
    depth[0, 0, :6] = np.nan, np.inf, -np.inf, -1, 1e300, 1e16
    assert not depth_in_metres(depth)[0, 0].any()


def test_a_field_of_view_spans_the_image_from_edge_to_edge():
    camera = Camera.from_fov(90, 320, 240)
    assert camera.fx == pytest.approx(160)
    left, right = camera.back_project(np.array([[-0.5, 0, 1], [319.5, 0, 1]]))[:, 0]  # edges of pixels
    assert np.degrees(np.arctan(right) - np.arctan(left)) == pytest.approx(90)
    for wrong in (0, 180, float("nan"), "58", None):
        with pytest.raises(InputError, match="field of view"):
            Camera.from_fov(wrong, 320, 240)
    for make in (Camera.from_fov, Camera.centred):
        for wrong in ("320", None, 320.0, 0):
            with pytest.raises(InputError, match="a camera's image must have whole pixels"):
                make(90, wrong, 240)


def test_a_matrix_of_intrinsics_is_read_and_a_foreign_one_refused():
    matrix = np.array([[500, 0, 320], [0, 510, 240], [0, 0, 1.0]])
    assert Camera.from_intrinsics(matrix, 640, 480) == Camera(500, 510, 320, 240, 640, 480)
    for wrong in (None, matrix.T, matrix[:2], matrix * 2):
        with pytest.raises(InputError, match="camera matrix"):
            Camera.from_intrinsics(wrong, 640, 480)


def test_a_changed_images_camera_projects_to_where_the_pixels_went():
    camera, point_m = Camera(500.0, 510.0, 300.0, 250.0, 640, 480), np.array([0.3, -0.2, 2.0])
    u, v, _ = camera.project(point_m)
    x, y, z = point_m
    turned, mirrored, part = camera.turned(), camera.mirrored(), camera.cropped(40, 30, 500, 400)
    assert (turned.width, turned.height) == (480, 640) and (part.width, part.height) == (500, 400)
    np.testing.assert_allclose(turned.project([-y, x, z]), [479 - v, u, z])  # clockwise: the first row is the last column
    np.testing.assert_allclose(mirrored.project([-x, y, z]), [639 - u, v, z])
    np.testing.assert_allclose(part.project(point_m), [u - 40, v - 30, z])
    smaller = camera.resized(160, 240)
    np.testing.assert_allclose(smaller.project(point_m), [(u + 0.5) / 4 - 0.5, (v + 0.5) / 2 - 0.5, z])


@pytest.mark.parametrize(
    "wrong", [3.0, None, "1, 2, 3", [0.1, 0.2], np.ones((3, 4)), np.array([["a", "b", "c"]]), np.array([1, 2, None])]
)
def test_what_are_no_points_is_refused(wrong):
    for convert in (CAMERAS["kinect_2"].project, CAMERAS["kinect_2"].back_project):
        with pytest.raises(InputError, match=r"expected \(\.\.\., 3\) numbers"):
            convert(wrong)


def test_points_are_of_one_image_in_metres():
    camera = Camera.centred(50.0, 16, 12)
    for wrong, message in (
        (np.full((12, 16), 2, np.float16), "depth image: expected floating-point metres of 32 or 64 bits, got float16"),
        (np.full((12, 16), 2000, np.uint16), "depth image: expected floating-point metres of 32 or 64 bits, got uint16"),
        ([[2.0]], "depth image: expected floating-point metres of 32 or 64 bits, got list"),
        (np.ones((12, 12)), r"an image of shape \(12, 12\), expected the camera's"),
        (np.ones((1, 12, 16)), r"an image of shape \(1, 12, 16\), expected the camera's"),
    ):
        with pytest.raises(InputError, match=message):
            camera.points(wrong)


@pytest.mark.parametrize("kind", ["<u2", ">u2"])
def test_the_largest_of_sixteen_bits_is_not_measured(kind):
    depth = person(2500, np.uint16)
    depth[:, :10] = 65535
    np.testing.assert_array_equal(depth_in_metres(depth.astype(kind)), person(2.5, np.float32))
    assert depth_in_metres(np.full((4, 4), 65535, np.uint32)).min() == np.float32(65.535)


def test_centimetres_are_refused():
    image = np.zeros((240, 320), np.float32)
    image[80:140, 100:150] = 258.0
    with pytest.raises(InputError, match="centimetres"):
        depth_in_metres(image)


def test_presets_have_the_numbers_of_their_data_sheets():
    known = {
        "kinect_2": (365.0, 512, 424),
        "azure_kinect": (504.0, 640, 576),
        "realsense": (433.0, 848, 480),
        "eval": (285.7, 320, 240),
        "smmc10": (204.795, 144, 176),
    }
    for name, (focal_px, width, height) in known.items():
        assert CAMERAS[name] == Camera(focal_px, focal_px, (width - 1) / 2, (height - 1) / 2, width, height), name
    assert Camera(525.0, 525.0, 319.5, 239.5, 640, 480) == TUM_CAMERA
    assert read_optics("azure_kinect", 320, 288).camera == CAMERAS["azure_kinect"].resized(320, 288)
