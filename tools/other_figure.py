"""A figure that is not of Anny's family, from dm_control (Apache-2.0): writes its file, and scores our estimators on it.

    pip download --no-deps dm_control==1.0.50
    PYTHONPATH=.:tests/helpers python tools/other_figure.py bake dm_control-1.0.50-py3-none-any.whl
    PYTHONPATH=.:tests/helpers python tools/other_figure.py score results/other_body.json

dm_control's humanoid has the proportions and joints of a skeleton of CMU's motion capture, limbs of capsules, and for its
football players a skinned jersey with shorts. `tests/assets/other_body.npz` holds it in the T-pose of `synth.motion.skeleton`,
metres, the root at the origin, with the fifteen joints at the points of the body that `tools/bake_body.py` labels.
"""

import argparse
import zipfile
from pathlib import Path

import mujoco
import numpy as np
from other_body import ASSET, FPS, dancing, still
from tqdm import tqdm

from kpopnet.estimator import Estimator
from kpopnet.networks.estimator import NetworkEstimator
from kpopnet.pose.person import PersonEstimator
from kpopnet.runtime.atomic_write import write_json
from kpopnet.runtime.provenance import measured_by
from kpopnet.skeleton import JOINT_GROUPS, Joint
from kpopnet.tracker.estimator import TrackerEstimator

FOLDER = "dm_control/locomotion"
HUMANOID, JERSEY = f"{FOLDER}/walkers/assets/humanoid_CMU_V2020.xml", f"{FOLDER}/soccer/assets/humanoid/jersey.skn"
WEIGHTS_PER_VERTEX = 6

MOTION_BONES = {
    "root": "Hips", "lhipjoint": "Hips", "rhipjoint": "Hips", "lowerback": "LowerBack", "upperback": "Spine",
    "thorax": "Spine1", "lowerneck": "Neck", "upperneck": "Neck1", "head": "Head",
}  # fmt: skip
SIDES = {"l": "Left", "r": "Right"}
MOTION_LIMBS = {
    "femur": "UpLeg", "tibia": "Leg", "foot": "Foot", "toes": "ToeBase", "clavicle": "Shoulder", "humerus": "Arm",
    "radius": "ForeArm", "wrist": "Hand", "hand": "Hand", "fingers": "Hand", "thumb": "Hand",
}  # fmt: skip
"""The motions' bone that turns a bone of the figure."""

NECK_M = (0.0, 0.467, -0.003)
"""The base of the neck. In Anny's mean adult it lies where the shoulders have narrowed to 8 cm on either side, 1.6 times the
bare neck, and 1.5 cm below the chin; in the figure this is the jersey's collar, 2 cm below the chin."""

SEEDS, STILLS, FILMS, FRAMES = (2411, 2412), 150, 4, 150
"""Seeds of the scored dances, and of each: single images, films, and frames of a film."""


def bake(wheel: Path) -> dict[str, np.ndarray]:
    """Bones, solids, jersey and joints in the T-pose, by name."""
    with zipfile.ZipFile(wheel) as packed:
        xml, skin = packed.read(HUMANOID).decode(), packed.read(JERSEY)
    xml = xml.replace("</asset>", '<skin name="jersey" file="jersey.skn"/></asset>', 1)
    model = mujoco.MjModel.from_xml_string(xml, {"jersey.skn": skin})
    pose, drawn = mujoco.MjData(model), mujoco.MjvScene(model, maxgeom=100)
    for side in SIDES:  # closes the legs, which the model holds apart
        cos, _, _, sin = model.body(f"{side}femur").quat
        pose.joint(f"{side}femurrz").qpos = -2 * np.arctan2(sin, cos)
    mujoco.mj_kinematics(model, pose)
    everything = mujoco.mjtCatBit.mjCAT_ALL
    mujoco.mjv_updateScene(model, pose, mujoco.MjvOption(), None, mujoco.MjvCamera(), everything, drawn)

    seamless, of_vertex = np.unique(model.skin_vert, axis=0, return_inverse=True)  # the texture's seams double vertices
    weights, points_m = np.zeros((len(seamless), model.nbody), np.float32), np.empty_like(seamless)
    points_m[of_vertex.ravel()] = drawn.skinvert.reshape(-1, 3)
    for bone, start, count in zip(model.skin_bonebodyid, model.skin_bonevertadr, model.skin_bonevertnum, strict=True):
        held = slice(start, start + count)
        weights[of_vertex.ravel()[model.skin_bonevertid[held]], bone - 1] = model.skin_bonevertweight[held]
    order = np.argsort(-weights, axis=1)[:, :WEIGHTS_PER_VERTEX]
    kept = np.take_along_axis(weights, order, axis=1)
    assert np.abs(weights.sum(axis=1) - kept.sum(axis=1)).max() < 0.02

    names = [model.body(bone).name for bone in range(1, model.nbody)]
    at = dict(zip(names, pose.xpos[1:], strict=True))
    labels = joints(at, pose.geom("head").xpos)
    return {
        "motion_bones": np.array([MOTION_BONES.get(name) or f"{SIDES[name[0]]}{MOTION_LIMBS[name[1:]]}" for name in names]),
        "parents": (model.body_parentid[1:] - 1).astype(np.int8),
        "heads_m": pose.xpos[1:].astype(np.float32),
        "joint_bones": np.array([names.index(labels[joint][0]) for joint in Joint], np.int8),
        "joints_m": np.array([labels[joint][1] for joint in Joint], np.float32),
        "solid_bones": (model.geom_bodyid - 1).astype(np.int8),
        "solid_sizes_m": model.geom_size.astype(np.float32),  # radius and half length of a capsule; radius; three radii
        "solid_centres_m": pose.geom_xpos.astype(np.float32),
        "solid_axes": pose.geom_xmat.reshape(-1, 3, 3).astype(np.float32),
        "jersey_m": points_m,
        "jersey_faces": of_vertex.ravel()[model.skin_face].astype(np.uint16),
        "jersey_bones": order.astype(np.uint8),
        "jersey_weights": np.rint(255 * kept / kept.sum(axis=1, keepdims=True)).astype(np.uint8),
    }


