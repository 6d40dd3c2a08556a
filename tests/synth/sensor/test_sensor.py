import dataclasses
import math

import numpy as np
import pytest
from depth_sensors import CAMERA, measure, only, wall

from kpopnet.camera import CAMERAS, Camera
from synth.sensor.model import SENSORS, SensorConfig, measure_labelled, resolved


def step_scene(near=2.0, far=3.0):
    depth = wall(far)
    depth[60:180, 120:200] = near
    return depth


@pytest.mark.parametrize("name", SENSORS)
def test_equal_seeds_give_equal_images_and_other_seeds_other_images(name):
    depth, config = step_scene(), SENSORS[name]
    depth[5:9] = 0
    first, again, other = (measure(depth, config, seed) for seed in (1, 1, 2))
    assert np.array_equal(first, again)
    assert np.array_equal(first, other) == np.array_equal(first, depth) == (name == "ideal")
    assert first.dtype == np.float32 and np.isfinite(first).all()
    assert np.abs(np.median(first[first > 0]) - np.median(depth)) < 0.05


@pytest.mark.parametrize(("z", "grain_px"), [(1.0, 0.0), (4.0, 0.0), (2.5, 9.0)])
def test_axial_noise_of_a_wall_has_nguyens_sigma(z, grain_px):
    config = only(axial_floor_m=0.0012, axial_quadratic=0.0019, axial_offset_m=0.4, grain_px=grain_px)
    errors = np.stack([measure(wall(z), config, seed) - z for seed in range(3)])
    sigma = 0.0012 + 0.0019 * (z - 0.4) ** 2
    assert errors.std() == pytest.approx(sigma, rel=0.05)
    assert abs(errors.mean()) < 0.1 * sigma
    neighbours = np.corrcoef(errors[:, :, 1:].ravel(), errors[:, :, :-1].ravel())[0, 1]
    assert neighbours == pytest.approx(0, abs=0.02) if grain_px == 0 else neighbours > 0.7
    assert abs(np.corrcoef(errors[0].ravel(), errors[1].ravel())[0, 1]) < 0.1


def test_steep_surfaces_are_noisier():
    """A plane rotated by 75 degrees about the vertical: theta is 75 degrees minus the angle of the ray."""
    ray = (np.arange(CAMERA.width) - CAMERA.cx) / CAMERA.fx
    tilt = math.radians(75)
    z = 2.5 / (1 + ray * math.tan(tilt))
    depth = np.repeat(z[None], CAMERA.height, axis=0).astype(np.float32)
    error = measure(depth, only(axial_floor_m=0.0012, axial_grazing=0.0001))[5:-5] - depth[5:-5]
    for column in (170, 190, 210):
        theta = tilt - math.atan(ray[column])
        grazing = 0.0001 * theta**2 / (math.sqrt(z[column]) * (math.pi / 2 - theta) ** 2)
        sigma = 0.0012 + (grazing if theta > math.radians(60) else 0)
        assert error[:, column - 2 : column + 3].std() == pytest.approx(sigma, rel=0.12)


@pytest.mark.parametrize("camera", [CAMERA, Camera.centred(100, 80, 60)])
def test_depth_is_quantised_in_steps_of_an_eighth_of_a_disparity_pixel(camera):
    ramp = np.linspace(1.5, 3.5, camera.width, dtype=np.float32)  # recedes monotonically, so it casts no shadow
    depth = np.repeat(ramp[None], camera.height, axis=0)
    measured = measure(depth, only(baseline_m=0.075, disparity_step_px=0.125), camera=camera)
    steps = 575.5 * 0.075 * 8 / measured[measured > 0]
    assert np.allclose(steps, np.round(steps), atol=1e-3)
    step_m = measured[measured > 0] ** 2 / 345.3
    assert (np.abs(measured - depth)[measured > 0] <= 0.51 * step_m * 1.02).all()


