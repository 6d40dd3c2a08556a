"""The angles of a pose: on simple poses, and whatever the camera, the size and small noise."""

import numpy as np
import pytest
from dance_learners import UPPER, turned_about
from dance_people import dance_joints_m, noisy, turned
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from kpopnet.dance.features import FEATURES, dance22_features, dance_features, raptis_features
from kpopnet.errors import InputError
from kpopnet.skeleton import Joint

JOINTS_M = dance_joints_m(0)[::7]
FPS = 30.0
FEATURED = "dance22", "dance22_turn", "raptis"
LIMBS = ("SHOULDER", "ELBOW", "HAND"), ("HIP", "KNEE", "FOOT")


def standing() -> np.ndarray:
    """(15, 3) an upright person who faces the camera, with arms and legs hanging straight."""
    joints_m = np.full((15, 3), (0.0, 0.0, 3.0))
    joints_m[[Joint.HEAD, Joint.NECK, Joint.TORSO], 1] = -0.7, -0.5, -0.25
    for limb, x, ys in ((("SHOULDER", "ELBOW", "HAND"), 0.2, (-0.5, -0.2, 0.1)), (("HIP", "KNEE", "FOOT"), 0.1, (0, 0.4, 0.8))):
        for joint, y in zip(limb, ys, strict=True):
            joints_m[[Joint[f"RIGHT_{joint}"], Joint[f"LEFT_{joint}"]], :2] = (-x, y), (x, y)
    return joints_m


def features_of(joints_m: np.ndarray, feature: str) -> dict[str, np.ndarray]:
    return dict(zip(FEATURES[feature].names, dance_features(joints_m, feature, FPS).angles_rad.T, strict=True))


def assert_same(a, b, tolerance=1e-6):
    """Asserts that wrapped and weighted angles are equal."""
    assert np.array_equal(np.isnan(a.angles_rad), np.isnan(b.angles_rad))
    difference = np.angle(np.exp(1j * np.nan_to_num(a.angles_rad - b.angles_rad)))
    assert np.abs(difference * np.nan_to_num(a.weights)).max() < tolerance
    np.testing.assert_allclose(a.weights, b.weights, atol=tolerance)


@pytest.mark.parametrize("feature", FEATURED)
def test_angles_of_an_upright_pose_are_zero_and_arms_to_the_front_and_to_the_side_differ_in_azimuth(feature):
    front, side = standing(), standing()
    front[Joint.LEFT_ELBOW] = front[Joint.LEFT_SHOULDER] + [0, 0, -0.3]
    side[Joint.LEFT_ELBOW] = side[Joint.LEFT_SHOULDER] + [0.3, 0, 0]
    result = features_of(np.array([standing(), front, side]), feature)
    for name in ("yaw", "pitch", "roll", "twist", "lean", "bend", "right_elbow_inclination", "left_knee_inclination"):
        np.testing.assert_allclose(result.get(name, np.zeros(1))[0], 0, atol=1e-6, err_msg=name)
    np.testing.assert_allclose(result["left_elbow_inclination"][1:], np.pi / 2, atol=1e-6)
    np.testing.assert_allclose(result["left_elbow_azimuth"][1:], [np.pi / 2, 0], atol=1e-6)


def test_a_bend_forwards_and_backwards_a_twist_left_and_right_differ_in_sign():
    for name, axis in (("twist", [0, 1, 0]), ("lean", [0, 0, 1]), ("bend", [1, 0, 0])):
        poses, angles_rad = np.array([standing(), standing()]), np.array([0.4, -0.4])
        poses = turned_about(poses, Joint.TORSO, UPPER, np.broadcast_to(axis, (2, 3)), angles_rad)
        np.testing.assert_allclose(features_of(poses, "dance22")[name], angles_rad, atol=1e-6)


def test_only_dance22_tells_a_forearm_up_from_down_with_the_upper_arm_sideways():
    poses = np.array([standing(), standing()])
    poses[:, Joint.RIGHT_ELBOW] = poses[:, Joint.RIGHT_SHOULDER] + [-0.3, 0, 0]
    poses[:, Joint.RIGHT_HAND] = poses[:, Joint.RIGHT_ELBOW] + [[0, -0.3, 0], [0, 0.3, 0]]
    for feature, is_different in (("dance22", True), ("raptis", False)):
        result = dance_features(poses, feature, FPS)
        column = FEATURES[feature].names.index("right_hand_azimuth")
        apart_rad = np.angle(np.exp(1j * np.diff(result.angles_rad[:, column])))
        assert (abs(apart_rad) * result.weights[:, column].min() > 1.5) == is_different


