"""The running estimate of a person's lengths: it heals a wrong start, and leaves known lengths alone."""

from dataclasses import asdict

import numpy as np
import pytest
from cone_people import cone_body, cone_joints, draw_cones

from kpopnet.camera import CAMERAS
from kpopnet.geometry.depth_grid import build_depth_grid
from kpopnet.geometry.human_model import HumanModel
from kpopnet.tracker.fit.solver import fit
from kpopnet.tracker.lengths import REMEMBERED, SEGMENTS, SIZE_DEVIATION, RunningLengths
from kpopnet.tracker.start.upright import scaled

CAMERA = CAMERAS["kinect_v1"]
TRUTH = [cone_joints(elevation, 6) for elevation in np.linspace(20, 50, 10)]
MODEL = HumanModel.from_joints(TRUTH[0])
GRIDS = [build_depth_grid(draw_cones(joints, cone_body(joints), CAMERA), CAMERA) for joints in TRUTH]


def tracked(person: RunningLengths, rounds: int = 4) -> RunningLengths:
    joints_m = fit(TRUTH[0], GRIDS[0], person.body, 6)
    person.begin(joints_m, GRIDS[0], 2)
    for frame in np.resize(np.r_[: len(GRIDS), : len(GRIDS)][::-1], rounds * len(GRIDS)):
        joints_m = fit(TRUTH[frame], GRIDS[frame], person.body, 6)
        person.update(joints_m, GRIDS[frame], 2)
    return person


def size(model: HumanModel) -> float:
    return sum(asdict(model)[name] for segment in SEGMENTS for name in segment.fields)


@pytest.mark.parametrize("wrong", [0.88, 1.12])
def test_a_wrong_size_heals(wrong: float) -> None:
    found = tracked(RunningLengths(scaled(MODEL, wrong), SIZE_DEVIATION)).model
    assert abs(size(found) / size(MODEL) - 1) < 0.5 * abs(wrong - 1)


def test_the_right_size_stays() -> None:
    found = tracked(RunningLengths(MODEL, SIZE_DEVIATION)).model
    assert size(found) == pytest.approx(size(MODEL), rel=0.04)
    assert found.left_upper_arm_m == pytest.approx(MODEL.left_upper_arm_m, rel=0.08)


def test_known_lengths_are_kept_and_only_the_thickness_is_estimated() -> None:
    person = RunningLengths(MODEL, None)
    thick = cone_body(TRUTH[0])._replace(radii_m=1.2 * cone_body(TRUTH[0]).radii_m)
    grid = build_depth_grid(draw_cones(TRUTH[0], thick, CAMERA), CAMERA)
    before = person.body.radii_m.mean()
    person.begin(TRUTH[0], grid, 2)
    assert person.model == MODEL and person.body.radii_m.mean() > 1.1 * before


def test_memory_is_bounded() -> None:
    person = tracked(RunningLengths(MODEL, SIZE_DEVIATION), rounds=20)
    assert len(person._measured) == REMEMBERED


def test_without_points_nothing_is_learned() -> None:
    person = RunningLengths(MODEL, SIZE_DEVIATION)
    person.begin(TRUTH[0] + np.array((0, 0, 2.0)), GRIDS[0], 2)
    assert size(person.model) == pytest.approx(size(MODEL), rel=0.02)
