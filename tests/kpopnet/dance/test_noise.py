"""An estimator's known errors are taken out of the score: perfect dancing is 100 within the uncertainty, and faults cost."""

from dataclasses import replace

import numpy as np
import pytest
from dance_learners import arm_lowered, arms_lowered, hidden, never_turning, smaller, standing
from dance_people import FPS, dance_joints_m, noisy, performed
from programs import tool

from kpopnet.dance.features import FEATURES
from kpopnet.dance.feedback import feedback
from kpopnet.dance.noise.table import CERTAIN, NOISE, SEEN, SEEN_BY, doubt, kept_by_noise
from kpopnet.dance.online import OnlineScorer
from kpopnet.dance.performance import Performance, off_by
from kpopnet.dance.scoring import OURS, DanceScore, derived_torso, score_dance
from kpopnet.errors import InputError
from kpopnet.skeleton import Joint

noise = tool("measure_noise")

JOINTS_M, NOISE_M = dance_joints_m(0), 0.03


def estimated(joints_m: np.ndarray, seed: int) -> Performance:
    """Joints whose noise is five times as large for the first half of the dance, with the lower confidence that says so."""
    half = np.arange(len(joints_m)) < len(joints_m) / 2
    size_m = np.where(half, NOISE_M, NOISE_M / 5)[:, None, None]
    confidence = np.broadcast_to(np.where(half, 0.8, 0.99)[:, None], joints_m.shape[:2])
    return Performance(joints_m + (noisy(joints_m, 1.0, seed) - joints_m) * size_m, np.arange(len(joints_m)) / FPS, confidence)


def seen(dance: int, seed: int) -> noise.Seen:
    true = performed(dance_joints_m(dance))
    return noise.Seen(str(dance), "perfect_0", true, true, estimated(true.joints_m, seed))


@pytest.fixture(scope="module")
def known():
    with pytest.MonkeyPatch.context() as patch:
        learners = [seen(dance, 7) for dance in (3, 4)]
        found = noise.measured([noise.own_errors(one) for one in learners])
        spread = noise.spread([noise.scored(one, found) for one in learners])
        patch.setitem(NOISE, "test", found._replace(spread=spread))
        yield replace(OURS, noise="test")


def scored(seed: int, learner_m: np.ndarray, scorer) -> DanceScore:
    return score_dance(performed(JOINTS_M), estimated(learner_m, seed), scorer)


def test_perfect_dancing_scores_high_and_faults_cost_what_they_cost_on_true_joints(known):
    perfect, unknown = (scored(0, JOINTS_M, scorer) for scorer in (known, OURS))
    assert perfect.similarity > max(93, unknown.similarity + 5) and unknown.uncertainty == 0 < perfect.uncertainty < 30
    learners = [arms_lowered(JOINTS_M, degrees) for degrees in (15, 45)] + [smaller(JOINTS_M, 0.5), standing(JOINTS_M)]
    scores = [scored(0, learner_m, known).similarity for learner_m in learners]
    true = [score_dance(performed(JOINTS_M), performed(learner_m)).similarity for learner_m in learners]
    assert (np.diff([perfect.similarity, *scores[:2]]) < -4).all() and np.abs(np.subtract(scores, true)).max() < 12
    assert scored(0, dance_joints_m(1), known).similarity < 20