@settings(max_examples=25, deadline=None)
@given(
    st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda axis: np.linalg.norm(axis) > 0.1),
    st.floats(-3.1, 3.1), st.tuples(*[st.floats(-5, 5)] * 3), st.floats(0.5, 2),
)  # fmt: skip
def test_dance22_does_not_depend_on_the_camera_or_on_the_size(axis, angle, shift, size):
    there = turned(JOINTS_M * size, np.array(axis), angle) + np.array(shift)
    assert_same(dance_features(JOINTS_M, "dance22_turn", FPS), dance_features(there, "dance22_turn", FPS))


def test_what_has_no_direction_is_missing_and_nothing_else():
    joints_m = JOINTS_M.copy()
    joints_m[0] = 1.0  # the whole person in one point
    joints_m[1, Joint.LEFT_ELBOW] = joints_m[1, Joint.LEFT_SHOULDER]
    joints_m[5, Joint.LEFT_HAND] = np.nan
    for feature in FEATURED:
        names, angles_rad = FEATURES[feature].names, dance_features(joints_m, feature, FPS).angles_rad
        missing = [{names[column] for column in np.flatnonzero(np.isnan(frame))} for frame in angles_rad]
        assert missing[0] == set(names)
        assert "left_elbow_inclination" in missing[1] and "right_elbow_inclination" not in missing[1]
        assert missing[5] - missing[4] == {"left_hand_inclination", "left_hand_azimuth"} and missing[6] == missing[4]


def test_joints_that_no_angle_needs_lower_no_confidence():
    joints_m, confidence = JOINTS_M.copy(), np.ones(JOINTS_M.shape[:2])
    joints_m[:, [Joint.NECK, Joint.HEAD]], confidence[:, [Joint.NECK, Joint.HEAD]] = np.nan, 0
    for feature in ("dance22", "dance22_turn"):
        whole, without = dance_features(JOINTS_M, feature, FPS), dance_features(joints_m, feature, FPS, confidence)
        np.testing.assert_array_equal(without.angles_rad, whole.angles_rad)
        np.testing.assert_array_equal(without.confidence, whole.confidence)
    assert np.isnan(dance_features(joints_m, "raptis", FPS).angles_rad).all()  # [17]'s torso frame is made of the neck, too


@pytest.mark.parametrize(
    ("refused", "message"),
    [
        (lambda: dance_features(JOINTS_M, "dance", FPS), "feature=dance: expected one of dance22, dance22_turn, raptis"),
        (lambda: dance_features(JOINTS_M, "dance22_turn", 1), "fps=1: expected a number in 2..1000"),
        (lambda: dance_features(JOINTS_M, "dance22", "30"), "fps='30': expected a number"),
        (lambda: dance_features(JOINTS_M[..., :2], "dance22", FPS), r"joints of shape \(.*, 15, 2\): expected \(frames, "),
        (lambda: dance_features(np.ma.masked_array(JOINTS_M), "dance22", FPS), "joints: a masked array"),
        (lambda: dance_features(JOINTS_M, "raptis", FPS, np.ones(15)), r"confidence of shape \(15,\): expected one number"),
        (lambda: dance_features(JOINTS_M, "raptis", FPS, np.full(JOINTS_M.shape[:2], 90)), "from 90.0 to 90.0: .* 0 to 1"),
        (lambda: dance22_features(JOINTS_M[0]), r"joints of shape \(15, 3\): expected"),
        (lambda: raptis_features("joints.npz"), "joints: expected an array of numbers"),
    ],
)
def test_what_is_no_dance_has_no_features(refused, message):
    with pytest.raises(InputError, match=message):
        refused()


def test_a_turn_of_the_whole_body_changes_only_the_heading():
    still = np.repeat(standing()[None], 60, axis=0)
    spinning = turned(still, [0, 1, 0], np.linspace(0, 2, 60))
    still_result, spinning_result = (dance_features(j, "dance22_turn", FPS) for j in (still, spinning))
    difference = np.abs(spinning_result.angles_rad - still_result.angles_rad)[20:]
    assert (difference * still_result.weights[20:])[:, :22].max() < 1e-6
    np.testing.assert_allclose(difference[:, 22], 2 / 59 * 15, atol=1e-6)


