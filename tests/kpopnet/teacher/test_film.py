"""The film of a try."""

import cv2
import numpy as np
import pytest

from kpopnet.dance.performance import Performance
from kpopnet.errors import InputError
from kpopnet.skeleton import Joint
from kpopnet.teacher.film import COLOURS, FPS, MOST_S, PANEL_PX, Movement, drawn, skinned, write_film
from kpopnet.teacher.posing import posed

RESULT = {"from_s": 1.0, "to_s": 3.0, "speed": 1.0, "course": {"time_s": [1.0, 2.0, 3.0], "total": [95.0, None, 5.0]}}


def images(path) -> list[np.ndarray]:
    """(H, W, 3) BGR images of a video."""
    video, found = cv2.VideoCapture(str(path)), []
    while (read := video.read())[0]:
        found.append(read[1])
    return found


def seen(half: np.ndarray) -> np.ndarray:
    """The (K, 3) pixels that are brighter than the ground, above the floor."""
    return half[60:380][half[60:380].max(axis=2) > 50]


def test_teacher_and_learner_stand_side_by_side_and_the_learner_is_as_bright_as_right(library, tmp_path):
    dance, path = library.dance("dance_001"), tmp_path / "film.mp4"
    write_film(path, library.body(), dance, dance.performance, RESULT)
    found = images(path)
    assert len(found) == pytest.approx(2 * FPS, abs=1) and found[0].shape == (PANEL_PX[1], 2 * PANEL_PX[0], 3)
    first, last = ([seen(half) for half in np.split(found[k], 2, axis=1)] for k in (0, -1))
    assert len(first[0]) == pytest.approx(len(first[1]), rel=0.25) and len(first[0]) > 5000
    assert first[1].mean() > 1.5 * last[1].mean() and first[0].mean() < 1.3 * last[0].mean()


def test_a_skinned_body_has_its_joints_where_the_dancer_has(library):
    """The hands of the drawn body, with the body's own proportions, are on the side and at the height of the dancer's."""
    body, dance = library.body(), library.dance("dance_001")
    quats, hips_m = posed(dance.joints_m[:90], body)
    hand = int(np.argmin(np.linalg.norm(body.vertices_m - body.joints_m[Joint.LEFT_HAND], axis=1)))
    torso = int(np.argmin(np.linalg.norm(body.vertices_m - body.joints_m[Joint.TORSO], axis=1)))
    above_m, wanted_m = [], []
    for frame in range(0, 90, 5):
        vertices_m = skinned(body, quats[frame], hips_m[frame])
        above_m.append(vertices_m[hand, 2] - vertices_m[torso, 2])
        wanted_m.append(dance.joints_m[frame, Joint.TORSO, 1] - dance.joints_m[frame, Joint.LEFT_HAND, 1])
    assert np.ptp(wanted_m) > 0.3 and np.abs(np.subtract(above_m, wanted_m)).max() < 0.15


def test_a_body_that_walks_away_stays_in_the_picture(library):
    body, dance = library.body(), library.dance("dance_001")
    far = Movement(dance.quats[:1], np.array([[4.0, 0.0, dance.hips_m[0, 2]]], np.float32), 0.0, 30.0)
    assert len(seen(drawn(body, far, 0.0, COLOURS["teacher"]))) > 5000


def test_a_film_that_is_cancelled_leaves_nothing(library, tmp_path):
    dance, told = library.dance("dance_001"), []

    def tell(fraction: float) -> None:
        told.append(fraction)
        if fraction > 0.3:
            raise KeyError("cancelled")

    with pytest.raises(KeyError, match="cancelled"):
        write_film(tmp_path / "film.mp4", library.body(), dance, dance.performance, RESULT, tell)
    assert told[0] == 0 and len(told) == pytest.approx(0.3 * 2 * FPS, abs=2) and not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ({"course": {}}, "damaged"),
        ({"course": None}, "damaged"),
        ({"speed": 1e-9}, "damaged"),
        ({"from_s": 5.0}, "damaged"),
        ({"from_s": float("nan")}, "damaged"),
        ({"to_s": "x"}, "damaged"),
        ({"course": {"time_s": [1.0], "total": []}}, "damaged"),
    ],
)
def test_a_damaged_try_is_told(library, tmp_path, wrong, told):
    dance = library.dance("dance_001")
    with pytest.raises(InputError, match=told):
        write_film(tmp_path / "film.mp4", library.body(), dance, dance.performance, RESULT | wrong)
    assert not list(tmp_path.iterdir())


def test_a_film_is_not_endless(library, tmp_path):
    from dataclasses import replace

    dance = library.dance("dance_001")
    long = replace(dance, about=replace(dance.about, seconds=900.0))
    learner = Performance(dance.joints_m, dance.performance.times_s)
    with pytest.raises(InputError, match=f"up to {MOST_S:g} s"):
        write_film(tmp_path / "film.mp4", library.body(), long, learner, RESULT | {"from_s": 0.0, "to_s": 0.0})
