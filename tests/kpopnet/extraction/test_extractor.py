import numpy as np
import pytest
from extraction_scenes import CAMERA, compose, iou, noisy, room, shifted, standing

from kpopnet.errors import InputError
from kpopnet.extraction import HumanExtractionConfig, HumanExtractor
from kpopnet.human import Human

EMPTY_ROOM = room((4, 40, 34, 100, 3.4), (110, 50, 140, 98, 3.5))


def extract_all(frames, camera=CAMERA, expect_person=False) -> list[list[Human]]:
    extractor = HumanExtractor(camera, expect_person=expect_person)
    return [extractor.extract(frame) for frame in frames]


def walk(*stations: int, speed: int = 2) -> list[int]:
    """Columns from station to station."""
    path = [stations[0]]
    for station in stations[1:]:
        path += range(path[-1], station, speed if station > path[-1] else -speed)
        path.append(station)
    return path


def masks(humans, camera=CAMERA):
    return {human.identity: human.whole(camera) > 0 for human in humans}


# Motion ------------------------------


def test_no_person_is_found_in_a_noisy_empty_room():
    frames = [noisy(EMPTY_ROOM, seed) for seed in range(60)]
    assert not any(extract_all(frames))
    assert not any(extract_all(frames[:10], expect_person=True))


def test_a_standing_person_is_found_when_they_move_and_kept_when_they_stop():
    columns = [-20] * 25 + walk(-20, 10) + [10] * 150
    people = [shifted(standing(), column) for column in columns]
    found = extract_all([noisy(compose(EMPTY_ROOM, person), seed) for seed, person in enumerate(people)])
    first = next(index for index, humans in enumerate(found) if humans)
    assert 25 < first <= 30
    for humans, person in zip(found[first:], people[first:], strict=True):
        assert [human.identity for human in humans] == [0]
        assert iou(humans[0].whole(CAMERA) > 0, person > 0) > 0.85
    assert np.mean([iou(h[0].whole(CAMERA) > 0, p > 0) for h, p in zip(found[first:], people[first:], strict=True)]) > 0.9


def test_equal_images_give_equal_people_and_are_not_changed():
    frames = [noisy(compose(EMPTY_ROOM, shifted(standing(), column)), column + 99) for column in walk(-30, 30)]
    copies = [frame.copy() for frame in frames]
    once, again = extract_all(frames), extract_all(frames)
    assert all(np.array_equal(frame, copy) for frame, copy in zip(frames, copies, strict=True))
    extractor = HumanExtractor(CAMERA)
    for humans, same, frame in zip(once, again, copies, strict=True):
        buffer = frame.copy()
        from_buffer = extractor.extract(buffer)
        buffer[:] = 1.0  # the camera writes its next image to the same memory
        for others in (same, from_buffer):
            assert [human.identity for human in humans] == [human.identity for human in others]
            for human, other in zip(humans, others, strict=True):
                assert human.box == other.box and np.array_equal(human.depth_m, other.depth_m)
    assert once[-1]


def test_mirrored_images_give_mirrored_people():
    frames = [noisy(compose(EMPTY_ROOM, shifted(standing(), column)), column + 99) for column in walk(-30, 30)]
    mirrored = extract_all([frame[:, ::-1] for frame in frames], camera=CAMERA.mirrored())
    agree = [
        iou(humans[0].whole(CAMERA)[:, ::-1] > 0, others[0].whole(CAMERA) > 0)
        for humans, others in zip(extract_all(frames), mirrored, strict=True)
        if humans and others
    ]
    assert len(agree) > 25 and np.mean(agree) > 0.98


# Output ------------------------------


def test_a_human_is_their_depth_in_a_box_with_a_margin_of_two_pixels():
    frames = [compose(EMPTY_ROOM, shifted(standing(), column)) for column in walk(-30, -10)]
    (human,) = extract_all(frames)[-1]
    person = shifted(standing(), -10)
    x0, y0, x1, y1 = human.box
    assert human.depth_m.shape == (y1 - y0, x1 - x0) and human.depth_m.dtype == np.float32
    for border in (human.depth_m[:2], human.depth_m[-2:], human.depth_m[:, :2], human.depth_m[:, -2:]):
        assert not border.any()
    assert human.depth_m[2].any() and human.depth_m[:, 2].any()
    whole = human.whole(CAMERA)
    assert np.array_equal(whole[y0:y1, x0:x1], human.depth_m) and (whole > 0).sum() == (human.depth_m > 0).sum()
    assert np.array_equal(whole[whole > 0], person[whole > 0])
    assert human.centre_m == pytest.approx(CAMERA.points(whole)[whole > 0].mean(axis=0), abs=1e-4)
    assert np.allclose(human.cropped(CAMERA).points(human.depth_m), CAMERA.points(whole)[y0:y1, x0:x1], atol=1e-5)