def test_small_noise_makes_small_differences():
    """Torso frames do not flip, and azimuths near their axis have no weight."""
    for feature in FEATURED:
        a, b = dance_features(JOINTS_M, feature, FPS), dance_features(noisy(JOINTS_M, 0.002), feature, FPS)
        difference = np.abs(np.angle(np.exp(1j * (a.angles_rad - b.angles_rad)))) * np.minimum(a.weights, b.weights)
        assert np.nanmax(difference) < 0.15


def test_limbs_have_the_angles_that_rotations_give_one_by_one():
    """Lower limbs are turned back by the smallest rotation that brings the upper limb to a direction that all limbs reach."""
    starts = {"ELBOW": ([0.3, -1, 1], [0.3, 1, 1]), "KNEE": ([1, 0, 1], [1, 0, 1])}
    found = dance_features(JOINTS_M, "dance22", FPS)
    angles = {name: (found.angles_rad[:, k], found.weights[:, k]) for k, name in enumerate(FEATURES["dance22"].names)}
    for frame, pose_m in enumerate(JOINTS_M):
        at = {joint.name: pose_m[joint] for joint in Joint}
        for begin, middle, end in LIMBS:
            r = at[f"LEFT_{begin}"] - at[f"RIGHT_{begin}"]
            down = (at["TORSO"] - (at[f"LEFT_{begin}"] + at[f"RIGHT_{begin}"]) / 2) * (1 if begin == "SHOULDER" else -1)
            t = np.cross(down, r)
            axes = np.array([one / np.linalg.norm(one) for one in (np.cross(r, t), r, t)])
            for side, start in zip(("RIGHT", "LEFT"), starts[middle], strict=True):
                start = np.array(start) / np.linalg.norm(start)
                joints_m = [at[f"{side}_{name}"] for name in (begin, middle, end)]
                parent, child = (axes @ (one / np.linalg.norm(one)) for one in np.diff(joints_m, axis=0))
                axis, angle = np.cross(parent, start), np.arccos(parent @ start)
                back = Rotation.from_rotvec(angle * axis / np.linalg.norm(axis)).apply(child)
                r_across = np.array([0, 1, 0]) - start[1] * start
                r_across /= np.linalg.norm(r_across)
                local = np.array([start, r_across, np.cross(start, r_across)]) @ back
                for joint, (x, y, z) in ((middle, parent), (end, local)):
                    name = f"{side}_{joint}".lower()
                    assert angles[f"{name}_inclination"][0][frame] == pytest.approx(np.arccos(x), abs=1e-6)
                    azimuth, weight = (array[frame] for array in angles[f"{name}_azimuth"])
                    assert weight * np.exp(1j * azimuth) == pytest.approx(weight * np.exp(1j * np.arctan2(z, y)), abs=1e-6)


def test_the_angles_of_17_are_those_of_its_definition():
    """A slow twin: the torso's principal axes, and each bone's inclination and azimuth to u and r, or to its parent."""
    joints_m = JOINTS_M + np.random.default_rng(0).normal(0, 0.01, JOINTS_M.shape)
    angles_rad = dance_features(joints_m, "raptis", FPS).angles_rad
    torso = [Joint.NECK, Joint.RIGHT_SHOULDER, Joint.LEFT_SHOULDER, Joint.TORSO, Joint.RIGHT_HIP, Joint.LEFT_HIP]
    for pose_m, found in zip(joints_m, angles_rad, strict=True):
        u, r, _ = np.linalg.svd(pose_m[torso] - pose_m[torso].mean(axis=0))[2]
        u = u * np.sign(u @ (pose_m[[Joint.RIGHT_HIP, Joint.LEFT_HIP]].mean(axis=0) - pose_m[Joint.NECK]))
        r = r * np.sign(r @ (pose_m[Joint.LEFT_SHOULDER] - pose_m[Joint.RIGHT_SHOULDER]))
        t = np.cross(u, r)
        first, second = [], []
        for part, side in ((0, "RIGHT"), (0, "LEFT"), (1, "RIGHT"), (1, "LEFT")):
            root, middle, end = (pose_m[Joint[f"{side}_{name}"]] for name in LIMBS[part])
            upper, lower = (one / np.linalg.norm(one) for one in (middle - root, end - middle))
            first += [np.arccos(upper @ u), np.arctan2(upper @ t, upper @ r)]
            reference = r - (r @ upper) * upper
            second += [np.arccos(lower @ upper), np.arctan2(np.cross(reference, lower) @ upper, reference @ lower)]
        expected = np.array([np.arctan2(t[0], -t[2]), np.arcsin(t[1]), np.arctan2(r[1], u[1]), *first, *second])
        assert np.abs(np.angle(np.exp(1j * (found - expected)))).max() < 1e-9
