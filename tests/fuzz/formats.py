"""A small valid example of every file format that is read, and how a program reads it whole."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from capsule_people import CapsulePeople
from cone_people import cone_body, cone_joints, draw_cones
from depth_files import CAMERA as DEPTH_CAMERA
from depth_files import depth_mm, write_hdf5, write_npz, write_pngs, write_video
from exported_networks import export
from factories import write_shard
from recorded_points import FRAMES, coco, person
from y_people import y_joints

from kpopnet.baselines.tree_walk.estimator import TreeWalkEstimator, TreeWalkEstimatorConfig
from kpopnet.baselines.tree_walk.growing import GrowthConfig
from kpopnet.baselines.tree_walk.training import TreeWalkConfig
from kpopnet.baselines.tree_walk.training import train as train_tree_walk
from kpopnet.camera import CAMERAS, Camera
from kpopnet.dance.joint_files.joint_sets import IMPERIAL, IMPERIAL_POINTS, imperial_joints_m
from kpopnet.dance.joint_files.named_points import COCO_NAMES
from kpopnet.dance.joint_files.reader import read_performance
from kpopnet.dance.performance import Performance
from kpopnet.data.shards import ShardedSet
from kpopnet.datasets.dances.converters import read_imperial
from kpopnet.datasets.dances.dance_set import KpopConfig, open_set
from kpopnet.datasets.dances.writer import PackedDepth, write_labels, write_learner, write_teacher
from kpopnet.datasets.synthetic import SyntheticBenchmark, SyntheticConfig
from kpopnet.geometry.human_model import HumanModel
from kpopnet.networks import ModelConfig
from kpopnet.networks.checkpoint import load_network, load_state, save_checkpoint
from kpopnet.networks.estimator import NetworkEstimator
from kpopnet.networks.network import build_network
from kpopnet.programs.stages import stages_of
from kpopnet.sources import open_depth
from kpopnet.teacher.bvh import as_bvh
from kpopnet.teacher.library import Library, TeacherBody, preview_cm, taught_dance
from kpopnet.teacher.posing import posed
from synth.dances.taught import teacher_arrays
from synth.motion import MotionConfig, build_motion
from synth.motion.choreography.composer import dance
from synth.motion.skeleton import REST_OFFSETS_M
from synth.samples.observe import ExtractionConfig, Observer
from synth.sensor.model import SensorConfig

SMALL = Camera.centred(60.0, 48, 40)
MODEL = ModelConfig(crop_px=32, widths=[8, 8, 8, 8])


class Format(NamedTuple):
    """A file format.

    Attributes:
        make: writes a valid example into an empty folder.
        files: patterns of the files to mutate, below the folder.
        read: reads the example as a program does; raises InputError where it is invalid.
    """

    make: Callable[[Path], object]
    files: tuple[str, ...]
    read: Callable[[Path], object]


def joints(frames: int) -> np.ndarray:
    """(frames, 15, 3) metres of a person whose arms move."""
    return np.stack([y_joints(20 + 2 * frame) for frame in range(frames)]).astype(np.float32)


def make_shard(folder: Path, kind: str) -> None:
    write_shard(folder, count=3, camera=SMALL, kind=kind)


def read_shards(folder: Path) -> None:
    shards = ShardedSet(folder)
    observer = Observer(shards, SensorConfig(), ExtractionConfig(), 0)
    for index in range(min(len(shards), 8)):
        observer.observe(index, 0)
    shards.column("joints_m")


def read_frozen(folder: Path) -> None:
    benchmark = SyntheticBenchmark(SyntheticConfig(path=str(folder)))
    for name in benchmark.sequence_names():
        benchmark.read(name)


def make_dances(folder: Path) -> None:
    place, times_s = folder / "mama", np.arange(20) / 20.0
    packed = PackedDepth(SMALL)
    for frame in range(20):
        image = np.zeros((SMALL.height, SMALL.width), np.float32)
        image[5:30, 10 + frame : 20 + frame] = 2.5
        packed.add(image)
    write_teacher(place, Performance(joints(20), times_s))
    write_learner(place, "ann", times_s, joints(20), packed, {"level": "best"})
    write_learner(place, "jin", times_s, joints(20))
    write_labels(place, ["ann", "jin"])
    (folder / "manifest.json").write_text(json.dumps({"name": "mine", "simulated": True, "about": "a test", "dances": 1}))


def read_dances(folder: Path) -> None:
    dances = open_set(KpopConfig(path=str(folder)))
    for name in dances.names:
        one = dances.dance(name)
        one.teacher()
        for learner in one.learners:
            _ = learner.about, learner.depth_key, learner.times_s(), learner.joints()
        one.learners[0].depth()


def make_checkpoint(folder: Path) -> None:
    network = build_network(MODEL)
    state = {"step": 1, "weights": network.state_dict(), "best_cm": 1.0, "offset_sum_m": torch.zeros(15, 3), "offset_count": 3}
    pose = np.zeros((15, 3)).tolist()
    save_checkpoint(folder, network, state, {"step": 1, "config": {}, "metrics": {}, "mean_pose_m": pose}, best=True)


def make_onnx(folder: Path) -> None:
    export(folder)
    for part in ("checkpoints", "last", "best"):
        place = folder / part
        place.unlink() if place.is_symlink() else shutil.rmtree(place)


def read_exported(folder: Path) -> None:
    NetworkEstimator(folder / "pose.onnx").backend(np.zeros((2, 2, 32, 32), np.float32))


def read_checkpoint(folder: Path) -> None:
    checkpoint = next(iter(sorted((folder / "checkpoints").iterdir())))
    load_network(checkpoint)
    load_state(checkpoint)


def make_tree_walk(folder: Path) -> None:
    config = TreeWalkConfig(
        images=12, crop_px=32, validation_images=6, confidence_bins=2, growth=GrowthConfig(features=5, leaf_samples=10, depth=4)
    )
    model, metrics = train_tree_walk(config, CapsulePeople(12, seed=1), CapsulePeople(6, seed=2), 0, 0)
    model.save(folder, {"config": {}, "data": {}, "metrics": metrics})


def read_tree_walk(folder: Path) -> None:
    depth_m = np.zeros((1, SMALL.height, SMALL.width), np.float32)
    depth_m[0, 5:35, 15:30] = 2.5
    TreeWalkEstimator(TreeWalkEstimatorConfig(path=str(folder))).estimate(depth_m, SMALL)


def make_pack(folder: Path) -> None:
    (folder / "clips").mkdir()
    rows = ["clip_id,file,split,description,seconds"]
    for number, name in enumerate("ab"):
        motion = dance(number, seconds=2)
        arrays = {"quat": np.round(motion.quats * 32767).astype(np.int16), "root": motion.root_m, "fps": 30.0}
        arrays |= {"offsets": REST_OFFSETS_M.astype(np.float32), "bad": np.zeros(len(motion), bool)}
        np.savez(folder / "clips" / f"{name}.npz", **arrays)
        rows.append(f"{name},clips/{name}.npz,train,a dance,{len(motion) / 30}")
    (folder / "index.csv").write_text("\n".join(rows) + "\n")


def read_clips(folder: Path) -> None:
    source = build_motion(MotionConfig(source="clips", path=str(folder)), "train")
    for index in range(min(len(source), 4)):
        source.motion(index)
    source.poses([np.random.default_rng(0)])


def make_bvh(folder: Path) -> None:
    limbs = {"Arm": "28 0 0", "ForeArm": "28 0 0", "Hand": "28 0 0", "UpLeg": "10 0 0", "Leg": "0 -42 0", "Foot": "0 -42 0"}
    rotation = "CHANNELS 3 Zrotation Xrotation Yrotation"
    lines = ["HIERARCHY", "ROOT Hips", "{", "OFFSET 0 0 0", f"CHANNELS 6 Xposition Yposition Zposition {rotation[11:]}"]

    def chain(side: str, names: tuple[str, ...]) -> None:
        for name in names:
            offset = limbs[name] if side == "Left" else f"-{limbs[name]}".replace("-0", "0")
            lines.extend([f"JOINT {side}{name}", "{", f"OFFSET {offset}", rotation])
        lines.extend("}" * len(names))

    for side in ("Left", "Right"):
        chain(side, ("UpLeg", "Leg", "Foot"))
    lines += ["JOINT Spine", "{", "OFFSET 0 40 0", rotation, "JOINT Head", "{", "OFFSET 0 20 0", rotation, "}"]
    for side in ("Left", "Right"):
        chain(side, ("Arm", "ForeArm", "Hand"))
    lines += ["}", "}", "MOTION", "Frames: 40", "Frame Time: 0.0333333"]
    lines += [" ".join(["0", "92", *["0"] * 46])] * 40
    (folder / "a.bvh").write_text("\n".join(lines))


def make_stages(folder: Path) -> None:
    joints_m = cone_joints(-75, 4)  # upright, with hanging arms
    depth_m = draw_cones(joints_m, cone_body(joints_m), CAMERAS["kinect_v1"])
    np.save(folder / "depth.npy", np.repeat((1000 * depth_m).astype(np.uint16)[None], 3, axis=0))


def make_imperial(folder: Path) -> None:
    positions = person()
    points = np.zeros((FRAMES, len(IMPERIAL_POINTS), 3))
    points[:, [IMPERIAL_POINTS.index("Head"), IMPERIAL_POINTS.index("Neck")]] = np.stack(
        [positions["HEAD"], positions["NECK"]], 1
    )
    for name, number in IMPERIAL.items():
        points[:, number] = positions[name]
    np.save(folder / "dance_level_e_a_ch01.npy", points.transpose(2, 0, 1)[None])


def read_imperial_joints(folder: Path) -> None:
    for take in read_imperial(folder / "dance_level_e_a_ch01.npy"):
        imperial_joints_m(np.asarray(take), "fuzz")


def read_dance(folder: Path) -> None:
    for path in sorted(folder.iterdir()):
        read_performance(path)


TAUGHT_BODY = TeacherBody(**teacher_arrays())


def make_taught(folder: Path) -> None:
    quats, hips_m = posed(joints(5), TAUGHT_BODY)
    Library(folder, TAUGHT_BODY).write("mama", taught_dance("Mama", 30.0, 120.0, joints(5), quats, hips_m))


def read_taught(folder: Path) -> None:
    library = Library(folder, TAUGHT_BODY)
    for identity in library.identities():
        library.about(identity)
        dance = library.dance(identity)
        preview_cm(dance)
        as_bvh(TAUGHT_BODY, *posed(dance.joints_m, TAUGHT_BODY), dance.fps)


def read_depth(folder: Path) -> None:
    files = sorted(folder.iterdir())
    for path in [folder] if files[0].suffix in (".png", ".tif") else files:
        for _ in open_depth(path, DEPTH_CAMERA, in_child=path.suffix == ".h5").timed():  # its library may crash
            pass


def make_csv(folder: Path) -> None:
    header = ["time_s", *(f"{name}_{axis}" for name in COCO_NAMES for axis in ("x", "y", "z", "confidence"))]
    rows = [[k / 30, *np.append(frame, np.ones((17, 1)), axis=1).round(3).ravel()] for k, frame in enumerate(coco()[:5])]
    (folder / "a.csv").write_text("\n".join([",".join(header), *(",".join(map(str, row)) for row in rows)]))


def make_named_json(folder: Path) -> None:
    frames = [
        {"time_s": k / 30, "joints": dict(zip(COCO_NAMES, frame.tolist(), strict=True))} for k, frame in enumerate(coco()[:3])
    ]
    (folder / "a.json").write_text(json.dumps({"frames": frames}))


def make_azure_json(folder: Path) -> None:
    bodies = [[{"body_id": 1, "joint_positions": (1000 * frame).tolist()}] for frame in coco()[:3]]
    frames = [{"timestamp_usec": 33_333 * k, "bodies": body} for k, body in enumerate(bodies)]
    (folder / "a.json").write_text(json.dumps({"joint_names": COCO_NAMES, "frames": frames}))


def make_points(folder: Path) -> None:
    np.savez(folder / "a.npz", points=coco(), names=np.array(COCO_NAMES), fps=30.0, confidence=np.ones((FRAMES, 17)))


FORMATS = {
    "shard_clean": Format(lambda folder: make_shard(folder, "clean"), ("*.h5",), read_shards),
    "shard_frozen": Format(lambda folder: make_shard(folder, "frozen"), ("*.h5",), read_frozen),
    "dance": Format(make_dances, ("mama/*.h5", "mama/labels.csv", "manifest.json"), read_dances),
    "checkpoint_meta": Format(make_checkpoint, ("checkpoints/*/meta.json",), read_checkpoint),
    "checkpoint_weights": Format(make_checkpoint, ("checkpoints/*/model.safetensors",), read_checkpoint),
    "onnx": Format(make_onnx, ("pose.onnx",), read_exported),
    "checkpoint_state": Format(make_checkpoint, ("checkpoints/*/state.pt",), read_checkpoint),
    "tree_walk": Format(make_tree_walk, ("*",), read_tree_walk),
    "clips_index": Format(make_pack, ("index.csv",), read_clips),
    "clips_npz": Format(make_pack, ("clips/*.npz",), read_clips),
    "bvh": Format(make_bvh, ("*.bvh",), read_clips),
    "bvh_joints": Format(make_bvh, ("*.bvh",), read_dance),
    "joints_npz": Format(
        lambda folder: np.savez(folder / "a.npz", joints_m=joints(5), times_s=np.arange(5) / 30, confidence=np.ones((5, 15))),
        ("*.npz",),
        read_dance,
    ),
    "points_npz": Format(make_points, ("*.npz",), read_dance),
    "aist": Format(lambda folder: np.savez(folder / "a.npz", keypoints3d=coco(), fps=60), ("*.npz",), read_dance),
    "aist_json": Format(
        lambda folder: (folder / "a.json").write_text(json.dumps({"keypoints3d": coco()[:3].tolist(), "fps": 60})),
        ("*.json",),
        read_dance,
    ),
    "named_json": Format(make_named_json, ("*.json",), read_dance),
    "azure_json": Format(make_azure_json, ("*.json",), read_dance),
    "joints_csv": Format(make_csv, ("*.csv",), read_dance),
    "imperial": Format(make_imperial, ("*.npy",), read_imperial_joints),
    "depth_png": Format(lambda folder: write_pngs(folder, depth_mm(2)), ("*.png",), read_depth),
    "depth_tiff": Format(lambda folder: write_pngs(folder, depth_mm(2), ".tif"), ("*.tif",), read_depth),
    "depth_npz": Format(lambda folder: write_npz(folder / "a.npz", depth_mm(3), fps=25.0), ("*.npz",), read_depth),
    "depth_hdf5": Format(lambda folder: write_hdf5(folder / "a.h5", depth_mm(3)), ("*.h5",), read_depth),
    "depth_video": Format(lambda folder: write_video(folder / "a.mkv", depth_mm(3)), ("*.mkv",), read_depth),
    "taught_dance": Format(make_taught, ("dances/mama.npz",), read_taught),
    "human_model": Format(
        lambda folder: HumanModel.from_joints(joints(1)[0]).save(folder / "model.json"),
        ("*.json",),
        lambda folder: HumanModel.load(folder / "model.json"),
    ),
    "depth_npy": Format(make_stages, ("*.npy",), lambda folder: stages_of(folder / "depth.npy", 2, "kinect_v1")),
}
