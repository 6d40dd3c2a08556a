"""The one person of a recording, found in each way."""

import numpy as np
import pytest
from extraction_scenes import CAMERA, compose, iou, noisy, room, shifted, standing

from kpopnet.errors import InputError
from kpopnet.pose.estimator import PoseEstimator
from kpopnet.pose.extraction import EXTRACTIONS, extract_person

EMPTY_ROOM = room((4, 40, 34, 100, 3.4), (110, 50, 140, 98, 3.5))


@pytest.fixture(params=EXTRACTIONS)
def settings(request):
    return EXTRACTIONS[request.param][0]()


def test_the_person_of_a_recording_is_extracted_from_all_images(settings):
    people = [shifted(standing(arms_deg=-60.0 + 10 * (t % 4)), round(20 * np.sin(0.15 * t))) for t in range(24)]
    frames = np.array([noisy(compose(EMPTY_ROOM, person), t) for t, person in enumerate(people)])
    extracted = extract_person(frames, CAMERA, settings)
    assert extracted.shape == (24, 120, 160) and extracted.dtype == np.float32
    assert min(iou(a > 0, person > 0) for a, person in zip(extracted[2:], people[2:], strict=True)) > 0.85
    assert np.array_equal(extracted[extracted > 0], frames[extracted > 0])


def test_of_two_people_the_one_present_longer_is_extracted(settings):
    columns = [*[200] * 15, *range(75, 45, -2), *[45] * 5, *range(45, 80, 2), *[200] * 5]
    stays = [shifted(standing(2.6), round(-40 + 8 * np.sin(0.3 * t))) for t in range(len(columns))]
    frames = [compose(room(), a, shifted(standing(3.2), column)) for a, column in zip(stays, columns, strict=True)]
    extracted = extract_person(np.array(frames), CAMERA, settings)
    assert min(iou(a > 0, person > 0) for a, person in zip(extracted[2:], stays[2:], strict=True)) > 0.9


def test_without_a_person_all_is_zero(settings):
    frames = np.array([noisy(EMPTY_ROOM, seed) for seed in range(10)])
    assert not extract_person(frames, CAMERA, settings).any()
    assert extract_person(frames[:0], CAMERA, settings).shape == (0, 120, 160)
    with pytest.raises(InputError, match="add a leading axis"):
        extract_person(frames[0], CAMERA, settings)


def test_poses_are_those_of_the_people_whom_the_extraction_finds():
    """Of a person who has not moved yet: Algorithm 1 finds no person."""
    depth_m = compose(EMPTY_ROOM, standing())[None].repeat(3, axis=0)
    found = {
        name: PoseEstimator(None, "tracker", extraction=schema()).estimate(depth_m, CAMERA)
        for name, (schema, _) in EXTRACTIONS.items()
    }
    assert len(found["finder"]) == 1 and not found["paper"]