def test_a_fault_of_what_is_seen_badly_costs_as_much_as_on_true_joints(monkeypatch):
    arms = [Joint[f"{side}_{part}"] for side in ("LEFT", "RIGHT") for part in ("ELBOW", "HAND")]

    def arms_seen_badly(joints_m, seed):
        found_m, confidence = joints_m.copy(), np.full(joints_m.shape[:2], 0.99)
        found_m[:, arms], confidence[:, arms] = noisy(joints_m, 0.08, seed)[:, arms], 0.6
        return Performance(found_m, np.arange(len(joints_m)) / FPS, confidence)

    *dances, a, b, c = (performed(dance_joints_m(number)) for number in range(6))
    own = [noise.own_errors(noise.Seen("", "", one, one, arms_seen_badly(one.joints_m, 7))) for one in (a, b, c)]
    monkeypatch.setitem(NOISE, "arms", noise.measured(own)._replace(steady={}))
    excess = []
    for teacher in dances:
        wrong_m = arms_lowered(teacher.joints_m, 45)
        seen_badly = score_dance(teacher, arms_seen_badly(wrong_m, 0), replace(OURS, noise="arms"))
        excess.append(seen_badly.similarity - score_dance(teacher, performed(wrong_m)).similarity)
    assert abs(np.mean(excess)) < 5  # +12 if legs that are seen well counted more than arms that are not


def test_what_is_not_seen_is_not_excused_and_no_score_exceeds_100(known):
    hands = hidden(JOINTS_M, 0, 12, [Joint.LEFT_HAND, Joint.RIGHT_HAND])
    assert scored(0, hands, known).similarity < scored(0, JOINTS_M, known).similarity - 15
    doubtful = Performance(JOINTS_M, np.arange(len(JOINTS_M)) / FPS, np.full(JOINTS_M.shape[:2], 0.8))
    exact = score_dance(performed(JOINTS_M), doubtful, known)
    shown = [exact.similarity, exact.posture, *exact.parts.values(), *exact.windows.posture, *exact.windows.similarity]
    assert max(shown) == 100


def test_noise_is_measured_as_it_is():
    found = noise.measured([noise.own_errors(seen(dance, 5)) for dance in range(2)])
    assert set(found.std_rad) == set(FEATURES["dance22_turn"].names)
    assert 0.03 < min(found.std_rad["left_elbow_inclination"], found.std_rad["right_foot_inclination"]) < 0.3
    kept = kept_by_noise(found.loss, np.array([doubt(np.full((5, 6), sure)) for sure in (0.8, 0.99)]))
    assert (kept[0] < kept[1] - 0.01).all() and (kept[1, :4] > 0.95).all()
    scores = [noise.Scored(80, 70, 84, 2), noise.Scored(90, 80, 90, 2)]
    assert noise.spread(scores) == pytest.approx(1.9) and "rms 2.8" in noise.summary([seen(0, 1)] * 2, scores)


def test_excerpts_of_a_recording_are_left_out_together(monkeypatch):
    learners = [seen(0, 1)._replace(dance=str(dance), recording=of) for dance, of in enumerate("aab")]
    names = {id(one.estimated): one.dance for one in learners}
    monkeypatch.setattr(noise, "own_errors", lambda one, _: names[id(one.estimated)])
    monkeypatch.setattr(noise, "measured", lambda dances, _: dances)
    monkeypatch.setattr(noise, "scored", lambda one, dances: noise.Scored(80, 80, 80 + 2 * int(one.dance), 1))
    scores = noise.scored_by_others(learners)
    assert [one.known for one in scores] == [80, 82, 84]
    widths = [one.uncertainty for one in noise.spread_by_others(learners, scores)]
    assert widths == pytest.approx([4, 4, 1.9])  # of the last one alone, and the 95th percentile of 0 and 2
    learnt_on = []
    monkeypatch.setattr(noise, "scored", lambda one, dances: learnt_on.append((one.dance, dances)))
    noise.scored_by_others(learners)
    assert learnt_on == [("0", ["2"]), ("1", ["2"]), ("2", ["0", "1"])]


