"""The acceptance sheet: gates, Markdown, JSON and pictures."""

import json

import cv2
import numpy as np
import pytest
from cone_people import cone_joints

from kpopnet.camera import Camera
from kpopnet.evaluation.acceptance.sheet import BOTH, LINES, MISSED, NOT_SHOWN, USERS, blocks, machine, table, verdict, write
from kpopnet.evaluation.acceptance.watched import Kept, Watched

LINE = {line.key: line for line in LINES}
FAULTLESS = {line.key: line.ours for line in LINES} | {"empty_s": 600.0}


@pytest.mark.parametrize(
    ("key", "value", "expected"),
    [
        ("images_out_s", 29.5, BOTH), ("images_out_s", 29.2, USERS), ("images_out_s", 28.9, MISSED),
        ("delay_p95_ms", 25.0, BOTH), ("delay_p95_ms", 50.0, USERS), ("delay_p95_ms", 50.1, MISSED),
        ("found_again_ms", 375.0, BOTH), ("found_again_ms", 750.0, USERS), ("found_again_ms", np.inf, MISSED),
        ("exchanges", 0, BOTH), ("exchanges", 1, MISSED),
        ("mean_error_mm", None, NOT_SHOWN), ("longest_gap_ms", 5.0, ""),
    ],
)  # fmt: skip
def test_a_figure_is_held_against_both_gates(key: str, value: float | None, expected: str) -> None:
    assert verdict(LINE[key], FAULTLESS | {key: value}) == expected


def test_nobody_in_ten_minutes_is_not_shown_by_a_few_seconds() -> None:
    few = FAULTLESS | {"empty_s": 16.3}
    assert verdict(LINE["false_people"], few) == NOT_SHOWN
    assert verdict(LINE["false_people"], few | {"false_people": 1}) == MISSED


def test_the_files_and_pictures(tmp_path) -> None:
    """A person is seen in the empty room, and then never again found."""
    joints_m, camera = cone_joints().astype(np.float32), Camera.centred(285.0, 320, 240)
    kept = {0: Kept.of(np.full((240, 320), 3, np.float32), camera)}
    flags = np.array([False, True])
    everybody = np.stack([np.full_like(joints_m, np.nan)] * 2)
    answers = np.arange(2.0), np.full(2, np.nan), np.ones(2), 2, everybody, [[joints_m], []]
    run = Watched("minute", "any", *answers, flags, ~flags, kept, everybody)
    found = {"any": FAULTLESS | {"found_again_ms": np.inf, "false_people": 1}}
    shown = blocks("minute.h5", True, found, ["How it was fed."])
    written = write(tmp_path / "out", shown, found, [run], {"machine": machine()})
    assert {path.name for path in written} == {"check.md", "check.json", "check.png"}
    stored = json.loads((tmp_path / "out" / "check.json").read_text())
    assert stored["sheet"]["any"]["found_again_ms"] == {
        "value": "never", "users_gate": 750, "our_gate": 375, "verdict": MISSED,
    }  # fmt: skip
    text = (tmp_path / "out" / "check.md").read_text()
    assert "SIMULATED" in text and "never, missed" in text and "≤ 17.5 mm" in text and "99.5 %" in text and "check.png" in text
    picture = cv2.imread(str(tmp_path / "out" / "check.png"))
    assert (picture[..., 2].astype(int) - picture[..., 0] > 100).any()  # red: the right side of who is not there
    again = write(tmp_path / "out", shown, found, [], {})  # nothing to look at
    assert again == [tmp_path / "out" / "check.md", tmp_path / "out" / "check.json"]
    assert not (tmp_path / "out" / "check.png").exists()
    assert "SIMULATED" not in str(blocks("minute.h5", False, found, []))
    assert len(table(found).rows) == len(LINES)
