"""The study of Algorithm 2: a film of a person of cones, measured once and not again."""

import json
import sys

import numpy as np
import pytest
from cone_people import cone_joints, filmed
from programs import ROOT

sys.path.insert(0, str(ROOT / "tools"))

import paper_claims as study


@pytest.fixture
def films(tmp_path, monkeypatch):
    """One film of 17 images, a quarter of a second, of a person in the Y pose who hardly moves, at the finest pace."""
    monkeypatch.setattr(study, "IMAGES", (0, 16))
    monkeypatch.setattr(study, "REPEATS", 12)
    monkeypatch.setattr(study, "SHOWN", (1, 12))
    joints_m = np.stack([cone_joints(40 - 0.1 * t, place_m=(0.0, 0.1, 2.8)) for t in range(17)])
    person = np.rint(1e4 * filmed(joints_m, study.CAMERA)).astype(np.uint16)
    np.savez(tmp_path / "0.npz", person=person, joints_m=joints_m, room_m=np.zeros(person.shape[1:], np.float32), kind="y_pose")
    return [tmp_path / "0.npz"]


def test_a_step_from_the_truth_is_right_and_rows_are_measured_once(films, tmp_path, monkeypatch, capsys) -> None:
    rows = study.Rows(tmp_path / "results" / "steps.json")
    study.steps(films, rows)
    found = json.loads(rows.path.read_text())
    assert found["simulated"] and found["split"] == "train" and found["commit"]["revision"] and "steps" in found["command"]
    for row in (by_film["0"] for by_film in found["rows"].values()):
        assert row["true last poses"]["all"] > 95 and row["ridge within r_j"]["head"] == 100
        assert all(one["with_velocity"] >= 0 for one in row["response"])
    assert len(found["rows"]) == 4
    capsys.readouterr()
    study.steps(films, study.Rows(rows.path))
    assert not capsys.readouterr().out, "a second run finds every row"


def test_the_surface_is_before_the_centre_and_a_still_person_is_measured_on_it(films, tmp_path) -> None:
    film = study.seen(films[0], study.View(ideal=True, true_mask=True))
    before_m = np.linalg.norm(film.joints_m, axis=-1) - np.linalg.norm(study.surface_joints(film), axis=-1)
    assert (before_m > -1e-9).all() and 0.05 < before_m[0, 0] < 0.2
    assert len(film.depth_m) == 3 and len(study.seen(films[0], study.View(8, ideal=True, true_mask=True)).depth_m) == 17
    rows = study.Rows(tmp_path / "still.json")
    study.still(films, rows)
    repaired = rows.rows["repaired"]["0"]
    assert repaired["1"] == repaired["12"] == 100
