"""Prints the trackers' constants that depend on the simulated people, measured on people of training (split train).

    PYTHONPATH=.:tests/helpers python tools/tracker_constants.py y_pose
    PYTHONPATH=.:tests/helpers python tools/tracker_constants.py standing
    PYTHONPATH=.:tests/helpers python tools/tracker_constants.py tips

`y_pose`: HAND_RADIUS_M, FOOT_RADIUS_M and the fractions of `kpopnet.y_pose.initial_pose`, and _REGULARISATION of
`kpopnet.geometry.human_model` with the former as they are. `standing`: constants of `kpopnet.tracker.start`. `tips`:
FINGERS_M of `kpopnet.geometry.cones`, where RADII_M are as they are, and END_TO_TIP_M of `kpopnet.tracker.limbs`. The
radii and trunk points are printed by `tools/body_shape.py`, the weights of the confidence by
`tools/fit_confidence.py`.
"""

import argparse
from collections.abc import Iterator
from dataclasses import asdict

import numpy as np
from scipy.optimize import nnls
from y_people import family, simulated, y_angles

import kpopnet.y_pose.initial_pose as y_pose
from kpopnet.camera import Camera
from kpopnet.geometry.body import LIMBS, RADII_M, RIGHT_FINGERS, body_from_model
from kpopnet.geometry.cones import body_segments
from kpopnet.geometry.depth_grid import UNREACHABLE_M, build_depth_grid, farthest_points, geodesic_distances
from kpopnet.geometry.human_model import _REGULARISATION, HumanModel
from kpopnet.skeleton import Joint
from kpopnet.tracker.limbs import END_RADIUS_M, move_inside, torso_points
from synth.motion.limbs import upright
from synth.motion.poses import FAMILIES, Angles

SEED = 100
"""None of a test, a benchmark or a training."""

HAND_REACH_M = 0.16
"""Points within this distance of the hand joint may be its own, in metres."""

LEVEL_DEG = 10.0
"""A camera counts as level if the spine of who stands before it leans by at most this many degrees in the image."""

Seen = tuple[np.ndarray, Camera, np.ndarray]


def print_y_pose(people: list[Seen]) -> None:
    """Where hands, feet, elbows and knees lie along the limbs found in the image, and how found lengths relate to true ones."""
    found = [(y_pose.find_initial_pose(depth_m, camera), camera, joints_m) for depth_m, camera, joints_m in people]
    accepted = [(pose, camera, joints_m) for pose, camera, joints_m in found if pose is not None]
    error_m = np.array([np.linalg.norm(pose - joints_m, axis=1) for pose, _, joints_m in accepted])
    print(f"{len(accepted)} of {len(people)} people accepted, mean error {100 * error_m.mean():.2f} cm; by joint:")
    print("   ", ", ".join(f"{joint.name.lower()} {100 * error_m[:, joint].mean():.1f}" for joint in Joint))
    for name, limbs in (("UPPER_ARM_FRACTION", LIMBS[:2]), ("UPPER_LEG_FRACTION", LIMBS[2:])):
        fractions = [_fraction(camera.project(joints_m)[limb, :2]) for _, camera, joints_m in people for limb in limbs]
        print(f"{name} = {np.mean(fractions):.3f}, standard deviation {np.std(fractions):.3f}")
    _print_end_radii([person for person, (pose, *_) in zip(people, found, strict=True) if pose is not None])
    models = [[HumanModel.from_joints(joints_m) for joints_m in (pose, true_m)] for pose, _, true_m in accepted]
    _print_regularisation(*map(list, zip(*models, strict=True)))


def _fraction(limb_uv: np.ndarray) -> float:
    """Position of a limb's middle along the line from its root (0) to its end (1), from (3, 2) pixels."""
    root, middle, end = limb_uv
    return (middle - root) @ (end - root) / ((end - root) @ (end - root))


