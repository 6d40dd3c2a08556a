"""Through a picture without depth only what lies across the line of sight is compared."""

from dataclasses import replace

import numpy as np
import pytest
from dance_learners import arm_lowered, turned_about
from dance_people import FPS, dance_joints_m, mirrored, performed, turned

from kpopnet.dance.features import FEATURES, dance_features
from kpopnet.dance.noise.sight import path_distances, seen_differences, segment_differences
from kpopnet.dance.noise.steady import FEATURE
from kpopnet.dance.noise.table import NOISE
from kpopnet.dance.performance import Performance
from kpopnet.dance.scoring import OURS, SCORERS, score_dance
from kpopnet.dance.window import PARTS, part_of_angles
from kpopnet.skeleton import Joint

JOINTS_M = dance_joints_m(0)
LEFT_ARM = 1  # in the order of `limb_directions`


@pytest.fixture
def flat(monkeypatch):
    """A scorer of true joints that does as if they had been lifted from a picture."""
    monkeypatch.setitem(NOISE, "flat", NOISE["none"]._replace(sees_depth=False))
    return replace(OURS, noise="flat")


def standing_m(forearm=(1.0, 0.0, 0.0)):
    """(1, 15, 3) a person who faces the camera at 3 m, both arms held sideways, the left forearm along a direction."""
    joints_m = np.zeros((15, 3))
    joints_m[Joint.HEAD], joints_m[Joint.NECK] = (0, -0.7, 0), (0, -0.5, 0)
    for side, x in (("LEFT", 1.0), ("RIGHT", -1.0)):
        for joint, at in {"SHOULDER": (0.2, -0.45), "ELBOW": (0.5, -0.45), "HAND": (0.75, -0.45), "HIP": (0.1, 0.1)}.items():
            joints_m[Joint[f"{side}_{joint}"]] = (x * at[0], at[1], 0)
        joints_m[Joint[f"{side}_KNEE"]], joints_m[Joint[f"{side}_FOOT"]] = (x * 0.1, 0.5, 0), (x * 0.1, 0.9, 0)
    joints_m[Joint.LEFT_HAND] = joints_m[Joint.LEFT_ELBOW] + 0.25 * np.array(forearm)
    return joints_m[None] + [0, 0, 3]


def arm_turned(joints_m, axis, degrees, begin=Joint.LEFT_SHOULDER, moved=(Joint.LEFT_ELBOW, Joint.LEFT_HAND)):
    axes = np.broadcast_to(axis, (len(joints_m), 3))
    return turned_about(joints_m, begin, moved, axes, np.full(len(joints_m), np.radians(degrees)))


def seen_deg(learner_m, teacher_m):
    """(2,) degrees of the left upper arm and forearm."""
    seen = seen_differences(learner_m, np.array([0]), teacher_m, np.array([0]))
    return np.degrees(np.linalg.norm(seen.scaled[0, :, LEFT_ARM], axis=-1))


@pytest.mark.parametrize("aside_rad", [0.0, -0.8])
def test_across_the_line_of_sight_a_turn_is_seen_and_along_it_not(aside_rad):
    """Of a person who stands before the camera, or aside and turned to it."""
    teacher_m = standing_m()
    seen = [arm_turned(teacher_m, axis, 20) for axis in ((0, 0, 1), (0, 1, 0))]
    teacher_m, *seen = (turned(one, (0, 1, 0), aside_rad) for one in (teacher_m, *seen))
    (across, forearm), along = (seen_deg(one, teacher_m) for one in seen)
    assert across == pytest.approx(20 * np.sqrt(2), rel=0.03)  # as large again may lie along the line of sight
    assert forearm < 0.5  # it moves with the upper arm
    assert max(along) < 1.5


def test_an_error_of_the_upper_arm_along_the_line_of_sight_is_none_of_a_forearm_that_points_at_the_camera():
    """The forearm itself is seen well there, but about the upper arm it would be 20 degrees off."""
    teacher_m = standing_m(forearm=(0, 0, -1))
    learner_m = arm_turned(teacher_m, (0, 1, 0), 20, moved=(Joint.LEFT_ELBOW,))
    learner_m[:, Joint.LEFT_HAND] = learner_m[:, Joint.LEFT_ELBOW] + [0, 0, -0.25]
    assert max(seen_deg(learner_m, teacher_m)) < 1.5