def test_at_most_the_thickness_of_the_floor_is_cut_from_the_feet():
    people = [shifted(standing(), column) for column in walk(-30, 10)]
    found = extract_all([compose(room(), person) for person in people])
    rows = [np.flatnonzero(image.any(axis=1))[-1] for image in (people[-1], found[-1][0].whole(CAMERA))]
    assert rows[0] - rows[1] <= 1  # a pixel is 2 cm here


# Identities ------------------------------


def test_a_person_who_leaves_and_returns_keeps_their_identity():
    columns = walk(-20, 110) + [200] * 70 + walk(110, 0)
    found = extract_all([noisy(compose(EMPTY_ROOM, shifted(standing(), column)), seed) for seed, column in enumerate(columns)])
    away = [index for index, column in enumerate(columns) if column == 200]
    assert not any(found[away[2] : away[-1]])
    assert {human.identity for humans in found for human in humans} == {0}
    assert found[-1] and iou(found[-1][0].whole(CAMERA) > 0, standing() > 0) > 0.85


@pytest.mark.parametrize(("near_m", "far_m"), [(2.4, 3.2), (2.7, 3.2)])
def test_two_people_who_cross_at_different_depths_keep_their_identities(near_m, far_m):
    there = walk(-50, 50)
    near = [shifted(standing(near_m), column) for column in there]
    far = [shifted(standing(far_m, arms_deg=-30.0), -column) for column in there]
    found = extract_all([noisy(compose(room(), a, b), seed) for seed, (a, b) in enumerate(zip(near, far, strict=True))])
    start, end = masks(found[12]), masks(found[-1])
    assert len(start) == len(end) == 2
    by_truth = {
        k: max(start, key=lambda identity: (start[identity] & (truth[12] > 0)).sum()) for k, truth in ((0, near), (1, far))
    }
    assert by_truth[0] != by_truth[1]
    assert iou(end[by_truth[0]], near[-1] > 0) > 0.85
    assert iou(end[by_truth[1]], far[-1] > 0) > 0.85
    assert {human.identity for humans in found for human in humans} == set(start)


def test_two_people_who_hold_hands_stay_two():
    columns = [50] * 3 + walk(50, 22, speed=1) + [22] * 20 + walk(22, 45)
    left = [shifted(standing(arms_deg=0.0), -column) for column in columns]
    right = [shifted(standing(arms_deg=0.0), column) for column in columns]
    found = extract_all([compose(room(), a, b) for a, b in zip(left, right, strict=True)])
    touching = next(i for i, (a, b) in enumerate(zip(left, right, strict=True)) if ((a > 0) & (b > 0)).any())
    assert len(found[touching - 2]) == 2
    for humans, a, b in zip(found[touching:], left[touching:], right[touching:], strict=True):
        found_masks = masks(humans)
        assert len(found_masks) == 2
        pair = [max(iou(mask, truth > 0) for mask in found_masks.values()) for truth in (a, b)]
        assert min(pair) > 0.7
    assert (
        iou(masks(found[-1])[found[-1][0].identity], left[-1] > 0) > 0.9
        or iou(masks(found[-1])[found[-1][0].identity], right[-1] > 0) > 0.9
    )


def test_furniture_that_a_person_touches_is_not_part_of_them():
    x0, y0, x1, y1, _ = box = (110, 45, 140, 106, 2.85)
    columns = walk(-35, 25) + [25] * 40 + walk(25, -30)
    people = [shifted(standing(2.8), column) for column in columns]
    assert (people[55] > 0)[y0:y1, x0:x1].sum() > 100  # an arm in front of the cupboard, at most 10 cm away
    found = extract_all([noisy(compose(room(box), person), seed) for seed, person in enumerate(people)])
    cupboard = np.zeros(EMPTY_ROOM.shape, bool)
    cupboard[y0:y1, x0:x1] = True
    for humans, person in zip(found[12:], people[12:], strict=True):
        mask = humans[0].whole(CAMERA) > 0
        assert (mask & cupboard & ~(person > 0)).sum() < 30
        assert iou(mask, person > 0) > 0.7


