"""The causes of missed joints, on poses whose errors are known."""

from dataclasses import replace

import numpy as np
import pytest
from pose_results import pose_results

from kpopnet.evaluation.poses.causes import missed_by_cause
from kpopnet.evaluation.poses.metrics import PoseResults
from kpopnet.skeleton import NUM_JOINTS, Joint

FRAMES = 40
HAND = Joint.LEFT_HAND


@pytest.fixture
def film() -> PoseResults:
    """A person who stands 3 m away and sways; every joint is found."""
    rng = np.random.default_rng(0)
    truth_m = rng.uniform(-0.8, 0.8, (NUM_JOINTS, 3)) + np.array([0, 0, 3.0])
    truth_m = truth_m + 0.02 * np.sin(np.arange(FRAMES) / 5)[:, None, None]
    return pose_results(truth_m, truth_m.copy())


def causes(results: PoseResults) -> dict[str, float]:
    """The number of missed joints by cause, without causes of none."""
    labelled = np.isfinite(results.errors_m()).sum() + np.isinf(results.errors_m()).sum()
    return {name: round(share * labelled) for name, share in missed_by_cause(results).items() if share}


def moved(film: PoseResults, frames: slice, by_m: tuple[float, float, float]) -> PoseResults:
    estimate_m = film.estimate_m.copy()
    estimate_m[frames, HAND] += by_m
    return replace(film, estimate_m=estimate_m)


ALL = slice(None)


def test_each_cause_is_told(film):
    assert causes(film) == {} and set(missed_by_cause(film)) >= {"hidden", "elsewhere"}
    assert missed_by_cause(film)["hidden"] is None, "where nothing is told to be hidden"
    assert causes(moved(film, ALL, (0.3, 0, 0))) == {"elsewhere": FRAMES}
    assert causes(moved(film, slice(10, 15), (0.3, 0, 0))) == {"momentary": 5}
    assert causes(moved(film, slice(10, 30), (0.3, 0, 0))) == {"elsewhere": 20}
    assert causes(moved(film, slice(0, 5), (0.3, 0, 0))) == {"elsewhere": 5}, "nothing before it was found"
    away = film.truth_m[0, HAND] / np.linalg.norm(film.truth_m[0, HAND])
    assert causes(moved(film, ALL, tuple(0.3 * away))) == {"wrong depth": FRAMES}
    other = film.estimate_m.copy()
    other[:, HAND] = film.truth_m[:, Joint.RIGHT_HAND]
    assert causes(replace(film, estimate_m=other)) == {"other side": FRAMES}
    lost = film.estimate_m.copy()
    lost[:, HAND] = np.nan
    assert causes(replace(film, estimate_m=lost)) == {"absent": FRAMES}
    visible = film.visible.copy()
    visible[:, HAND] = False  # whatever else it is
    assert causes(moved(replace(film, visible=visible), slice(10, 15), (0.3, 0, 0))) == {"hidden": 5}


def test_stills_and_other_sequences_have_no_moments(film):
    places_m = np.random.default_rng(1).uniform(-1, 1, (FRAMES, 1, 3))
    stills = replace(film, truth_m=film.truth_m + places_m, estimate_m=film.estimate_m + places_m)
    half = replace(film, sequence=np.where(np.arange(FRAMES) < 15, "a", "b"))
    for one in (stills, half):
        assert causes(moved(one, slice(10, 15), (0.3, 0, 0))) == {"elsewhere": 5}
