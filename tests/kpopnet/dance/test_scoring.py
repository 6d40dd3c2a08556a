import math

import numpy as np
import pytest
from dance_people import FPS, dance_joints_m, followed, mirrored, noisy, performed, turned

from kpopnet.dance.diagnosis import corrected, delayed, diagnose, knees_bend_backwards
from kpopnet.dance.dimensions.formation import formation
from kpopnet.dance.dimensions.movement import accents_s, dynamics
from kpopnet.dance.dimensions.stage import stage_score
from kpopnet.dance.features import FEATURES, Angles, Feature
from kpopnet.dance.feedback import feedback, moments_since
from kpopnet.dance.online import MOST_BEHIND, OnlineScorer
from kpopnet.dance.paper import PaperScorer
from kpopnet.dance.parts import PartScorer
from kpopnet.dance.performance import Performance
from kpopnet.dance.scoring import OURS, SCORERS, derived_torso, score_dance
from kpopnet.dance.timing import beat_latency_s, measured_latency_s
from kpopnet.dance.window import PARTS, timing_similarity
from kpopnet.errors import InputError
from kpopnet.skeleton import Joint

JOINTS_M = dance_joints_m(0)
AT_S = np.arange(len(JOINTS_M)) / FPS
PUBLISHED = "dance22", "paper", "raptis"
EVERY = pytest.mark.parametrize("scorer", [SCORERS[name] for name in PUBLISHED], ids=PUBLISHED)


def similarity(teacher_m, learner_m, scorer=OURS, delay_s=0.0) -> float:
    return score_dance(performed(teacher_m), performed(learner_m, delay_s), scorer).similarity


def test_a_latency_is_measured_where_the_teacher_moves():
    delay_s, posture = np.repeat([0.0, 0.27], [30, 20]), np.full(50, 100.0)
    assert measured_latency_s(delay_s, posture, np.repeat([0.0, 1.0], [30, 20])) == pytest.approx(0.27)
    assert np.isnan(measured_latency_s(delay_s, posture, np.zeros(50)))


@EVERY
def test_a_copy_scores_full_marks_for_any_position_size_and_heading_and_a_mirrored_one_does_not(scorer):
    for index in range(2):
        joints_m = dance_joints_m(index)
        assert similarity(joints_m, joints_m, scorer) > (99.9 if scorer is OURS else 96)
        assert similarity(joints_m, joints_m * 0.8 + [0.5, 0.1, 1], scorer) > 94
        if scorer.feature != "raptis":  # [17] depends on the heading of the camera
            assert similarity(joints_m, turned(joints_m, [0.1, 1, 0], 0.6), scorer) > 95
        assert similarity(joints_m, mirrored(joints_m), scorer) < 75


@EVERY
def test_more_noise_never_scores_more(scorer):
    scores = [similarity(JOINTS_M, noisy(JOINTS_M, deviation_m, 3), scorer) for deviation_m in (0, 0.02, 0.06, 0.12)]
    assert (np.diff(scores) < 0.5).all(), scores


def test_the_score_is_a_smooth_function_of_the_delay_and_falls_with_it():
    near = [similarity(JOINTS_M, JOINTS_M, delay_s=delay_s) for delay_s in np.arange(0, 0.1, 0.02)]
    assert near[0] > 99.9 and (np.diff(near) < 0).all() and np.diff(near).min() > -2.4
    for sign in (1, -1):
        far = [similarity(JOINTS_M, JOINTS_M, delay_s=sign * delay_s) for delay_s in (0.2, 0.5, 1.2)]
        assert (np.diff([near[-1], *far]) < 0.5).all(), far


def test_timing_similarity_is_eq_13():
    at = {delay_s: timing_similarity(delay_s, 0.5, 0.4) for delay_s in (0.0, -0.2, 0.2, 0.4, 3.0)}
    assert at[0.0] == pytest.approx(1 - math.exp(-2)) and at[-0.2] == at[0.2] == pytest.approx(1 - math.exp(-1))
    assert at[0.4] == at[3.0] == 0
    ours = PartScorer(alpha=0.5, tau=0.4)
    assert ours.timing(0.0) == 1 and ours.timing(0.2) == pytest.approx(at[0.2] / at[0.0])