# Expecting a person ------------------------------


def test_an_expected_person_is_found_in_the_first_image():
    (human,) = extract_all([noisy(compose(EMPTY_ROOM, standing()), 0)], expect_person=True)[0]
    assert iou(human.whole(CAMERA) > 0, standing() > 0) > 0.9
    assert not extract_all([noisy(compose(EMPTY_ROOM, standing()), 0)])[0]


def test_a_person_who_moves_replaces_an_expected_one_who_did_not():
    lamp = shifted(standing(2.9), -45)
    empty = compose(room(), lamp)
    columns = [200] * 10 + walk(110, 20)
    found = extract_all([compose(empty, shifted(standing(), column)) for column in columns], expect_person=True)
    assert iou(found[5][0].whole(CAMERA) > 0, lamp > 0) > 0.9
    assert [human.identity for human in found[-1]] == [1]
    assert iou(found[-1][0].whole(CAMERA) > 0, shifted(standing(), 20) > 0) > 0.9


# Bad input ------------------------------


def dance(seed: int = 0, count: int = 40) -> tuple[list[np.ndarray], list[np.ndarray]]:
    columns = [round(20 * np.sin(0.15 * t)) for t in range(count)]
    people = [shifted(standing(arms_deg=-60.0 + 10 * (t % 4)), column) for t, column in enumerate(columns)]
    return [noisy(compose(EMPTY_ROOM, person), seed + t) for t, person in enumerate(people)], people


def ious(found, people):
    pairs = zip(found, people, strict=True)
    return [iou(humans[0].whole(CAMERA) > 0, person > 0) if humans else 0.0 for humans, person in pairs]


def random_image(seed: int) -> np.ndarray:
    return (np.random.default_rng(seed).integers(0, 65536, EMPTY_ROOM.shape) / 1000).astype(np.float32)


@pytest.mark.parametrize("corrupt", [random_image, lambda seed: np.zeros(EMPTY_ROOM.shape, np.float32)])
def test_corrupt_images_are_skipped(corrupt):
    frames, people = dance()
    for t in (0, 1, 20, 21, 22, 30):
        frames[t] = corrupt(t)
    found = extract_all(frames, expect_person=True)
    for t, score in enumerate(ious(found, people)):
        assert found[t] == [] if t in (0, 1, 20, 21, 22, 30) else score > 0.85
    assert {human.identity for humans in found for human in humans} == {0}


def test_a_person_is_found_without_a_floor_in_view():
    columns = walk(-20, 30)
    wall = np.full((120, 160), 4, np.float32)
    bust = [shifted(standing(), column) for column in columns]
    for person in bust:
        person[75:] = 0
    extractor = HumanExtractor(CAMERA)
    found = [extractor.extract(noisy(compose(wall, person), seed)) for seed, person in enumerate(bust)]
    assert extractor.floor is None
    assert np.mean(ious(found[5:], bust[5:])) > 0.85


@pytest.mark.parametrize(
    ("depth", "message"),
    [
        (np.zeros((120, 161), np.float32), "161x120"),
        (np.zeros((2, 120, 160), np.float32), "one image per call"),
        (np.zeros((120, 160), np.int8), "int8"),
        ([[1.0]], "numpy array"),
    ],
)
def test_input_that_is_no_depth_image_is_refused(depth, message):
    with pytest.raises(InputError, match=message):
        HumanExtractor(CAMERA).extract(depth)


@pytest.mark.parametrize(
    "name", ["delta_f_m", "epsilon_z_m", "epsilon_z_per_m2", "epsilon_d_m", "epsilon_d_per_m2", "epsilon_m_m2"]
)
@pytest.mark.parametrize("value", [-0.1, float("nan"), float("inf")])
def test_invalid_thresholds_are_refused_with_their_setting(name, value):
    with pytest.raises(InputError, match=f"extraction.{name}"):
        HumanExtractionConfig(**{name: value})
