"""Algorithm 1 on scenes of which every pixel's owner is known."""

import numpy as np
import pytest
from extraction_scenes import CAMERA, compose, iou, noisy, room, shifted, standing

from kpopnet.camera import Camera
from kpopnet.errors import InputError
from kpopnet.human import Human
from kpopnet.paper_extraction import PaperExtractionConfig, PaperExtractor

EMPTY_ROOM = room((4, 40, 34, 100, 3.4), (110, 50, 140, 98, 3.5))
WALK = list(range(-30, 12, 2))


def extract_all(frames, camera: Camera = CAMERA) -> list[list[Human]]:
    extractor = PaperExtractor(camera)
    return [extractor.extract(frame) for frame in frames]


def mask(human: Human) -> np.ndarray:
    return human.whole(CAMERA) > 0


def walking() -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Noisy images of a person who walks through a furnished room, and the person alone."""
    people = [shifted(standing(), column) for column in WALK]
    return [noisy(compose(EMPTY_ROOM, person), seed) for seed, person in enumerate(people)], people


def test_a_noisy_empty_room_shows_no_person():
    assert not any(extract_all(noisy(EMPTY_ROOM, seed) for seed in range(30)))


def test_a_person_is_found_when_they_move_and_kept_when_they_stop():
    columns = [-20] * 10 + list(range(-20, 10, 2)) + [10] * 30
    people = [shifted(standing(), column) for column in columns]
    found = extract_all(noisy(compose(EMPTY_ROOM, person), seed) for seed, person in enumerate(people))
    assert not any(found[:10])
    for humans, person in zip(found[12:], people[12:], strict=True):
        (human,) = humans
        assert human.identity == 0 and iou(mask(human), person > 0) > 0.95


def test_a_human_who_stands_still_keeps_their_identity_when_another_comes():
    stays = [shifted(standing(2.6), column) for column in [*range(-50, -40, 2), *[-40] * 30]]
    comes = [shifted(standing(3.2), column) for column in [*[200] * 8, *range(110, 30, -3)]]
    found = extract_all(noisy(compose(room(), *pair), seed) for seed, pair in enumerate(zip(stays, comes, strict=True)))
    for humans, person in zip(found[2:], stays[2:], strict=True):
        assert humans[0].identity == 0 and iou(mask(humans[0]), person > 0) > 0.95
    assert len(found[-1]) == 2 and iou(mask(found[-1][1]), comes[-1] > 0) > 0.95


def test_furniture_that_a_person_touched_is_not_human_when_they_have_gone():
    x0, y0, x1, y1, _ = box = (104, 25, 150, 100, 2.75)
    columns = [*range(-25, 12), *range(12, -25, -1)]
    people = [shifted(standing(arms_deg=0.0), column) for column in columns]
    found = extract_all(noisy(compose(room(box), person), seed) for seed, person in enumerate(people))
    assert mask(found[37][0])[y0:y1, x0:x1].mean() > 0.9
    (human,) = found[-1]
    assert human.identity == 0 and iou(mask(human), people[-1] > 0) > 0.95


def test_a_human_who_leaves_and_another_who_comes_are_two():
    columns = [*range(20, 120, 3), *[200] * 3, *range(-120, -20, 3)]
    found = extract_all(compose(room(), shifted(standing(), column)) for column in columns)
    away = columns.index(200)
    assert [human.identity for human in found[5]] == [0] and not any(found[away : away + 3])
    (human,) = found[-1]
    assert human.identity > max(human.identity for humans in found[:away] for human in humans)


def test_a_human_is_their_depth():
    frames, people = walking()
    human, person = extract_all(frames)[-1][0], people[-1]
    inside = mask(human)
    assert np.array_equal(human.whole(CAMERA)[inside], frames[-1][inside])
    assert human.centre_m == pytest.approx(CAMERA.points(human.whole(CAMERA))[inside].mean(axis=0), abs=1e-3)
    x0, y0, x1, y1 = human.box
    rows, columns = np.flatnonzero(inside.any(axis=1)), np.flatnonzero(inside.any(axis=0))
    assert (x0, y0, x1, y1) == (columns[0] - 2, rows[0] - 2, columns[-1] + 3, rows[-1] + 3)
    assert np.flatnonzero((person > 0).any(axis=1))[-1] - rows[-1] <= 2  # 3 cm of the feet are floor; a pixel is 2 cm


def test_settings_that_are_no_numbers_are_refused():
    for wrong, message in (("0.03", "='0.03': expected a number"), (float("nan"), "must be a finite number")):
        with pytest.raises(InputError, match=f"extraction.delta_f_m.*{message}"):
            PaperExtractionConfig(delta_f_m=wrong)


def test_an_empty_image_shows_no_person_and_leaves_the_next_its_identities():
    frames, people = walking()
    frames[12:14] = np.zeros_like(frames[0]), np.full_like(frames[0], np.nan)
    found = extract_all(frames)
    assert not found[12] and not found[13]
    assert {human.identity for humans in found for human in humans} == {0}
    assert iou(mask(found[-1][0]), people[-1] > 0) > 0.95