def test_in_the_mean_over_all_directions_squares_are_those_of_the_whole_difference():
    rng, teacher_m = np.random.default_rng(0), standing_m(forearm=(0.6, 0.0, -0.8))
    axes = rng.normal(size=(400, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    upper = [seen_deg(arm_turned(teacher_m, axis, 10), teacher_m)[0] for axis in axes]
    forearm = [seen_deg(arm_turned(teacher_m, axis, 10, Joint.LEFT_ELBOW, (Joint.LEFT_HAND,)), teacher_m)[1] for axis in axes]
    # Two of three axes turn a direction, in the mean.
    for seen in (upper, forearm):
        assert np.sqrt(np.mean(np.square(seen))) == pytest.approx(10 * np.sqrt(2 / 3), rel=0.08)


@pytest.mark.parametrize("forearm", [(0.6, -0.8, 0.0), (0.6, 0.8, 0.0)])
def test_of_what_is_seen_the_angles_are_those_of_the_feature_and_of_what_is_not_seen_none(forearm):
    teacher_m = standing_m(forearm)
    lower_arm, leg = (Joint.LEFT_ELBOW, (Joint.LEFT_HAND,)), (Joint.LEFT_HIP, (Joint.LEFT_KNEE, Joint.LEFT_FOOT))
    for segment, away, moved in (
        ("left_elbow", (0, 1, 0), ()), ("left_hand", (0, 1, 0), lower_arm), ("left_knee", (1, 0, 0), leg),
    ):  # fmt: skip
        columns = [name.startswith(segment) for name in FEATURES[FEATURE].names]
        across, along = (arm_turned(teacher_m, axis, 12, *moved) for axis in ((0, 0, 1), away))
        for learner_m, seen in ((across, True), (along, False)):
            pair = [dance_features(np.repeat(one, 3, axis=0), FEATURE, FPS) for one in (learner_m, teacher_m)]
            found, whole = (
                np.degrees(path_distances(np.array([[1, 0]]), *pair, 0, part_of_angles(FEATURE), depth).signed[0, columns])
                for depth in (False, True)
            )
            determined = pair[0].weights[1, columns] > 0.3
            assert abs(whole[determined]).max() > 5
            assert found[determined] == pytest.approx(whole[determined] if seen else 0.0, abs=1.5)


def test_the_left_arms_difference_is_the_left_arms_and_what_the_teacher_does_not_show_is_none():
    pair = [dance_features(one, FEATURE, FPS) for one in (arm_lowered(JOINTS_M, "left", 20), JOINTS_M)]
    pair[1].angles_rad[50:] = np.nan
    frames = np.arange(1, 60)
    path = np.stack([frames, np.zeros_like(frames)], axis=1)
    squared = path_distances(path, *pair, 0, part_of_angles(FEATURE), sees_depth=False).squared
    of_parts = dict(zip(PARTS, squared[:49, 1].sum(axis=0), strict=True))
    assert of_parts["left arm"] > 20 * max(of_parts["right arm"], of_parts["left leg"], of_parts["right leg"])
    assert squared[20, 0, 0] != squared[20, 1, 0]  # the neighbours in time are compared too
    assert not squared[49:, :, :4].any()
    assert np.isnan(segment_differences(*pair, sees_depth=False)[50:]).all()


def along_the_lines_of_sight(joints_m, deviation_m, seed=0):
    """Joints of which each stands steadily off along its own line of sight, as the guesses of a webcam's network do."""
    off_m = np.random.default_rng(seed).normal(0, deviation_m, (1, 15, 1))
    off_m[:, [Joint.TORSO, Joint.NECK, Joint.LEFT_SHOULDER, Joint.RIGHT_SHOULDER, Joint.LEFT_HIP, Joint.RIGHT_HIP]] = 0
    return joints_m * (1 + off_m / np.linalg.norm(joints_m, axis=-1, keepdims=True))


def test_errors_along_the_line_of_sight_cost_little_and_a_low_arm_what_it_costs(flat):
    teacher, guessed_m = performed(JOINTS_M), along_the_lines_of_sight(JOINTS_M, 0.08)
    assert score_dance(teacher, performed(guessed_m)).similarity < 75
    assert score_dance(teacher, performed(guessed_m), flat).similarity > 95
    low_m = arm_lowered(JOINTS_M, "left", 45)
    low, true = score_dance(teacher, performed(low_m), flat), score_dance(teacher, performed(low_m))
    assert low.similarity == pytest.approx(true.similarity, abs=6)
    assert low.parts["right arm"] > 95 and low.parts["left arm"] < 60
    guessed = score_dance(teacher, performed(along_the_lines_of_sight(low_m, 0.08)), flat)
    assert guessed.similarity == pytest.approx(low.similarity, abs=5)


def test_a_mirror_image_and_joints_about_the_hips_are_compared_in_the_same_way(flat):
    learner_m = along_the_lines_of_sight(arm_lowered(JOINTS_M, "left", 30), 0.05)
    whole = score_dance(performed(JOINTS_M), performed(learner_m), flat)
    image = score_dance(performed(JOINTS_M), performed(mirrored(learner_m)), replace(flat, mirrored="true"))
    assert image.similarity == pytest.approx(whole.similarity, abs=0.01)
    centred_m = learner_m - learner_m[:, [Joint.TORSO]]
    assert score_dance(performed(JOINTS_M), performed(centred_m), flat).similarity == pytest.approx(whole.similarity, abs=3)


def test_the_errors_that_a_learners_joints_have_are_known_unless_others_are_named():
    learner_m = along_the_lines_of_sight(JOINTS_M, 0.08)
    learner = Performance(learner_m, np.arange(len(JOINTS_M)) / FPS, estimator="webcam")
    found = score_dance(performed(JOINTS_M), learner)
    assert found.scorer.noise == "webcam" and found.uncertainty > 0
    assert found.similarity == score_dance(performed(JOINTS_M), learner, replace(OURS, noise="webcam")).similarity
    plain = score_dance(performed(JOINTS_M), learner, replace(OURS, noise="none"))
    assert plain.similarity < found.similarity and score_dance(performed(JOINTS_M), performed(learner_m)).uncertainty == 0
    assert score_dance(performed(JOINTS_M), learner, SCORERS["paper"]).scorer is SCORERS["paper"]


def test_by_webcam_a_delay_between_two_frames_is_known_as_well(monkeypatch):
    monkeypatch.setitem(NOISE, "flat", NOISE["none"]._replace(sees_depth=False))
    for delay_s in (0.111, 0.122):
        found = score_dance(performed(JOINTS_M), performed(JOINTS_M, delay_s), replace(OURS, noise="flat")).windows.delay_s
        assert np.median(found) == pytest.approx(delay_s, abs=0.004)