def test_similarity_is_the_mean_of_the_windows_products():
    score = score_dance(performed(JOINTS_M), performed(noisy(JOINTS_M, 0.03), 0.1))
    windows = score.windows
    np.testing.assert_allclose(windows.similarity, windows.timing * windows.posture / 100)
    assert (windows.weight <= 1).all() and (windows.weight > 0.5).mean() > 0.9
    for name in ("similarity", "timing", "posture"):
        assert getattr(score, name) == pytest.approx(np.average(getattr(windows, name), weights=windows.weight))
    of_paper = score_dance(performed(JOINTS_M), performed(dance_joints_m(1)), SCORERS["paper"])
    assert of_paper.similarity == pytest.approx(of_paper.windows.similarity.mean())
    for one, hop_s in ((windows, 0.5), (of_paper.windows, 2)):
        np.testing.assert_allclose(np.diff(one.start_s), hop_s)


def test_algorithm_3_as_printed_does_not_find_a_late_copy():
    teacher, late, printed = performed(JOINTS_M), performed(JOINTS_M, 1.0), PaperScorer(as_printed=True)
    copy = score_dance(teacher, teacher, printed)
    assert copy.similarity > 95 and feedback(copy).hints == ()
    assert [score_dance(teacher, late, one).posture > 80 for one in (printed, SCORERS["paper"])] == [False, True]


def test_a_new_feature_is_scored_by_the_papers_scorer_under_its_name(monkeypatch):
    def hands(joints_m, fps):
        heights = joints_m[:, [Joint.LEFT_HAND, Joint.RIGHT_HAND], 1] - joints_m[:, [Joint.TORSO], 1]
        return Angles(np.pi * heights, np.ones_like(heights))

    monkeypatch.setitem(FEATURES, "hands", Feature(("left_hand_height", "right_hand_height"), hands))
    scorer, learner_m = PaperScorer("hands"), JOINTS_M.copy()
    assert similarity(JOINTS_M, JOINTS_M, scorer) > 95 > 60 > similarity(JOINTS_M, dance_joints_m(1), scorer)
    learner_m[:, Joint.LEFT_HAND] = learner_m[:, Joint.LEFT_HIP]
    parts = score_dance(performed(JOINTS_M), performed(learner_m), scorer).parts
    assert set(parts) == {"left arm", "right arm"} and parts["left arm"] < parts["right arm"] - 5


def without(frames, joints=slice(None), scorer=OURS, **options):
    """The score of a copy that lacks some joints in some frames."""
    learner_m = JOINTS_M.copy()
    learner_m[np.ix_(np.arange(len(JOINTS_M))[frames], np.arange(15)[joints])] = np.nan
    return score_dance(performed(JOINTS_M), performed(learner_m), scorer, **options)


HAND_AND_FOOT = [Joint.LEFT_HAND, Joint.RIGHT_FOOT]