def _print_end_radii(people: list[Seen]) -> None:
    """Mean distance of hands and feet from the true ones in the image, by the radius of their mean."""
    shipped = y_pose.HAND_RADIUS_M, y_pose.FOOT_RADIUS_M
    for radius_m in np.arange(0.09, 0.25, 0.02):
        y_pose.HAND_RADIUS_M = y_pose.FOOT_RADIUS_M = radius_m
        errors = []
        for depth_m, camera, joints_m in people:
            pose = y_pose.find_initial_pose(depth_m, camera)
            if pose is not None:
                errors.append([_along_m(pose, joints_m, limb) for limb in LIMBS])
        along_m = np.array(errors)
        hands, feet = along_m[:, :2], along_m[:, 2:]
        print(
            f"radius {radius_m:.2f} m, found beyond the true joint, cm: hands {100 * hands.mean():.1f} (mean distance "
            f"{100 * np.abs(hands).mean():.1f}), feet {100 * feet.mean():.1f} ({100 * np.abs(feet).mean():.1f})"
        )
    y_pose.HAND_RADIUS_M, y_pose.FOOT_RADIUS_M = shipped


def _along_m(found_m: np.ndarray, joints_m: np.ndarray, limb: np.ndarray) -> float:
    """How far the found end of a limb lies beyond the true one along the true lower limb, metres."""
    lower = joints_m[limb[2]] - joints_m[limb[1]]
    return (found_m[limb[2]] - joints_m[limb[2]]) @ lower / np.linalg.norm(lower)


def _print_regularisation(measured: list[HumanModel], true: list[HumanModel]) -> None:
    """_REGULARISATION by non-negative least squares, and the standard deviation of the lengths' errors before and after."""

    def lengths_m(models: list[HumanModel]) -> np.ndarray:
        return np.array([[np.mean([getattr(model, name) for name in names]) for names in _REGULARISATION] for model in models])

    found_m, true_m = lengths_m(measured), lengths_m(true)
    size_m = found_m.sum(axis=1)
    for k, names in enumerate(_REGULARISATION):
        weights, _ = nnls(np.stack([found_m[:, k], size_m], axis=1), true_m[:, k])
        fitted_m = found_m[:, k] * weights[0] + size_m * weights[1]
        shipped_m = np.stack([found_m[:, k], size_m], axis=1) @ _REGULARISATION[names]
        errors = (np.sqrt(((lengths - true_m[:, k]) ** 2).mean()) * 100 for lengths in (found_m[:, k], shipped_m, fitted_m))
        quoted = ", ".join(f'"{name}"' for name in names) + ("," if len(names) == 1 else "")
        print(f"    ({quoted}): ({weights[0]:.3f}, {weights[1]:.3f}),  # " + ", ".join(f"{error:.1f}" for error in errors))


def print_standing(people: list[Seen]) -> None:
    """Means of people with hanging arms before a level camera: the model, its silhouette's height, top and median point."""
    models, heights_m, heads, offsets_m = [], [], [], []
    for depth_m, camera, joints_m in people:
        spine = joints_m[Joint.NECK] - joints_m[[Joint.RIGHT_HIP, Joint.LEFT_HIP]].mean(axis=0)
        if -spine[1] / np.linalg.norm(spine) < np.cos(np.radians(LEVEL_DEG)):
            continue
        points_m = camera.points(depth_m)[depth_m > 0]
        top, bottom = np.percentile(points_m[:, 1], (0.1, 99.9))
        models.append(asdict(HumanModel.from_joints(joints_m)))
        heights_m.append(bottom - top)
        heads.append((joints_m[Joint.HEAD, 1] - top) / (bottom - top))
        offsets_m.append(joints_m[:, 2].mean() - np.median(points_m[:, 2]))
    for name in models[0]:
        print(f"    {name}={np.mean([model[name] for model in models]):.3f}")
    print(f"{len(models)} people; AVERAGE_HEIGHT_M = {np.mean(heights_m):.3f}, standard deviation {np.std(heights_m):.3f}")
    print(f"HEAD_BELOW_TOP = {np.mean(heads):.3f}, JOINT_DEPTH_OFFSET_M = {np.mean(offsets_m):.3f}")


