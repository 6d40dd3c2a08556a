"""Random tree walks: walks through known trees, training, and the validation of a model's files."""

import numpy as np
import pytest
from capsule_people import CAMERA, CapsulePeople, draw_depth, draw_joints
from safetensors.numpy import load_file, save_file

from kpopnet.baselines.mean_pose import MeanPoseEstimator
from kpopnet.baselines.tree_walk.growing import draw_probes
from kpopnet.baselines.tree_walk.training import TreeWalkConfig, pixel_positions, train
from kpopnet.baselines.tree_walk.walking import (
    MAX_DIFFERENCE,
    META,
    TREES,
    UNMEASURED,
    Trees,
    TreeWalkEstimator,
    TreeWalkEstimatorConfig,
    TreeWalkModel,
    walk,
)  # fmt: skip
from kpopnet.data.batches import AugmentConfig
from kpopnet.data.cube import person_centre
from kpopnet.errors import InputError
from kpopnet.skeleton import BONES, NUM_JOINTS, Joint

SIDE = 32
SMALL = TreeWalkConfig(
    images=500,
    places=8,
    crop_px=48,
    features=30,
    leaf_samples=20,
    augment=AugmentConfig(mirror=0, rotation_deg=0, occluder=0),
    validation_images=100,
)


def person_image(seed=0, side=SIDE):
    rng = np.random.default_rng(seed)
    image = np.full((side, side), UNMEASURED)
    image[4:28, 10:22] = rng.integers(-3000, 3000, (24, 12))
    return image


def random_trees(seed=0, nodes=63, leaves=9, directions=3) -> Trees:
    """Random trees with arrays of the same shapes as trained ones."""
    rng = np.random.default_rng(seed)
    child = np.where(np.arange(nodes) < nodes // 2, 2 * np.arange(nodes) + 1, -1 - rng.integers(0, leaves, nodes))
    direction = rng.normal(size=(leaves, directions, 3))
    share = np.cumsum(rng.dirichlet(np.ones(directions), leaves), axis=1)
    share[:, -1] = 1
    return Trees(
        root=rng.integers(0, 7, NUM_JOINTS).astype(np.int32),
        child=child.astype(np.int32),
        threshold=rng.integers(-2000, 2000, nodes).astype(np.int32),
        probe=draw_probes(rng, nodes, 12),
        direction=(direction / np.linalg.norm(direction, axis=-1, keepdims=True)).astype(np.float32),
        share=share.astype(np.float32),
    )


def reference_depth_difference(image, row, column, depth):
    inside = 0 <= row < len(image) and 0 <= column < len(image)
    return int(np.clip(int(image[row, column]) - depth, -MAX_DIFFERENCE, MAX_DIFFERENCE)) if inside else MAX_DIFFERENCE


def reference_feature(image, row, column, depth, probe):
    r1, c1, r2, c2, pair = (int(value) for value in probe)
    first = reference_depth_difference(image, row + r1, column + c1, depth)
    return first - reference_depth_difference(image, row + r2, column + c2, depth) if pair else first


def reference_leaf(trees, joint, image, position):
    (row, column, depth), node = pixel_positions(np.array([position]), len(image))[0].tolist(), trees.root[joint]
    while trees.child[node] >= 0:
        large = reference_feature(image, row, column, depth, trees.probe[node]) >= trees.threshold[node]
        node = trees.child[node] + int(large)
    return -1 - trees.child[node]


def reference_uniform(key, count):
    """Splitmix64 as published, with Python integers."""
    mask = 2**64 - 1
    z = (key + (count + 1) * 0x9E3779B97F4A7C15) & mask
    z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & mask
    z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & mask
    return ((z ^ (z >> 31)) >> 11) / 2**53


def reference_walk(image, trees, steps, settling, step, key):
    mean = {}
    parents = {child: parent for parent, child in BONES}
    while len(mean) < NUM_JOINTS:
        for joint in Joint:
            if joint in mean or (joint != Joint.TORSO and parents[joint] not in mean):
                continue
            position = np.zeros(3) if joint == Joint.TORSO else mean[parents[joint]].astype(np.float64)
            visited = []
            for number in range(steps):
                leaf = reference_leaf(trees, joint, image, position)
                chosen = np.searchsorted(trees.share[leaf], reference_uniform(key, joint * steps + number), side="right")
                position = np.clip(position + step * trees.direction[leaf, chosen], -1, 1)
                visited.append(position)
            mean[joint] = np.array(visited[settling:]).mean(axis=0).astype(np.float32)
    return np.stack([mean[joint] for joint in Joint])


@pytest.mark.parametrize("seed", range(2))
def test_the_walk_equals_the_reference(seed):
    trees, image = random_trees(seed), person_image(seed)
    mean = walk(image, trees, 20, 5, 0.07, 40 + seed)
    np.testing.assert_allclose(mean, reference_walk(image, trees, 20, 5, 0.07, 40 + seed), atol=1e-5)
    assert not np.allclose(mean, walk(image, trees, 20, 5, 0.07, 50 + seed), atol=1e-3)


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    """The folder of a model trained on people made of balls, the model, and its metrics."""
    folder = tmp_path_factory.mktemp("tree_walk")
    model, metrics = train(SMALL, CapsulePeople(500), CapsulePeople(100, seed=1), seed=0, workers=0)
    model.save(folder, {"metrics": metrics})
    return folder, model, metrics


@pytest.fixture(scope="module")
def people():
    """60 people outside the training set, in one sequence: depth and joints."""
    joints_m = np.stack([draw_joints(np.random.default_rng([5, index])) for index in range(60)])
    return np.stack([draw_depth(joints) for joints in joints_m]), joints_m


def errors_m(estimate, joints_m):
    return np.linalg.norm(estimate.joints_camera_m - joints_m, axis=-1)


def test_a_model_of_few_images_beats_the_mean_pose(trained, people):
    folder, _, metrics = trained
    depth_m, joints_m = people
    centres_m = np.stack([person_centre(image, CAMERA) for image in depth_m])
    mean_pose = MeanPoseEstimator((joints_m - centres_m[:, None]).mean(axis=0))  # of the test people: the best constant pose
    estimator = TreeWalkEstimator(TreeWalkEstimatorConfig(str(folder)))
    walked_m = errors_m(estimator.estimate(depth_m, CAMERA), joints_m)
    constant_m = errors_m(mean_pose.estimate(depth_m, CAMERA), joints_m)
    assert walked_m.mean() < 0.9 * constant_m.mean(), (walked_m.mean(), constant_m.mean())
    assert walked_m.mean() == pytest.approx(metrics["mean_error_cm"] / 100, rel=0.5)
    # These people move mostly their arms.
    arms = [Joint.RIGHT_ELBOW, Joint.LEFT_ELBOW, Joint.RIGHT_HAND, Joint.LEFT_HAND]
    walked, constant = (float((errors[:, arms] < 0.1).mean()) for errors in (walked_m, constant_m))
    assert walked > constant + 0.3, (walked, constant)


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
    (tmp_path / META).write_text((trained[0] / META).read_text())
    arrays = {name: array.copy() for name, array in load_file(trained[0] / TREES).items()}
    change(arrays)
    save_file({name: np.ascontiguousarray(array) for name, array in arrays.items()}, tmp_path / TREES)
    with pytest.raises(InputError, match=message) as refused:
        TreeWalkModel.load(tmp_path)
    assert TREES in str(refused.value)
