"""The tool that fits whether a crop shows a person, on scenes of its own: through its main function."""

import re
import shutil
import sys

import numpy as np
import pytest
from programs import tool

from kpopnet.camera import Camera
from kpopnet.human import Human
from kpopnet.networks import META, PERSON, WEIGHTS
from kpopnet.networks.estimator import NetworkEstimator
from kpopnet.runtime.input_files import read_json
from kpopnet.weights import FOLDER

fit_person = tool("fit_person")


def test_the_head_of_a_few_scenes_keeps_people_and_a_second_run_draws_none(tmp_path, monkeypatch, capsys):
    for name in (META, WEIGHTS):
        shutil.copy(FOLDER / name, tmp_path / name)
    monkeypatch.setattr(fit_person.PersonCropsSet, "per_shard", 12)
    monkeypatch.setattr(fit_person.os, "cpu_count", lambda: 1)
    given = [str(tmp_path), "--out", str(tmp_path / "looks"), "--files", "2", "--judged", "2"]
    monkeypatch.setattr(sys, "argv", ["fit_person.py", *given, "--figures", str(tmp_path / "figures.json")])
    fit_person.main()
    printed, figures = capsys.readouterr().out, read_json(tmp_path / "figures.json")
    people, things = map(int, re.search(r"fitted on (\d+) people and (\d+) things", printed).groups())
    assert people > 10 and people > things and figures["at"]["0.3"]["finder"]["recall"] > 0.8
    blob_m = np.zeros((1, 60, 80), np.float32)
    blob_m[0, 10:50, 30:40] = 2.0
    assert NetworkEstimator(tmp_path).judge([(blob_m[0], Camera.centred(70.0, 80, 60))])[1] is not None
    weights = (tmp_path / PERSON).read_bytes()
    monkeypatch.setattr(fit_person.Looks, "make", None)
    fit_person.main()
    assert (tmp_path / PERSON).read_bytes() == weights


def test_a_head_tells_what_it_was_fitted_on_apart():
    rng = np.random.default_rng(3)
    is_person = rng.random(600) < 0.8
    features = rng.normal(size=(600, 2 * 8 + 15)).astype(np.float32) + is_person[:, None]
    found = fit_person.Found(features, np.full(600, 0.5), is_person)
    half = fit_person.Found(*(one[:300] for one in found))
    head = fit_person.fitted(half.features, half.is_person, 8)
    judged = fit_person.evidence(head, found)[300:, 1] > 0
    assert (judged == is_person[300:]).mean() > 0.95


def test_a_second_one_on_the_same_body_is_no_person_and_one_that_is_off_is_neither():
    torsos_m = np.array([[0, 0, 2], [1, 0, 3]], np.float32)

    def kinds(*places, torsos_m=torsos_m):
        humans = [Human(k, (0, 0, 1, 1), np.zeros((1, 1)), np.array(place, np.float32)) for k, place in enumerate(places)]
        return fit_person.kinds_of(humans, torsos_m)

    right, second, above, beside, far = (0.1, 0, 2), (0.2, 0.1, 2), (0, 0.5, 2), (1.4, 0, 3), (3, 0, 3)
    assert kinds(second, right, above, beside, far) == [0, 1, 0, -1, 0]
    assert [kinds(one) for one in (right, second, above, beside, far)] == [[1], [1], [-1], [-1], [0]]
    assert kinds() == [] and kinds(right, torsos_m=np.zeros((0, 3), np.float32)) == [0]


def test_looks_of_others_are_refused(tmp_path):
    for folder in ("one", "other"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / WEIGHTS).write_bytes(folder.encode())
    fit_person.Looks(tmp_path / "one", tmp_path / "looks", "train", 0).claim()
    (tmp_path / "looks" / "train" / "looks_00000.npz").touch()
    for checkpoint, seed in (("one", 5), ("other", 0)):
        with pytest.raises(fit_person.InputError, match="holds files made with"):
            fit_person.Looks(tmp_path / checkpoint, tmp_path / "looks", "train", seed).claim()