def print_tips(people: list[Seen]) -> None:
    """How far visible hands reach beyond the joint, and where on the way from tips to the torso hands and feet lie."""
    reaches_m, ways = [], {"hands": [], "feet": []}
    for depth_m, camera, joints_m in people:
        surface_m = camera.points(depth_m)[depth_m > 0]
        for _, elbow, hand in LIMBS[:2]:
            forearm = (joints_m[hand] - joints_m[elbow]) / np.linalg.norm(joints_m[hand] - joints_m[elbow])
            offset_m = surface_m - joints_m[hand]
            along_m = offset_m @ forearm
            own = (np.linalg.norm(offset_m, axis=1) < HAND_REACH_M) & (
                np.linalg.norm(offset_m - along_m[:, None] * forearm, axis=1) < HAND_REACH_M / 2
            )
            if own.any() and along_m[own].min() < 0:
                reaches_m.append(along_m[own].max())
        for limb, way in _ways(depth_m, camera, joints_m):
            ways["hands" if limb < 2 else "feet"].append(way)
    radius_m = RADII_M[Joint.RIGHT_HAND, RIGHT_FINGERS][1]
    print(
        f"{len(reaches_m)} hands reach {np.mean(reaches_m):.3f} m beyond the joint (standard deviation {np.std(reaches_m):.3f})"
    )
    print(f"FINGERS_M = {np.mean(reaches_m) - radius_m:.3f} with a radius of {radius_m} m at the fingertips")
    for name, found in ways.items():
        print(f"END_TO_TIP_M of {len(found)} {name}: mean {np.mean(found):.3f}, median {np.median(found):.3f}")


def _ways(depth_m: np.ndarray, camera: Camera, joints_m: np.ndarray) -> Iterator[tuple[int, float]]:
    """For each limb with a tip within 25 cm of its end: the way in metres from the tip to where the end is nearest."""
    grid, body = build_depth_grid(depth_m, camera), body_from_model(HumanModel.from_joints(joints_m))
    source = torso_points(body_segments(joints_m, body), grid.points_m)
    geodesic, predecessor = geodesic_distances(grid.neighbours, grid.edge_lengths_m, source, UNREACHABLE_M)
    tips = farthest_points(grid.points_m, grid.neighbours, grid.edge_lengths_m, geodesic)
    for limb, (_, _, end) in enumerate(LIMBS):
        away_m = np.linalg.norm(grid.points_m[tips] - joints_m[end], axis=1)
        if not len(tips) or away_m.min() > 0.25:
            continue
        point, travelled_m, best = tips[np.argmin(away_m)], 0.0, (np.inf, 0.0)
        inside = np.empty(3)
        while point >= 0 and travelled_m < 0.3:
            move_inside(grid.points_m, point, END_RADIUS_M, inside)
            best = min(best, (float(np.linalg.norm(inside - joints_m[end])), travelled_m))
            following = predecessor[point]
            if following >= 0:
                travelled_m += float(np.linalg.norm(grid.points_m[following] - grid.points_m[point]))
            point = following
        yield limb, best[1]


def everything(generator: np.random.Generator) -> Angles:
    """A pose of any upright family of the training poses."""
    names = [name for name in FAMILIES if name not in ("handstand", "lie", "all_fours")]
    weights = np.array([FAMILIES[name][0] for name in names])
    return FAMILIES[names[int(np.searchsorted(np.cumsum(weights / weights.sum()), generator.random()))]][1](generator)


PARTS = {
    "y_pose": (print_y_pose, y_angles, 450),
    "standing": (print_standing, upright, 1500),  # with hanging arms, as `kpopnet.tracker.start` assumes
    "tips": (print_tips, everything, 600),
}

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("constants", choices=PARTS)
    report, angles, count = PARTS[parser.parse_args().constants]
    report(list(simulated(family(angles), count, "train", SEED)))