def test_dances_of_two_folders_of_one_name_are_two(tmp_path, capsys):
    for number, name in enumerate("ab"):
        one = seen(number, 0)
        (folder := tmp_path / name / "train").mkdir(parents=True)
        joints_m, confidence = one.estimated.joints_m, one.estimated.confidence
        films = {"detected_m": joints_m, "fitted_m": joints_m, "detected": confidence, "fitted": confidence, "fps": FPS}
        films["motion"] = np.array(f"dance {name}")
        np.savez(folder / "dance_0_perfect_0.npz", teacher_m=one.teacher.joints_m, true_m=one.true.joints_m, **films)
    noise.main([str(tmp_path / "a" / "train"), str(tmp_path / "b" / "train"), "--estimator", "network"])
    told = capsys.readouterr().out
    assert all(f"{tmp_path / name / 'train'}: 1 learners" in told for name in "ab") and "\n2 learners" in told
    assert "0.1 s late: AUC of the timing 1.00" in told


def steadily_off(joints_m: np.ndarray) -> np.ndarray:
    """Joints whose left hand is off by 8 cm, as of an estimator that errs alike of all who dance the same."""
    found_m = joints_m.copy()
    found_m[:, Joint.LEFT_HAND, 1] += 0.08 * np.sin(4 * joints_m[:, Joint.LEFT_ELBOW, 0])
    return found_m


@pytest.fixture(scope="module")
def alike():
    """Learners, two perfect and one with an arm that is 30 degrees low in each of two dances, by such an estimator."""
    learners = []
    for dance, seed in ((3, 11), (4, 12), (3, 13), (4, 14)):
        true = performed(dance_joints_m(dance))
        learners.append(noise.Seen(str(dance), "perfect_0", true, true, estimated(steadily_off(true.joints_m), seed)))
    for dance in (3, 4):
        teacher, low = performed(dance_joints_m(dance)), performed(arms_lowered(dance_joints_m(dance), 30))
        learners.append(noise.Seen(str(dance), "arms_30", teacher, low, estimated(steadily_off(low.joints_m), dance)))
    return learners


def test_what_is_seen_alike_of_all_is_no_noise_beside_a_teacher_seen_so(alike, monkeypatch):
    monkeypatch.setattr(noise, "seen_teacher", lambda teacher, _: performed(steadily_off(teacher.joints_m)))
    beside = noise.with_seen_teachers(alike, "network")
    assert [one.fault for one in noise.compared(beside)] == ["perfect_0"] * 4 and len(noise.compared(alike)) == 6
    plain, less = (noise.measured([noise.own_errors(one) for one in noise.compared(learners)]) for learners in (alike, beside))
    assert less.std_rad["left_hand_inclination"] < 0.8 * plain.std_rad["left_hand_inclination"]
    assert less.std_rad["right_hand_inclination"] == pytest.approx(plain.std_rad["right_hand_inclination"], rel=0.15)
    (true, *_), found, before = (np.array(noise.scored_by_others(learners)).T for learners in (beside, beside, alike))
    assert np.abs(found[2] - true).mean() < np.abs(before[2] - true).mean() and found[2][:4].min() > 94


def test_a_teacher_is_compared_with_learners_of_the_estimator_that_sees_them(monkeypatch):
    monkeypatch.setitem(NOISE, "network_seen_teacher", NOISE["network"]._replace(spread=0.3))
    seen_so = Performance(JOINTS_M, np.arange(len(JOINTS_M)) / FPS, estimator="network_seen_teacher")
    learner = estimated(JOINTS_M, 0)
    score = score_dance(seen_so, learner, replace(OURS, noise="network"))
    assert score.scorer.noise == "network_seen_teacher"
    assert score.uncertainty < score_dance(performed(JOINTS_M), learner, replace(OURS, noise="network")).uncertainty
    by_itself = score_dance(seen_so, Performance(learner.joints_m, learner.times_s, learner.confidence, "network"))
    assert by_itself.similarity == score.similarity
    online = OnlineScorer(seen_so, replace(OURS, noise="network"))
    for frame in zip(learner.joints_m, learner.times_s, learner.confidence, strict=True):
        online.update(*frame)
    assert online.finish().similarity == pytest.approx(score.similarity, abs=1e-6)
    derived = derived_torso(seen_so)
    assert off_by(derived, np.full(JOINTS_M.shape, [0.01, 0.0, 0.0]) * np.arange(15)[:, None], "network").torso_is_derived
    for wrong in ("realtime", "none", "auto"):
        with pytest.raises(InputError, match=f"as network sees them, the learner's of noise {wrong}"):
            score_dance(seen_so, learner, replace(OURS, noise=wrong))
    assert set(SEEN_BY) == {"network", "realtime", "best"} and all(f"{name}{SEEN}" in NOISE for name in SEEN_BY)


