import h5py
import numpy as np
import pytest
from dance_people import FPS, dance_joints_m, noisy, performed

from kpopnet.benchmarks.kpop_format import FORMAT, LABELS, TEACHER, VERSION
from kpopnet.dance import calibration
from kpopnet.dance.calibration import OTHER, STILL, Candidate, best_of, candidates, greatest_alpha, main
from kpopnet.dance.scoring import SCORERS, ScorerConfig, timing_similarity
from kpopnet.errors import InputError
from kpopnet.skeleton import JOINT_NAMES

FAULTS = ((0.0, 0.01), (0.1, 0.03), (0.2, 0.06))
"""Delay in seconds and noise in metres of the learners, the best first."""

BETAS = (0.6, 1.0, 2.4)


def learner_m(index, noise_m):
    return noisy(dance_joints_m(index, 6.0), noise_m, index)


@pytest.fixture(scope="module")
def found():
    dances = [
        (performed(dance_joints_m(i, 6.0)), [performed(learner_m(i, noise_m), delay_s) for delay_s, noise_m in FAULTS])
        for i in range(3)
    ]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(calibration, "BETAS", BETAS)
        return candidates(dances, SCORERS["dance22"])


def test_the_chosen_tells_learners_apart_best_among_those_allowed(found):
    best = best_of(found)
    assert best.still < STILL and best.other < OTHER
    assert all(one.separation <= best.separation for one in found if one.allowed)
    assert best.concordance == 100
    assert len(found) == len(BETAS) * len(calibration.TAUS)


def test_order_comes_before_distance():
    ordered = Candidate(beta=0.7, tau=0.4, separation=1.0, concordance=90.0, still=10.0, other=10.0)
    apart = ordered._replace(tau=0.3, separation=2.0, concordance=80.0)
    alike = ordered._replace(beta=0.5, separation=0.9)
    refused = ordered._replace(concordance=100.0, other=OTHER)
    assert best_of([apart, alike, ordered, refused]) == ordered


def test_a_larger_beta_forgives_more(found):
    for name in ("still", "other"):
        by_beta = [getattr(one, name) for one in found if one.tau == calibration.TAUS[0]]
        assert (np.diff(by_beta) > 0).all()


def test_the_greatest_alpha_leaves_a_perfect_copy_its_score():
    for alpha, kept in ((greatest_alpha(), True), (greatest_alpha() + 0.01, False)):
        assert (timing_similarity(0.0, ScorerConfig(alpha=alpha)) >= calibration.PERFECT) == kept


def test_what_cannot_be_calibrated_is_named(found):
    with pytest.raises(InputError, match="no beta keeps standing still"):
        best_of([one._replace(still=50.0) for one in found])
    with pytest.raises(InputError, match="1 dances: calibration needs two or more"):
        candidates([(performed(dance_joints_m(0)), [])], SCORERS["dance22"])


def write_performance(path, joints_m, delay_s=0.0):
    with h5py.File(path, "w") as file:
        file.attrs.update({"format": FORMAT, "version": VERSION, "joint_names": list(JOINT_NAMES)})
        file["joints_m"] = joints_m.astype(np.float32)
        file["times_s"] = np.arange(len(joints_m)) / FPS + delay_s


def test_the_command_reads_a_folder_of_dances(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(calibration, "BETAS", (0.7, 0.9))
    monkeypatch.setattr(calibration, "TAUS", (0.5,))
    for index in range(2):
        folder = tmp_path / f"dance_{index}"
        folder.mkdir()
        write_performance(folder / TEACHER, dance_joints_m(index, 6.0))
        for name, (delay_s, noise_m) in zip("abc", FAULTS, strict=True):
            write_performance(folder / f"{name}.h5", learner_m(index, noise_m), delay_s)
        (folder / LABELS).write_text("learner,rank\nc,3\na,1\nb,2\n")
    main([str(tmp_path)])
    printed, shown = capsys.readouterr()
    assert printed.count(" 100 %") == 2
    assert "scores: 100%" in shown and "dances: 100%" in shown
    assert "alpha=0.31 beta=0." in printed and "tau=0.5" in printed
    with pytest.raises(SystemExit):
        main([str(tmp_path / "nowhere")])
    assert "no such folder" in capsys.readouterr().err