def test_the_papers_scorer_leaves_out_what_is_missing():
    paper = SCORERS["paper"]
    score = without(slice(100, 130), HAND_AND_FOOT, paper)
    assert score.similarity > 90 and score.scored == 1
    score = without(slice(100, 190), scorer=paper)
    assert 0.5 < score.scored < 1 and score.similarity > 85
    gaps = without(np.arange(len(JOINTS_M)) % 60 < 30, scorer=paper)
    assert gaps.similarity > 85 and np.nanmax(abs(gaps.windows.delay_s)) < 0.1
    assert min(without(slice(len(JOINTS_M) // 2, None), scorer=paper).parts.values()) > 85
    unobserved = without(slice(None), scorer=paper, unobserved_is_nan=True)
    assert unobserved.scored == 0 and math.isnan(unobserved.similarity)


def test_what_is_missing_lowers_the_part_and_the_windows_that_lack_it():
    score = without(slice(100, 130), HAND_AND_FOOT)
    assert 80 < score.similarity < 97 and score.scored == 1
    for part in PARTS:
        lacking = part in ("left arm", "right leg")
        assert (score.parts[part] < 95) == (score.coverage[part] < 0.95) == lacking
        assert (score.windows.coverage[part][-1] == 1) and (score.windows.coverage[part].min() < 0.6) == lacking
    score = without(slice(100, 190))
    assert 0.5 < score.scored < 1 and 0.65 < score.completeness < 0.8 and 65 < score.similarity < 80
    assert (score.windows.similarity[~np.isfinite(score.windows.delay_s)] == 0).all()


def test_dropped_frames_and_other_frame_rates_hardly_change_the_score():
    kept = np.sort(np.random.default_rng(0).permutation(len(JOINTS_M))[: len(JOINTS_M) * 2 // 3])
    assert score_dance(performed(JOINTS_M), Performance(JOINTS_M[kept], kept / FPS)).similarity > 90
    for fps in (15.0, 100.0):
        assert score_dance(performed(JOINTS_M), performed(dance_joints_m(0, fps=fps), fps=fps)).similarity > 85


def finished(learner):
    followed(online := OnlineScorer(performed(JOINTS_M)), learner)
    return online.finish()


LOST = performed(np.full_like(JOINTS_M, np.nan))
FAR = JOINTS_M.copy()
FAR[100, 7] = 1e200


@pytest.mark.parametrize(
    ("refused", "message"),
    [
        (lambda: similarity(JOINTS_M[:50], JOINTS_M), r"dance lasts 1\.63 s, less than a window of 2\.0 s"),
        (lambda: similarity(JOINTS_M, JOINTS_M[:50]), r"recorded for 1\.63 s of a dance of 11\.97 s, in no whole window"),
        (lambda: score_dance(performed(JOINTS_M), LOST), "the learner's dance: no joint is known in any of its 360 frames"),
        (lambda: score_dance(JOINTS_M, JOINTS_M), "teacher's dance is an array without times and fps=None; give its frames"),
        (lambda: score_dance(JOINTS_M, JOINTS_M[:, :14], fps=FPS), r"the learner's dance: joints of shape \(360, 14, 3\)"),
        (lambda: Performance(JOINTS_M[:3], np.array([0, 0.2, 0.1])), r"frame 2 has time 0\.1: times must be finite and incr"),
        (lambda: Performance(JOINTS_M[:1], np.zeros(1), np.full((1, 15), np.nan)), "expected numbers from 0 to 1"),
        (lambda: Performance(JOINTS_M[:1], np.zeros(1), "abc"), "confidence: expected an array of numbers"),
        (lambda: Performance(FAR, np.arange(len(FAR)) / FPS), r"a coordinate of 1e\+200: expected at most 1e\+06 metres"),
        (lambda: score_dance(JOINTS_M, JOINTS_M, fps=3), r"the teacher's dance: frames are 0\.333 s apart"),
        (lambda: OnlineScorer(performed(JOINTS_M)).update(JOINTS_M[0, :14], 0.1), r"joints of shape \(14, 3\)"),
        (lambda: OnlineScorer(performed(JOINTS_M)).finish(), "no whole window"),
        (lambda: finished(LOST), "the learner's dance: no joint is known in any of its 360 frames"),
    ],
)
def test_bad_input_is_refused_with_a_message(refused, message):
    with pytest.raises(InputError, match=message):
        refused()


SHORT = performed(JOINTS_M[:90])
SCORE = score_dance(SHORT, SHORT)


@pytest.mark.parametrize(
    ("mistaken", "message"),
    [
        (lambda: score_dance("a.bvh", "b.bvh"), r"the teacher's dance: expected a Performance, .* read_performance.*got str"),
        (lambda: score_dance(SHORT, None), "the learner's dance: expected a Performance, .* got NoneType"),
        (lambda: score_dance(JOINTS_M, JOINTS_M, fps="30"), "array without times and fps='30'"),
        (lambda: score_dance(SHORT, SHORT, "dance22"), r"scorer: expected one such as .*SCORERS\['dance22'\], got 'dance22'"),
        (lambda: OnlineScorer(SHORT, PartScorer), "scorer: expected one such as"),
        (lambda: OnlineScorer(JOINTS_M), "expected a Performance, as .* makes, got ndarray"),
        (lambda: score_dance(SHORT, SHORT, free_s=(1, 2)), r"free: expected pairs of seconds, such as .*, got \(1, 2\)"),
        (lambda: OnlineScorer(SHORT, free_s=None), "free: expected pairs of seconds"),
        (lambda: formation([JOINTS_M], [JOINTS_M]), "expected a Performance"),
        (lambda: formation([SHORT], [SHORT], (1, 2)), "free: expected pairs of seconds"),
        (lambda: PartScorer(alpha="1"), "alpha='1' must be a positive number"),
        (lambda: PartScorer(latency_s=None), "latency_s=None: expected -5 to 5"),
        (lambda: SCORE.total(["similarity"]), "weights: expected numbers by name"),
        (lambda: SCORE.total({"similarity": "3"}), "similarity='3': expected a number"),
        (lambda: SCORE.figures(0.5), r"beats of shape \(\): expected the times of beats"),
        (lambda: SCORE.beats_s(1e-12), "seconds of a beat=1e-12: expected a number in"),
        (lambda: feedback(SCORE, 120), "seconds of a beat=120: expected a number in"),
        (
            lambda: feedback(OnlineScorer(SHORT).score_so_far()),
            "got NoneType; before the first window there is no score so far",
        ),
        (
            lambda: measured_latency_s([0.1] * 7, [90.0], [1.0]),
            r"delays of shape \(7,\), postures of \(1,\), weights of \(1,\)",
        ),
        (lambda: beat_latency_s(JOINTS_M[:, :14], AT_S, 0.5), r"joints of shape \(360, 14, 3\): expected \(frames, 15, 3\)"),
        (lambda: beat_latency_s(JOINTS_M, AT_S[:9], 0.5), r"360 frames with times of shape \(9,\)"),
        (lambda: beat_latency_s(JOINTS_M, AT_S * math.nan, 0.5), "expected one time a frame, finite"),
        (lambda: beat_latency_s(JOINTS_M, AT_S, 120), "seconds of a beat=120: expected a number in 0.05..10"),
        (lambda: Performance(JOINTS_M, AT_S, None, None), "estimator=None: expected the name of one, or none"),
        (lambda: formation(SHORT, SHORT), "teachers: expected a list of dances, got"),
        (lambda: formation([SHORT], None), "learners: expected a list of dances, got None"),
        (lambda: SCORE.rhythm([2.0, 1.0]), "beats: expected finite times that increase"),
        (lambda: SCORE.free([0.0, math.inf]), "beats: expected finite times that increase"),
        (lambda: feedback(SCORE, recording=diagnose(SHORT, SHORT, OURS)), "recording: expected the faults of a diagnosis"),
        (lambda: dynamics(JOINTS_M[:, :14], JOINTS_M, np.arange(360)), r"joints of shape \(360, 14, 3\): expected"),
        (lambda: dynamics(JOINTS_M, JOINTS_M, np.arange(9)), r"360 frames matched with those of shape \(9,\)"),
        (lambda: accents_s(JOINTS_M[:, :14]), r"joints of shape \(360, 14, 3\): expected"),
        (lambda: stage_score(JOINTS_M, None, np.zeros(360)), r"joints of shape \(\): expected"),
        (lambda: stage_score(JOINTS_M, JOINTS_M[:9], np.zeros(360)), "360 and 9 frames with delays of shape"),
        (lambda: moments_since(None, 1.0), "score: expected a DanceScore, .* got NoneType"),
        (lambda: moments_since(SCORE, "1"), "since_s='1': expected a number"),
        (lambda: diagnose(JOINTS_M, SHORT, OURS), "the teacher's dance: expected a Performance, .* got ndarray"),
        (lambda: diagnose(SHORT, None, OURS), "the learner's dance: expected a Performance, .* got NoneType"),
        (lambda: diagnose(SHORT, SHORT, "dance22"), "scorer: expected one such as"),
        (lambda: diagnose(SHORT, SHORT, OURS, given="mirrored"), "given: expected a kpopnet.dance.diagnosis.Correction"),
        (lambda: corrected(SHORT, "mirror"), "correction=mirror: expected one of as_recorded, mirrored, swapped, reflected"),
        (lambda: corrected(JOINTS_M, "mirrored"), "the dance to correct: expected a Performance"),
        (lambda: delayed(SHORT, "0.2"), "late_s='0.2': expected a number"),
        (lambda: delayed(SHORT, 0.2, None), "rate=None: expected a number"),
        (lambda: delayed(JOINTS_M, 0.2), "the dance to delay: expected a Performance"),
        (lambda: knees_bend_backwards(JOINTS_M), "the dance: expected a Performance"),
        (lambda: OnlineScorer(SHORT).preview(math.nan, 1.0), "end_s=nan: expected a number"),
        (lambda: OnlineScorer(SHORT).update(JOINTS_M[0], None), "a frame at None: expected its time in seconds"),
        (lambda: OnlineScorer(SHORT).update(JOINTS_M[0], "now"), "a frame at 'now': expected its time in seconds"),
        (
            lambda: OnlineScorer(SHORT).update(JOINTS_M[0], 1.7e9),
            "of a dance from 0 to 2.96667 s: expected seconds on the teach",
        ),
    ],
)
def test_arguments_of_another_type_or_unit_are_one_line(mistaken, message):
    with pytest.raises(InputError, match=message):
        mistaken()


def test_free_parts_may_come_from_anywhere():
    whole = score_dance(SHORT, SHORT, free_s=[(1, 2)])
    for free_s in (np.array([[1, 2]]), ((1.0, 2.0) for _ in "1"), [[1, 2]]):
        np.testing.assert_equal(score_dance(SHORT, SHORT, free_s=free_s), whole)
    other_m = np.concatenate([dance_joints_m(1)[: round(4 * FPS)], JOINTS_M[round(4 * FPS) :]])
    swapped = corrected(performed(other_m), "swapped")
    listed, drawn = (diagnose(performed(JOINTS_M), swapped, OURS, free_s=one) for one in ([(0, 4)], (one for one in [(0, 4)])))
    assert listed.corrected > 99 and drawn.corrected == listed.corrected


def test_a_score_so_far_may_be_changed_while_the_dance_goes_on():
    online, changed = (OnlineScorer(performed(JOINTS_M), PartScorer(noise="webcam")) for _ in range(2))
    for frame, joints_m in enumerate(JOINTS_M):
        for one in (online, changed):
            one.update(joints_m, frame / FPS)
        if frame == 180:
            score = changed.score_so_far()
            for array in (score.teacher_m, score.learner_m, score.is_free, *score.windows[:6], *score.windows.parts.values()):
                array[:] = 1
    np.testing.assert_equal(changed.finish(), online.finish())


def test_a_finished_dance_takes_no_more_frames():
    followed(online := OnlineScorer(performed(JOINTS_M)), performed(JOINTS_M[:100]))
    finished = online.finish()
    with pytest.raises(InputError, match=r"after finish\(\); for another dance make another OnlineScorer"):
        online.update(JOINTS_M[100], 100 / FPS)
    with pytest.raises(InputError, match="increase from frame to frame; for another dance make another OnlineScorer"):
        online.update(JOINTS_M[0], 0.0)
    np.testing.assert_equal(online.finish(), finished)


@pytest.mark.parametrize("wrong", [False, True])
def test_lower_confidence_never_scores_more(wrong):
    learner_m, arm, scores = JOINTS_M.copy(), [Joint.LEFT_ELBOW, Joint.LEFT_HAND], []
    if wrong:
        learner_m[:, arm] = dance_joints_m(1)[:, arm]
    for confidence in (0.02, 0.1, 0.3, 1):
        values = np.ones(JOINTS_M.shape[:2])
        values[:, arm] = confidence
        learner = Performance(learner_m, np.arange(len(JOINTS_M)) / FPS, values)
        scores.append(score_dance(performed(JOINTS_M), learner).similarity)
    assert (np.diff(scores) > -0.5).all() and (wrong or scores[-1] > scores[0] + 10), scores


def test_what_the_teacher_does_not_show_costs_nothing():
    teacher_m = JOINTS_M.copy()
    teacher_m[:, [Joint.LEFT_HAND, Joint.RIGHT_HAND, Joint.LEFT_KNEE, Joint.LEFT_FOOT]] = np.nan
    teacher_m[100:160] = np.nan
    score = score_dance(performed(teacher_m), performed(JOINTS_M))
    assert score.similarity > 98 and "left leg" not in score.parts and score.completeness > 0.99
    excerpt = Performance(JOINTS_M[60:240], np.arange(60, 240) / FPS)
    score = score_dance(excerpt, performed(JOINTS_M))
    assert score.similarity > 95
    assert score.windows.start_s[0] == 2.0 and score.windows.start_s[-1] <= 6.0


ONLINE = [
    SCORERS["paper"], SCORERS["raptis"], PartScorer(mirrored="auto", latency_s=0.1), PartScorer(mirrored="true"),
    PartScorer(noise="realtime"), PartScorer(noise="webcam"),
]  # fmt: skip


@pytest.mark.parametrize("scorer", ONLINE)
def test_online_scores_equal_offline_scores(scorer):
    teacher = Performance(dance_joints_m(1)[15:], np.arange(15, 360) / FPS)
    rng = np.random.default_rng(0)
    joints_m = noisy(dance_joints_m(1), 0.03)
    joints_m[100:130, 6] = np.nan
    kept = np.delete(np.arange(360), np.r_[200:215, 300:302])
    times_s = kept / FPS + rng.uniform(0, 0.02, len(kept)) + 0.2
    confidence = rng.uniform(size=joints_m.shape[:2])
    online = OnlineScorer(teacher, scorer)
    latest = [online.update(joints_m[frame], at_s, confidence[frame]) for frame, at_s in zip(kept, times_s, strict=True)]
    so_far = online.score_so_far()
    whole = score_dance(teacher, Performance(joints_m[kept], times_s, confidence[kept]), scorer)
    np.testing.assert_equal(online.finish(), whole)
    assert latest[10] is None
    with pytest.raises(InputError, match="times must be finite and increase"):
        online.update(joints_m[0], times_s[-1])
    count = len(so_far.windows.start_s)
    assert len(whole.windows.start_s) - 2 <= count <= len(whole.windows.start_s)
    np.testing.assert_array_equal(so_far.windows.posture, whole.windows.posture[:count])
    assert latest[-1].so_far == pytest.approx(so_far.similarity)
    # The online score at the end of each window, where no later sample of that window was delayed.
    windows = {round(score.time_s, 3): score for score in latest if score is not None}
    ends = zip(np.round(whole.windows.start_s + 59 / FPS, 3), whole.windows.posture, strict=True)
    pairs = [(windows[end].posture, posture) for end, posture in ends if end in windows]
    assert len(pairs) > 0.5 * count and all(one == other for one, other in pairs)


@pytest.mark.parametrize("asked", ["false", "true", "auto"])
def test_asking_for_the_score_so_far_or_for_a_preview_changes_nothing(asked):
    """Half of the dance as the teacher's mirror image: what is shown may change, and the other comparison lags behind it."""
    learner_m = np.concatenate([dance_joints_m(1)[:120], mirrored(dance_joints_m(1))[120:]])
    online, looked_at = (OnlineScorer(performed(dance_joints_m(1)), PartScorer(asked)) for _ in range(2))
    for frame, joints_m in enumerate(learner_m):
        np.testing.assert_equal(looked_at.update(joints_m, frame / FPS), online.update(joints_m, frame / FPS))
        if frame % 37 == 36:
            looked_at.score_so_far()
            assert looked_at.preview(frame / FPS, 1.0) is not None
    np.testing.assert_equal(looked_at.finish(), online.finish())


@pytest.mark.parametrize("mirrored", ["false", "true", "auto"])
def test_no_frames_are_kept_for_the_end_of_the_dance(mirrored):
    online = OnlineScorer(performed(JOINTS_M), PartScorer(mirrored=mirrored))
    followed(online, performed(JOINTS_M))
    assert len(online._frames) <= online._history + MOST_BEHIND


def test_no_samples_are_kept_of_the_time_before_the_dance_and_after_it():
    online = OnlineScorer(performed(JOINTS_M))
    for time_s in np.arange(-30, len(JOINTS_M) / FPS + 30, 1 / FPS):
        online.update(JOINTS_M[int(np.clip(time_s * FPS, 0, len(JOINTS_M) - 1))], float(time_s))
        assert len(online._samples) < 30
    assert online.finish().similarity > 99


@pytest.mark.parametrize("scorer", [OURS, SCORERS["paper"]])
def test_a_learner_who_joins_late_and_leaves_early_scores_the_same_online(scorer):
    teacher_m, frames = dance_joints_m(1), np.arange(100, 260)
    learner, online = Performance(teacher_m[frames], frames / FPS), OnlineScorer(performed(teacher_m), scorer)
    followed(online, learner)
    whole = score_dance(performed(teacher_m), learner, scorer)
    np.testing.assert_equal(online.finish(), whole)
    assert whole.scored < 0.7 and (whole.similarity < 60 or scorer is not OURS)


def test_the_learners_mirror_image_is_preferred_or_hinted_at():
    learner = performed(mirrored(JOINTS_M))
    never, always, auto = (score_dance(performed(JOINTS_M), learner, PartScorer(one)) for one in ("false", True, "auto"))
    assert never.similarity < 40 and never.mirror_fits_better and not never.mirrored
    assert min(always.similarity, auto.similarity) > 99.9 and always.mirrored and auto.mirrored
    copy = score_dance(performed(JOINTS_M), performed(JOINTS_M), PartScorer("auto"))
    assert copy.similarity > 99.9 and not copy.mirrored and not copy.mirror_fits_better


@pytest.mark.parametrize("late_s", [-0.8, 0.6, 1.2])
def test_who_is_late_is_told_from_who_mirrors(late_s):
    """Online, too, also where the learner's similarity is 0 on either side."""
    for seed in range(3):
        joints_m = dance_joints_m(seed)
        for learner_m in (joints_m, mirrored(joints_m)):
            teacher, learner, scorer = performed(joints_m), performed(learner_m, late_s), PartScorer(mirrored="auto")
            whole, online = score_dance(teacher, learner, scorer), followed(OnlineScorer(teacher, scorer), learner)
            assert whole.mirrored == online.mirrored == (learner_m is not joints_m)
            assert whole.posture > 90


@pytest.mark.parametrize("name", ["dance22", "paper"])
@pytest.mark.parametrize("derived", ["teacher", "learner"])
def test_where_one_torso_is_derived_the_bend_is_not_compared_and_not_unseen(name, derived):
    whole, without = performed(JOINTS_M), derived_torso(performed(JOINTS_M))
    pair = (without, whole) if derived == "teacher" else (whole, without)
    score, copy = score_dance(*pair, SCORERS[name]), score_dance(without, without, SCORERS[name])
    assert score.similarity == pytest.approx(copy.similarity, abs=1e-6)
    assert score.completeness == pytest.approx(copy.completeness)
    online = OnlineScorer(pair[0], SCORERS[name], torso_is_derived=derived == "learner")
    followed(online, pair[1])
    assert online.finish().similarity == pytest.approx(score.similarity, abs=1e-6)


def test_of_an_estimator_whose_noise_is_known_the_teachers_own_torso_stays():
    teacher = performed(JOINTS_M)
    score = score_dance(teacher, derived_torso(teacher), PartScorer(noise="webcam"))
    np.testing.assert_array_equal(score.teacher_m, score_dance(teacher, teacher).teacher_m)


def test_between_two_delays_a_frame_has_that_of_the_windows_around_it():
    """By the middle of the windows, so that stage and dynamics are compared with what was matched."""
    teacher_m = dance_joints_m(1, 16.0)
    times_s = np.arange(len(teacher_m)) / FPS
    late_s = score_dance(performed(teacher_m), Performance(teacher_m, times_s + np.where(times_s >= 8, 0.4, 0.0)))._delays_s
    assert abs(late_s[: round(6.5 * FPS)]).max() < 0.1 and abs(late_s[round(9.9 * FPS) :] - 0.4).max() < 0.1
    assert np.argmax(late_s > 0.2) / FPS == pytest.approx(8.2, abs=0.45)
