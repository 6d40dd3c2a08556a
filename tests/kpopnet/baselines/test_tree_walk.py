"""Random tree walks: training, their accuracy, and the validation of a model's files."""

import numpy as np
import pytest
from capsule_people import CAMERA, CapsulePeople, draw_depth, draw_joints
from omegaconf import OmegaConf
from safetensors.numpy import load_file, save_file

from kpopnet.baselines.mean_pose import MeanPoseEstimator
from kpopnet.baselines.tree_walk import training
from kpopnet.baselines.tree_walk.walking import META, TREES, TreeWalkEstimator, TreeWalkEstimatorConfig, TreeWalkModel
from kpopnet.data.batches import AugmentConfig
from kpopnet.data.cube import person_centre
from kpopnet.errors import InputError
from kpopnet.programs.train import TreeWalkTrainingConfig
from kpopnet.skeleton import Joint

SMALL = training.TreeWalkConfig(500, places=8, crop_px=48, features=30, leaf_samples=20)


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    """The folder of a model trained on few people made of balls, as they are."""
    folder = tmp_path_factory.mktemp("tree_walk")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(training, "AUGMENT", AugmentConfig(mirror=0, rotation_deg=0, occluder=0))
        training.train(SMALL, CapsulePeople(500), seed=0, workers=0).save(folder, {})
    return folder


@pytest.fixture(scope="module")
def people():
    """60 people outside the training set, in one sequence: depth and joints."""
    joints_m = np.stack([draw_joints(np.random.default_rng([5, index])) for index in range(60)])
    return np.stack([draw_depth(joints) for joints in joints_m]), joints_m


def errors_m(estimate, joints_m):
    return np.linalg.norm(estimate.joints_camera_m - joints_m, axis=-1)


def test_a_model_of_few_images_beats_the_mean_pose(trained, people):
    depth_m, joints_m = people
    centres_m = np.stack([person_centre(image, CAMERA) for image in depth_m])
    mean_pose = MeanPoseEstimator((joints_m - centres_m[:, None]).mean(axis=0))  # of the test people: the best constant pose
    estimator = TreeWalkEstimator(TreeWalkEstimatorConfig(str(trained)))
    walked_m = errors_m(estimator.estimate(depth_m, CAMERA), joints_m)
    constant = mean_pose.estimate(depth_m, CAMERA)
    np.testing.assert_allclose((constant.joints_camera_m - joints_m).mean(axis=0), 0, atol=1e-5)
    constant_m = errors_m(constant, joints_m)
    assert walked_m.mean() < 0.7 * constant_m.mean(), (walked_m.mean(), constant_m.mean())
    # These people move mostly their arms.
    arms = [Joint.RIGHT_ELBOW, Joint.LEFT_ELBOW, Joint.RIGHT_HAND, Joint.LEFT_HAND]
    walked, constant = (float((errors[:, arms] < 0.1).mean()) for errors in (walked_m, constant_m))
    assert walked > constant + 0.7, (walked, constant)


def rewrite(name, value, index=-1):
    def change(arrays):
        arrays[name].flat[index] = value

    return change


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (rewrite("child", 0, index=0), "after their parent"),
        (rewrite("direction", np.nan), "finite"),
        (lambda arrays: arrays.pop("probe"), "probe"),
    ],
)
def test_damaged_trees_are_refused(trained, tmp_path, change, message):
    (tmp_path / META).write_text((trained / META).read_text())
    arrays = {name: array.copy() for name, array in load_file(trained / TREES).items()}
    change(arrays)
    save_file({name: np.ascontiguousarray(array) for name, array in arrays.items()}, tmp_path / TREES)
    with pytest.raises(InputError, match=message) as refused:
        TreeWalkModel.load(tmp_path)
    assert TREES in str(refused.value)


def test_what_is_no_path_of_a_model_or_no_mean_pose_is_refused():
    with pytest.raises(InputError, match="expected the path of a file or folder, got 3"):
        TreeWalkModel.load(3)
    for wrong in (None, "mean", np.zeros((14, 3)), np.full((15, 3), np.nan)):
        with pytest.raises(InputError, match="mean pose: expected"):
            MeanPoseEstimator(wrong)


@pytest.mark.parametrize("wrong", ["tree_walk.crop_px=100", "tree_walk.places=0"])
def test_a_refused_setting_has_the_name_that_a_user_types(wrong):
    config = OmegaConf.structured(TreeWalkTrainingConfig)
    config.merge_with_dotlist([wrong])
    with pytest.raises(InputError) as refused:
        OmegaConf.to_object(config)
    assert str(refused.value).partition(":")[0].removesuffix(".0") == wrong