def joints(at: dict[str, np.ndarray], head_m: np.ndarray) -> dict[Joint, tuple[str, np.ndarray]]:
    """The bone that each joint moves with, and its place, from the places where bones turn and the middle of the head.

    The torso is the mean of shoulders and hips; a hand lies half-way from the wrist to the fingers, a foot half-way from the
    ankle to the toes. The other joints are where bones turn.
    """
    corners = [at[name] for name in ("lhumerus", "rhumerus", "lfemur", "rfemur")]
    found = {
        Joint.HEAD: ("head", head_m),
        Joint.NECK: ("thorax", np.array(NECK_M)),
        Joint.TORSO: ("upperback", np.mean(corners, axis=0)),
    }
    for s, side in SIDES.items():
        for joint, bone in {"SHOULDER": "humerus", "ELBOW": "radius", "HIP": "femur", "KNEE": "tibia"}.items():
            found[Joint[f"{side.upper()}_{joint}"]] = s + bone, at[s + bone]
        for joint, bone, end in (("HAND", "hand", "fingers"), ("FOOT", "foot", "toes")):
            found[Joint[f"{side.upper()}_{joint}"]] = s + bone, (at[s + bone] + at[s + end]) / 2
    return found


def score() -> dict:
    """The figures of single images and films of the dances of SEEDS."""
    network = NetworkEstimator()
    people = {name: PersonEstimator(network, name, FPS) for name in ("realtime", "best")}
    whole = {"network": network, **people, "tracker": TrackerEstimator()}
    stills = [still(seed, index) for seed in SEEDS for index in range(STILLS)]
    films = [dancing(seed, index, FRAMES) for seed in SEEDS for index in range(FILMS)]
    return {
        "what": "SIMULATED: dm_control's humanoid in a jersey, Kinect v1, 2 to 4 m; `se`: standard error over images or films",
        "seeds": SEEDS,
        "single_images": {"images": len(stills), "network": figures(network, stills)},
        "films": {"films": len(films), "frames": FRAMES, **{name: figures(one, films) for name, one in whole.items()}},
    } | measured_by()


def figures(estimator: Estimator, films: list) -> dict:
    """By joint group: percent of joints within 10 cm, mean error in cm of joints that were found, and percent missing."""
    found = []
    for film in tqdm(films, estimator.name):
        joints_m = estimator.estimate(film.depth_m, film.camera).joints_camera_m
        found.append(np.linalg.norm(joints_m - film.joints_camera_m, axis=-1))
    errors_m = np.array(found)  # (films, frames, 15)
    table = {}
    for group, members in {"all": tuple(Joint), **JOINT_GROUPS}.items():
        of_group = errors_m[..., list(members)]
        within, error_cm = 100 * (of_group < 0.1).mean(axis=(1, 2)), 100 * np.nanmean(of_group, axis=(1, 2))
        table[group] = {
            "within_10cm": round(float(within.mean()), 1),
            "within_10cm_se": round(float(within.std(ddof=1) / np.sqrt(len(films))), 1),
            "mean_error_cm": round(float(error_cm.mean()), 2),
            "mean_error_cm_se": round(float(error_cm.std(ddof=1) / np.sqrt(len(films))), 2),
            "missing": round(float(100 * np.isnan(of_group).mean()), 1),
        }
    return table


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("task", choices=("bake", "score"), help="write the figure's file, or score estimators on it")
    parser.add_argument("file", type=Path, help="bake: dm_control's wheel; score: the JSON file to write")
    arguments = parser.parse_args()
    if arguments.task == "bake":
        np.savez_compressed(ASSET, **bake(arguments.file))
        print(f"{ASSET}: {ASSET.stat().st_size / 1000:.0f} kB")
    else:
        write_json(arguments.file, score())