def test_a_teacher_who_was_recorded_as_the_learner_has_a_noise_of_its_own(alike):
    beside = noise.with_recorded_teachers(alike)
    for one in beside:
        assert one.shown is not one.estimated and one.shown in [other.estimated for other in alike if other.dance == one.dance]
    seen, recorded = (noise.measured([noise.own_errors(one) for one in noise.compared(these)]) for these in (alike, beside))
    assert recorded.std_rad["right_hand_inclination"] > 1.2 * seen.std_rad["right_hand_inclination"]  # of two people
    times_s = np.arange(len(JOINTS_M)) / FPS
    for name, expected in (("network", "network_recorded_teacher"), ("webcam", "webcam")):
        teacher, learner = (Performance(JOINTS_M, times_s, estimator=name) for _ in range(2))
        assert score_dance(teacher, learner).scorer.noise == expected
        assert score_dance(teacher, learner, replace(OURS, noise=name)).scorer.noise == expected
        assert score_dance(performed(JOINTS_M), learner).scorer.noise == name
    with pytest.raises(InputError, match="the estimator of the teacher's joints"):
        score_dance(Performance(JOINTS_M, times_s, estimator="kinect"), performed(JOINTS_M))


def test_the_doubt_of_a_part_is_that_of_the_frames_that_show_it():
    of_two, of_none = doubt(np.array([[0.9, 0.0], [0.6, 0.0], [0.0, 0.0]]))
    assert of_two == pytest.approx(np.sqrt((0.1 + CERTAIN) * (0.4 + CERTAIN))) and of_none == 1
    assert doubt(np.ones((3, 1))) == pytest.approx(0.003)


def test_the_uncertainty_is_200_times_the_spread_of_what_errors_take(monkeypatch):
    loss = dict.fromkeys(("arm", "leg", "torso", "turning"), (1.0, 0.0))  # perfect dancing keeps half
    monkeypatch.setitem(NOISE, "half", NOISE["none"]._replace(loss=loss, spread=0.05))
    teacher = performed(never_turning(dance_joints_m(0)))
    assert score_dance(teacher, teacher, replace(OURS, noise="half")).uncertainty == pytest.approx(10, abs=0.3)


@pytest.mark.parametrize(("std_deg", "is_told"), [(5.0, True), (15.0, False)])
def test_a_difference_within_two_deviations_of_the_estimators_error_is_not_told(monkeypatch, std_deg, is_told):
    monkeypatch.setitem(NOISE, "rough", NOISE["none"]._replace(std_rad={"left_elbow_inclination": np.radians(std_deg)}))
    teacher_m = dance_joints_m(0, 16.0)
    learner = performed(arm_lowered(teacher_m, "left", 20))
    told = feedback(score_dance(performed(teacher_m), learner, replace(OURS, noise="rough"))).faults
    assert any((one.part, one.direction) == ("left arm", "too low") for one in told) is is_told


def test_no_part_exceeds_100_while_dancing():
    online, latest = OnlineScorer(performed(JOINTS_M), replace(OURS, noise="realtime")), []
    for frame, pose_m in enumerate(JOINTS_M):
        latest.append(online.update(pose_m, frame / FPS, np.full(15, 0.8)))
    assert max(value for one in latest if one for value in one.parts.values()) <= 100