@pytest.mark.parametrize("baseline_m", [0.075, -0.075])
def test_the_shadow_falls_away_from_the_projector_with_the_width_of_the_geometry(baseline_m):
    measured = measure(step_scene(2.0, 3.0), only(baseline_m=baseline_m))
    (lost,) = np.nonzero(measured[120] == 0)
    assert len(lost) == pytest.approx(CAMERA.fx * 0.075 * (1 / 2.0 - 1 / 3.0), abs=1)
    assert lost[-1] == 119 if baseline_m > 0 else lost[0] == 200
    assert not (measured[30] == 0).any()


def test_lateral_noise_moves_only_outlines():
    depth = step_scene()
    labels = (depth < 2.5).astype(np.uint8)
    config = only(lateral_px=0.8, grain_px=9.0)
    measured, seen = measure_labelled(depth, labels, CAMERA, config, np.random.default_rng(0))
    assert set(np.unique(measured)) == {0.0, 2.0}
    assert np.array_equal(seen > 0, measured > 0)
    moved = np.count_nonzero(seen != labels)
    assert 30 < moved < 400 and seen[64:176, 124:196].all()
    seen[56:184, 116:204] = 0
    assert not seen.any()
    # At twice the resolution the shift in pixels is twice as large.
    fine = Camera.centred(2 * CAMERA.fx, CAMERA.width, CAMERA.height)
    _, seen = measure_labelled(depth, labels, fine, config, np.random.default_rng(0))
    assert np.count_nonzero(seen != labels) > 1.3 * moved


def test_flying_pixels_lie_between_near_and_far_on_outlines_only():
    depth = step_scene()
    measured = measure(depth, only(flying_pixels=0.4))
    flying = measured != depth
    assert ((measured[flying] >= 2.0) & (measured[flying] <= 3.0)).all()
    outline = np.zeros(depth.shape, bool)
    outline[59:181, 119:201] = True
    outline[61:179, 121:199] = False
    assert not flying[~outline].any()
    assert flying.sum() / (2 * 2 * (80 + 120)) == pytest.approx(0.4, abs=0.08)
    assert 2.4 < measured[flying].mean() < 2.6


def test_time_of_flight_noise_grows_towards_the_corners_even_in_a_crop():
    camera = CAMERAS["kinect_2"]
    crop = camera.cropped(0, 0, 100, 80)
    error = measure(wall(2.0, crop), only("kinect_2", axial_radial=0.02), camera=crop) - 2.0
    across, down = (np.arange(100) - camera.cx) / camera.fx, (np.arange(80) - camera.cy) / camera.fy
    assert (error / (0.02 * (across**2 + down[:, None] ** 2))).std() == pytest.approx(1, rel=0.05)


@pytest.mark.parametrize("z", [2.0, 2.125, 2.375])
def test_wiggle_is_systematic(z):
    measured = measure(wall(z), only("kinect_2", wiggle_m=0.004, wiggle_period_m=0.5))
    assert measured == pytest.approx(z + 0.004 * math.sin(2 * math.pi * z / 0.5), abs=1e-4)


def test_pixel_dropout_draws_a_fraction_for_each_image():
    fractions = [(measure(wall(2.5), only(pixel_dropout=0.1), seed) == 0).mean() for seed in range(30)]
    assert max(fractions) <= 0.105 and np.std(fractions) > 0.015
    assert np.mean(fractions) == pytest.approx(0.05, abs=0.015)


def test_ellipses_have_the_configured_number_and_size():
    lost = [(measure(wall(2.5), only(ellipses_per_megapixel=60.0), seed) == 0).sum() for seed in range(60)]
    scale = CAMERA.fx / 575.5
    expected = 60 * 320 * 240 / scale**2 / 1e6 * math.pi * (3.75 * scale) ** 2
    assert np.mean(lost) == pytest.approx(expected, rel=0.2)


def test_the_end_of_a_limb_is_lost_but_no_surface_far_behind_it():
    config, end = only(limb_end_dropout=1.0), np.array([[0.1, 0.0, 2.0]])
    v, u = np.nonzero(measure(wall(2.05), config, limb_ends_m=end) == 0)
    assert u.mean() == pytest.approx(CAMERA.cx + 0.1 * CAMERA.fx / 2, abs=1)
    assert v.mean() == pytest.approx(CAMERA.cy, abs=1)
    assert 0.015 < math.sqrt(len(u) / math.pi) * 2.0 / CAMERA.fx < 0.065  # the radius
    for behind_or_missing in (end, np.full((2, 3), np.nan)):
        assert measure(wall(2.5), config, limb_ends_m=behind_or_missing).all()


