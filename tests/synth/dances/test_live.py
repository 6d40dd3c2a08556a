"""The dances of the teacher program, and the learner who dances live."""

import numpy as np
import pytest

import synth.dances.live
import synth.dances.taught
from kpopnet.errors import InputError
from synth.body.shape import draw_person
from synth.body.teacher import teacher_person
from synth.dances.live import CAMERA, LATE_S, LiveLearner, learned, motion_of
from synth.dances.simulate import MAX_TRAVEL_M
from synth.dances.taught import DANCES, Teacher, composed, dance_title
from synth.motion.choreography.composer import dance, tempo_bpm
from synth.motion.skeleton import INDEX, LEG_M


@pytest.fixture(scope="module")
def taught():
    return Teacher().dance(4)


def test_a_dance_has_whole_phrases_and_stays_on_its_stage(taught):
    motion, bpm = composed(4)
    phrases = len(motion) / motion.fps / (8 * 60 / bpm)
    assert abs(phrases - round(phrases)) < 0.01 and bpm == taught.bpm
    assert np.ptp(motion.root_m[:, [0, 2]], axis=0).max() < MAX_TRAVEL_M
    assert np.array_equal(composed(4)[0].quats, motion.quats)
    assert len({dance_title(index) for index in range(DANCES)}) == DANCES


def test_dances_last_whole_eights_of_counts(monkeypatch):
    asked = []

    def recorded(index, seed, seconds, fps):
        asked.append(seconds / (8 * 60 / tempo_bpm(index, seed)))
        return dance(index, seed, 1.0, fps)

    monkeypatch.setattr(synth.dances.taught, "dance", recorded)
    lengths = [8 * 60 / composed(index)[1] * asked[-1] for index in range(12)]
    np.testing.assert_allclose(asked, np.round(asked), atol=1e-9)
    assert 20 <= min(lengths) < 26 and 30 < max(lengths) < 36 + 5.4


def test_the_motion_of_a_danced_dance_is_the_composed_one(taught):
    motion, (expected, _) = motion_of(taught.quats, taught.hips_m, taught.fps), composed(4)
    np.testing.assert_allclose(motion.quats, expected.quats, atol=1e-6)
    way_m, expected_m = ((one.root_m - one.root_m[0])[:, [0, 2]] for one in (motion, expected))
    np.testing.assert_allclose(way_m, expected_m * teacher_person().leg_m / LEG_M, atol=1e-4)


def test_a_fault_is_in_its_limb_alone(taught):
    motion = motion_of(taught.quats, taught.hips_m, taught.fps)
    hanging = learned(motion, "perfect", "left arm", np.random.default_rng(0))
    changed = np.abs(hanging.quats - motion.quats).max(axis=(0, 2)) > 1e-3
    assert changed[INDEX["LeftArm"]] and not changed[[INDEX["RightArm"], INDEX["LeftLeg"], INDEX["Spine"]]].any()
    late = learned(motion, "perfect", "late", np.random.default_rng(0))
    shift = round(LATE_S * motion.fps)
    same = (late.quats[shift + 30 :] * motion.quats[30:-shift]).sum(axis=-1)
    assert np.abs(same).mean() > 0.999
    still = learned(motion, "still", "", np.random.default_rng(0))
    assert np.abs(still.quats - still.quats[0]).max() < 1e-6


def test_the_camera_sees_the_learner_dance(taught):
    learner = LiveLearner(taught.quats, taught.hips_m, taught.fps, "perfect", seed=3)
    empty = LiveLearner(taught.quats, taught.hips_m, taught.fps, "absent", seed=3)
    before, after, room = learner.frame(0.0), learner.frame(6.0), empty.frame(0.0)
    assert before.shape == (CAMERA.height, CAMERA.width) and before.dtype == np.float32
    nearer = (before > 0) & (room > 0) & (before < room - 0.2)
    moved = (before > 0) & (after > 0) & (abs(before - after) > 0.3)
    assert 2000 < nearer.sum() < 30_000 and moved.sum() > 200
    assert np.array_equal(LiveLearner(taught.quats, taught.hips_m, taught.fps, "perfect", seed=3).frame(0.0), before)


def test_learners_are_near_the_people_of_a_split(taught, monkeypatch):
    asked = []
    monkeypatch.setattr(synth.dances.live, "draw_person", lambda *given: asked.append(given[2]) or draw_person(*given))
    LiveLearner(taught.quats, taught.hips_m, taught.fps, "perfect")
    LiveLearner(taught.quats, taught.hips_m, taught.fps, "perfect", people_of="benchmark")
    assert asked == ["train", "benchmark"]


def test_an_unknown_fault_is_refused(taught):
    with pytest.raises(InputError, match="expected one of"):
        LiveLearner(taught.quats, taught.hips_m, taught.fps, "best", "left ear")


def test_a_dance_that_needs_more_room_than_the_camera_sees_is_danced_too(taught):
    far_m = taught.hips_m + np.linspace(0, 30, len(taught.hips_m))[:, None] * np.array([1.0, 0, 0])
    learner = LiveLearner(taught.quats, far_m, taught.fps, "perfect")
    for second in (0.0, 5.0):
        learner.frame(second)
        assert (learner._studio.renderer.person_m() > 0).sum() > 2000
