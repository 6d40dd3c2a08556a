"""Noise in time: what stays from frame to frame of a film, what does not, and how single frames look."""

import dataclasses

import numpy as np
import pytest
from depth_sensors import CAMERA, measure, only, wall

from kpopnet.camera import CAMERAS, Camera
from synth.sensor.film_noise import HOLE_FRAMES, FilmNoise
from synth.sensor.model import SENSORS, measure_labelled

NOISE = FilmNoise((3, 5))
STEPS_M = 575.5 * 0.075 * 8
"""Kinect v1's disparity at 1 m, in quantisation steps."""


def without_holes(name):
    return dataclasses.replace(SENSORS[name], pixel_dropout=0.0, edge_dropout=0.0, ellipses_per_megapixel=0.0)


GRAIN = only(axial_floor_m=0.01, grain_px=9.0, grain_flicker=0.06, baseline_m=0.075, grain_disparity_px=0.25)


def shoot(depth, config, number, camera=CAMERA, noise=NOISE):
    """(h, w) depth of one frame of a film."""
    rng, shared = noise.frame(number)
    return measure_labelled(depth, np.ones(depth.shape, np.uint8), camera, config, rng, film=shared)[0]


def correlation(a, b):
    return np.corrcoef(a.ravel(), b.ravel())[0, 1]


def test_still_pixels_of_a_kinect_v1_change_as_in_real_recordings():
    """UTD-MHAD: a variance of 0.12 to 0.20 steps^2, 0.22 to 0.31 between neighbours, white in time, and no drift."""
    config = without_holes("kinect_v1")
    film = np.rint(np.stack([STEPS_M / shoot(wall(2.8), config, t) for t in range(40)]))
    changes = np.diff(film, axis=0)
    assert 0.12 < changes.var() < 0.20
    assert 0.2 < correlation(changes[:, :, 1:], changes[:, :, :-1]) < 0.36
    assert 0.2 < correlation(changes[:, 1:], changes[:, :-1]) < 0.36
    assert correlation(changes[1:], changes[:-1]) == pytest.approx(-0.5, abs=0.03)
    assert (film[-1] - film[0]).var() == pytest.approx(changes.var(), rel=0.05)
    # Pictures of their own would differ several times as much.
    pictures = [np.rint(STEPS_M / measure(wall(2.8), config, t)) for t in range(2)]
    assert np.diff(pictures, axis=0).var() > 3 * changes.var()


def test_white_disparity_noise_keeps_its_variance_and_draws_only_its_share_anew():
    config = only(baseline_m=0.075, disparity_noise_px=0.02, disparity_flicker=0.25, grain_disparity_px=0.25)
    near = 1 / shoot(wall(1.0), config, 0)
    assert near.std() == pytest.approx(0.02 / (575.5 * 0.075), rel=0.03)
    frames = np.stack([1 / shoot(wall(2.8), config, t) for t in range(12)])
    assert frames.std() == pytest.approx(0.02 / (575.5 * 0.075), rel=0.01)
    assert frames.var(axis=0).mean() / frames.var() == pytest.approx(0.25 * 11 / 12, rel=0.03)
    assert abs(correlation(frames[0][:, 1:], frames[0][:, :-1])) < 0.02


@pytest.mark.parametrize("config", [GRAIN, only(baseline_m=0.075, disparity_noise_px=0.02, grain_disparity_px=0.25)])
def test_a_crop_has_the_noise_of_the_whole_image(config):
    crop = CAMERA.cropped(37, 51, 100, 80)
    whole, part = shoot(wall(2.8), config, 2), shoot(wall(2.8, crop), config, 2, crop)
    assert part == pytest.approx(whole[51:131, 37:137], abs=1e-5)


def test_frames_do_not_depend_on_order_or_process():
    forwards = [shoot(wall(2.8), SENSORS["kinect_v1"], t) for t in range(4)]
    for t in (2, 0, 3, 1):
        assert np.array_equal(shoot(wall(2.8), SENSORS["kinect_v1"], t, noise=FilmNoise((3, 5))), forwards[t])
    other = shoot(wall(2.8), GRAIN, 0, noise=FilmNoise((3, 6)))
    assert abs(correlation(other, shoot(wall(2.8), GRAIN, 0))) < 0.1


@pytest.mark.parametrize(("steps", "lowest", "highest"), [(0.2, 0.95, 1.0), (1.0, 0.4, 0.8), (4.5, -0.1, 0.1)])
def test_the_grain_changes_where_the_surface_moves_by_a_quarter_of_a_pixel_of_disparity(steps, lowest, highest):
    config, moved = dataclasses.replace(GRAIN, grain_flicker=0.0), wall(2.8)
    moved[:, 160:] = STEPS_M / (STEPS_M / 2.8 - steps)
    before, after = shoot(wall(2.8), config, 0) - 2.8, shoot(moved, config, 1) - moved
    assert lowest < correlation(before[:, 170:], after[:, 170:]) <= highest
    assert np.array_equal(before[:, :150], after[:, :150])
    assert after[:, 170:].std() == pytest.approx(0.01, rel=0.07)


def test_noise_of_time_of_flight_is_white_in_time():
    camera, config = CAMERAS["kinect_2"], dataclasses.replace(without_holes("kinect_2"), gain=0.0)
    first, second = (shoot(wall(2.8, camera), config, t, camera) for t in range(2))
    assert abs(correlation(first, second)) < 0.15  # the radial term makes the variance uneven, not the errors alike


def test_holes_last_for_their_frames_and_are_as_many_as_in_pictures():
    config = only(ellipses_per_megapixel=60.0)
    lost = np.stack([shoot(wall(2.8), config, t) == 0 for t in range(60)])
    pictures = [(measure(wall(2.8), config, i) == 0).mean() for i in range(60)]
    assert lost.mean() == pytest.approx(np.mean(pictures), rel=0.2)
    for later, share in ((1, 1 - 1 / HOLE_FRAMES), (HOLE_FRAMES, 0.0)):
        assert (lost[later:] & lost[:-later]).sum() / lost[later:].sum() == pytest.approx(share, abs=0.1)


def test_the_end_of_a_limb_is_lost_as_often_in_a_film_as_in_pictures():
    config, camera, end = only(limb_end_dropout=0.3), Camera.centred(100.0, 80, 60), np.array([[0.0, 0.0, 2.0]])
    depth, labels = wall(2.0, camera), np.ones((60, 80), np.uint8)
    lost = []
    for number in range(600):
        rng, frame = NOISE.frame(number)
        lost.append((measure_labelled(depth, labels, camera, config, rng, end, frame)[0] == 0).any())
    assert np.mean(lost) == pytest.approx(0.3, abs=0.06)