def test_depth_out_of_range_and_empty_pixels_are_not_measured():
    depth = wall(2.5)
    depth[0], depth[1], depth[2] = 0.4, 3.1, 0
    measured = measure(depth, only(min_range_m=0.5, max_range_m=3.0))
    assert not measured[:3].any() and measured[3:].all()
    assert not measure(np.zeros((1, 1), np.float32), SENSORS["kinect_v1"], camera=Camera.centred(300, 1, 1)).any()


def test_a_named_sensor_has_its_published_terms_but_for_those_that_are_given():
    given = resolved(SensorConfig("swissranger", pixel_dropout=0.1))
    assert given == dataclasses.replace(resolved(SENSORS["swissranger"]), pixel_dropout=0.1)
    assert (given.axial_radial, given.ellipses_per_megapixel, given.lateral_px) == (0.0292, 80.0, 0.0)


def test_what_a_hole_erases_has_no_label():
    config, labels = only(ellipses_per_megapixel=60.0), np.ones((CAMERA.height, CAMERA.width), np.uint8)
    measured, seen = measure_labelled(wall(2.5), labels, CAMERA, config, np.random.default_rng(0))
    assert (measured == 0).any() and np.array_equal(seen > 0, measured > 0)


def test_one_factor_on_all_depths_of_an_image_has_the_given_deviation():
    small = Camera.centred(100, 8, 6)
    images = np.array([measure(wall(2.0, small), only(gain=0.01), seed, small) for seed in range(300)])
    assert np.ptp(images, axis=(1, 2)).max() == 0
    assert images[:, 0, 0].mean() == pytest.approx(2, abs=0.005) and images[:, 0, 0].std() == pytest.approx(0.02, rel=0.15)


def test_edges_are_lost_on_outlines_only_and_as_often_as_the_term_says():
    lost = measure(step_scene(), only(edge_dropout=0.3)) == 0
    outline = np.zeros(lost.shape, bool)
    outline[59:181, 119:201] = True
    outline[61:179, 121:199] = False
    assert not lost[~outline].any() and lost.sum() / (2 * 2 * (80 + 120)) == pytest.approx(0.3, abs=0.06)


def test_steep_surfaces_alone_shift_sideways_at_grazing_angles():
    ray = (np.arange(CAMERA.width) - CAMERA.cx) / CAMERA.fx
    tilt = math.radians(75)
    depth = np.repeat((2.5 / (1 + ray * math.tan(tilt)))[None], CAMERA.height, axis=0).astype(np.float32)
    moved = measure(depth, only(lateral_grazing_px=0.5))[5:-5, 150:] != depth[5:-5, 150:]
    theta = tilt - np.arctan(ray[150:])
    assert moved[:, theta > math.radians(62)].mean() > 0.2 and not moved[:, theta < math.radians(56)].any()


def test_a_kinect_v1_has_the_steps_and_the_rare_dropouts_of_real_ones():
    """UTD-MHAD: steps of z^2 / 345 m, 6 lost pixels of 100,000 on a surface."""
    config = dataclasses.replace(SENSORS["kinect_v1"], gain=0.0, ellipses_per_megapixel=0.0)
    images = np.stack([measure(wall(2.5), config, seed) for seed in range(10)])
    assert 0 < (images == 0).mean() < 4e-4
    steps = 345.3 / images[images > 0]
    assert np.abs(steps - np.round(steps)).max() < 0.01
    drawn = dataclasses.replace(config, gain=None, disparity_step_px=0.0)
    gains = [np.median(measure(wall(2.5), drawn, seed)) / 2.5 - 1 for seed in range(40)]
    assert np.std(gains) == pytest.approx(0.003, rel=0.3)
