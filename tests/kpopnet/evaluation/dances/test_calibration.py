import h5py
import numpy as np
import pytest
from dance_people import FPS, dance_joints_m, noisy, performed

from kpopnet.dance.scoring import OURS
from kpopnet.dance.window import timing_similarity
from kpopnet.datasets.dances.format import FORMAT, LABELS, TEACHER, VERSION
from kpopnet.errors import InputError
from kpopnet.evaluation.dances import calibration
from kpopnet.evaluation.dances.calibration import (
    MAX_OTHER_DANCE_SCORE,
    MAX_STANDING_SCORE,
    Candidate,
    candidates,
    largest_alpha,
    main,
    select_candidate,
)
from kpopnet.skeleton import JOINT_NAMES

FAULTS = ((0.0, 0.01), (0.1, 0.03), (0.2, 0.06))
"""Delay in seconds and noise in metres of the learners, the best first."""

BETAS = (0.3, 0.4, 2.4)


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
        return candidates(dances, OURS)


def test_the_selected_candidate_separates_learners_best_among_the_allowed(found):
    best = select_candidate(found)
    assert best.standing_score < MAX_STANDING_SCORE and best.other_dance_score < MAX_OTHER_DANCE_SCORE
    assert all(one.separation <= best.separation for one in found if one.allowed)
    assert best.concordance == 100
    assert len(found) == len(BETAS) * len(calibration.TAUS)


def test_concordance_comes_before_separation():
    concordant = Candidate(beta=0.7, tau=0.4, separation=1.0, concordance=90.0, standing_score=10.0, other_dance_score=10.0)
    separated = concordant._replace(tau=0.3, separation=2.0, concordance=80.0)
    close = concordant._replace(beta=0.5, separation=0.9)
    not_allowed = concordant._replace(concordance=100.0, other_dance_score=MAX_OTHER_DANCE_SCORE)
    assert select_candidate([separated, close, concordant, not_allowed]) == concordant


def test_a_larger_beta_raises_the_scores(found):
    for name in ("standing_score", "other_dance_score"):
        by_beta = [getattr(one, name) for one in found if one.tau == calibration.TAUS[0]]
        assert (np.diff(by_beta) > 0).all()


def test_a_perfect_copy_keeps_its_score_up_to_the_largest_alpha():
    for alpha, kept in ((largest_alpha(), True), (largest_alpha() + 0.01, False)):
        assert (timing_similarity(0.0, alpha, 0.4) >= calibration.MIN_COPY_SIMILARITY) == kept


def test_impossible_calibrations_are_rejected(found):
    with pytest.raises(InputError, match="no beta keeps the score of standing still"):
        select_candidate([one._replace(standing_score=50.0) for one in found])
    with pytest.raises(InputError, match="1 dances: calibration needs two or more"):
        candidates([(performed(dance_joints_m(0)), [])], OURS)


def write_performance(path, joints_m, delay_s=0.0):
    with h5py.File(path, "w") as file:
        file.attrs.update({"format": FORMAT, "version": VERSION, "joint_names": list(JOINT_NAMES)})
        file["joints_m"] = joints_m.astype(np.float32)
        file["times_s"] = np.arange(len(joints_m)) / FPS + delay_s


def test_the_program_reads_a_folder_of_dances(tmp_path, capsys, monkeypatch):
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
