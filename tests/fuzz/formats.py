"""A small valid example of every file format that strangers send, and how a program reads it whole."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from azure_kinect_files import write_azure_kinect
from bvh_files import write_bvh
from depth_files import CAMERA as DEPTH_CAMERA
from depth_files import depth_mm, write_hdf5, write_npz, write_pngs, write_scannet, write_sent, write_tum, write_video
from gltf_files import write_gltf
from marker_files import write_c3d, write_trc
from phone_files import write_record3d, write_stray
from recorded_points import FRAMES, coco
from ros_files import TOPIC, write_ros
from shard_sets import write_shard
from vmd_files import write_vmd
from y_people import y_joints

from fuzz.hostile import DEED_BYTES, SECRET, perform
from kpopnet.dance.joint_files.points import COCO_NAMES
from kpopnet.dance.joint_files.reader import read_performance
from kpopnet.dance.joint_files.writing import write_performance
from kpopnet.dance.performance import Performance
from kpopnet.data.shards import ShardedSet
from kpopnet.datasets.dances.dance_set import KpopSet
from kpopnet.datasets.dances.writer import PackedDepth, write_labels, write_learner, write_teacher
from kpopnet.runtime.untrusted import read_in_child
from kpopnet.skeleton import Joint
from kpopnet.sources import open_depth
from kpopnet.sources.camera_files import read_optics
from kpopnet.teacher.library import Library, taught_dance
from kpopnet.teacher.tries import Tries
from synth.motion.skeleton import LEG_M, NUM_JOINTS, Motion


class Format(NamedTuple):
    """A file format."""

    make: Callable[[Path], object]  # writes a valid example into an empty folder
    read: Callable[[Path], list[np.ndarray]]  # as a program does; raises InputError where the example is invalid
    every: int = 1  # of how many cases one is run, where a case is expensive
    # whether only its owner has it on the disk, and it is read in the program's own process: bytes in the structures of HDF5
    # are not changed, because its library crashes on some
    is_own: bool = False


def joints(frames: int) -> np.ndarray:
    """(frames, 15, 3) metres of a person whose arms move."""
    return np.stack([y_joints(20 + 2 * frame) for frame in range(frames)]).astype(np.float32)


def still(frames: int) -> Motion:
    quats = np.tile(np.float32([1, 0, 0, 0]), (frames, NUM_JOINTS, 1))
    return Motion(quats, np.ones((frames, 3), np.float32), 30.0, "still", LEG_M)


def make_gltf(folder: Path) -> None:
    write_gltf(folder / "a.glb", still(3))
    write_gltf(folder / "b.gltf", still(3), uri="b.bin", interpolation="CUBICSPLINE", resting=still(3).quats[0])
    write_gltf(folder / "c.vrma", still(3), humanoid="VRMC_vrm_animation")


def make_joint_map(folder: Path) -> None:
    np.save(folder / "a.npy", joints(5))
    write_json(folder / "map.json", {joint.name.lower(): [int(joint)] for joint in Joint if joint != Joint.TORSO})


def read_mapped(folder: Path) -> list[np.ndarray]:
    return parts(read_performance(folder / "a.npy", 30.0, folder / "map.json"))


def read_dance(folder: Path) -> list[np.ndarray]:
    return [part for path in sorted(folder.iterdir()) if path.suffix != ".bin" for part in parts(read_performance(path))]


def parts(performance: Performance) -> list[np.ndarray]:
    return [performance.joints_m, performance.times_s, performance.confidence]


def read_depth(folder: Path) -> list[np.ndarray]:
    paths = [folder] if any(folder.glob("*.[pt]*")) else folder.iterdir()
    return [
        part for path in paths for one in open_depth(path, DEPTH_CAMERA).timed() for part in (one.depth_m, np.array(one.time_s))
    ]


def read_recording(folder: Path) -> list[np.ndarray]:
    """With the camera that the recording states."""
    path = next(folder.glob("a.*"), folder)
    return [part for one in open_depth(path).timed() for part in (one.depth_m, np.array(one.time_s))]


def make_tum(folder: Path) -> None:
    write_json(write_tum(folder, depth_mm(2)) / "camera.json", vars(DEPTH_CAMERA))


def write_json(path: Path, content: object) -> None:
    path.write_text(json.dumps(content))


def by(write: Callable, name: str, *given, **options) -> Callable[[Path], object]:
    """Writes one file of this name; with no name, into the folder."""
    return lambda folder: write(folder / name, *given, **options)


CAMERA = {"fx": 570, "fy": 570, "cx": 320, "cy": 240, "width": 640, "height": 480}
REALSENSE = {"width": 640, "height": 480, "ppx": 321.2, "ppy": 238.9, "fx": 387.1, "fy": 387.1, "coeffs": [0.1, 0, 0, 0, 0]}
LENS = {"ModelParameters": [0.5, 0.5, 0.49, 0.49, *[0.0] * 10]}
AZURE_MM = np.tile(depth_mm(2), (1, 6, 5))
AZURE = {"Cameras": [{"Purpose": "CALIBRATION_CameraPurposeDepth", "Intrinsics": LENS}]}


def read_a_camera(folder: Path) -> list[np.ndarray]:
    camera = read_optics(folder / "a.json", 640, 576).view().camera
    return [np.array([camera.fx, camera.fy, camera.cx, camera.cy, camera.width, camera.height], float)]


def make_set(folder: Path) -> None:
    """Shards on one's own disk."""
    write_shard(folder, [1, 1, 2])
    write_shard(folder, [2, 3], shard=1, start=3, rooms=[0, 1])


def read_set(folder: Path) -> list[np.ndarray]:
    samples = ShardedSet(folder)
    found = [samples.column("body"), samples.room_numbers().astype(float)]
    for index in range(len(samples)):
        one = samples[index]
        found += [one.depth_mm / 1000, one.joints_camera_m, np.array(one.yaw_rad), samples.room(index, one.room)[0] / 1000]
    return found


def make_dances(folder: Path) -> None:
    """A set in the K-Pop format."""
    recording = PackedDepth(DEPTH_CAMERA)
    for image in depth_mm(5):
        recording.add(image[:20, :20], 3, 4)
    write_teacher(folder / "mama", DANCE)
    write_learner(folder / "mama", "jin", np.arange(5) / 30, joints(5), recording, {"level": "best"})
    write_learner(folder / "mama", "ann", np.arange(5) / 30, joints(5))
    write_labels(folder / "mama", ["jin", "ann"])
    write_json(folder / "manifest.json", {"simulated": True, "name": "a", "about": "b", "dances": 1, "hash": "c"})


def read_dances(folder: Path) -> list[np.ndarray]:
    dances, found = KpopSet(folder), []
    for dance in map(dances.dance, dances.names):
        found += parts(dance.teacher())
        for learner in dance.learners:
            found += [*parts(learner.joints() or dance.teacher()), np.array(sorted(learner.about))]
            if learner.depth_key is not None:
                found.append(learner.depth().depth_m)
    return found


def make_taught(folder: Path) -> None:
    """A dance of the teacher's library."""
    quats = np.tile(np.float32([1, 0, 0, 0]), (40, 5, 1))
    dance = taught_dance("title", 30.0, 120.0, np.tile(joints(10), (4, 1, 1)), quats, np.ones((40, 3)))
    Library(folder, body=None).write("own_001", dance)  # type: ignore[arg-type]


def read_taught(folder: Path) -> list[np.ndarray]:
    library = Library(folder, body=None)  # type: ignore[arg-type]
    dance, about = library.dance("own_001"), library.about("own_001")
    return [dance.joints_m, dance.quats, dance.hips_m, np.array([dance.fps, about.bpm, about.seconds])]


def make_names(folder: Path) -> None:
    """The names of a dance and a try, as a request of the page gives them; the try, and one of that name elsewhere."""
    write_json(folder / "names.json", {"dance": "own_001", "name": TRY})
    for place, total in ((folder.parent / "tries" / "own_001", 80.0), (folder.parent / "outside", SECRET)):
        place.mkdir(parents=True, exist_ok=True)
        write_json(place / f"{TRY}.json", {"total": total})


def read_names(folder: Path) -> list[np.ndarray]:
    names = json.loads((folder / "names.json").read_text())
    return [np.array(Tries(folder.parent / "tries").result(names["dance"], names["name"])["total"])]


def make_checkpoint(folder: Path) -> None:
    from checkpoints import SMALL, save_untrained

    from kpopnet.networks.network import build_network

    network = build_network(SMALL)
    state = {"step": 1, "weights": network.state_dict(), "best_cm": 3.0}
    shutil.copytree(save_untrained(folder.parent / "run", network=network, state=state), folder, dirs_exist_ok=True)


def read_checkpoint(folder: Path) -> list[np.ndarray]:
    from kpopnet.networks.checkpoint import load_network, load_state

    network, meta = load_network(folder)
    return [
        *(one.numpy() for one in network.state_dict().values()),
        np.array([meta["step"], load_state(folder).get("step", 0)]),
    ]


def read_deed(folder: Path) -> list[np.ndarray]:
    return [np.array(read_in_child(perform, folder / "deed.json", seconds=2, memory_bytes=DEED_BYTES))]


DANCE = Performance(joints(5), np.arange(5) / 30)
AZURE_FRAMES = [
    {"timestamp_usec": 33_333 * k, "bodies": [{"body_id": 1, "joint_positions": (1000 * frame).tolist()}]}
    for k, frame in enumerate(coco()[:3])
]
KEYS = [(frame, (0, 0, 0), (0, 0, 0, 1)) for frame in (0, 5)]
BONES = dict.fromkeys(("左腕", "右腕", "左足ＩＫ", "センター"), KEYS)
TRY = "20260101-120000-000"

FORMATS = {
    "bvh": Format(by(write_bvh, "a.bvh", still(40)), read_dance),
    "gltf": Format(make_gltf, read_dance),
    "vmd": Format(by(write_vmd, "a.vmd", BONES, switches=[(3, "左足ＩＫ", False)]), read_dance),
    "c3d": Format(by(write_c3d, "a.c3d", 1000 * coco()[:5], COCO_NAMES), read_dance),
    "trc": Format(by(write_trc, "a.trc", 1000 * coco()[:5], COCO_NAMES), read_dance),
    "joint_map": Format(make_joint_map, read_mapped),
    "joints_npz": Format(by(write_performance, "a.npz", DANCE), read_dance),
    "amass_npz": Format(
        by(np.savez, "a.npz", poses=np.zeros((5, 72)), trans=np.zeros((5, 3)), mocap_framerate=30.0), read_dance
    ),
    "points_npz": Format(
        by(np.savez, "a.npz", points=coco(), names=np.array(COCO_NAMES), fps=30.0, confidence=np.ones((FRAMES, 17))), read_dance
    ),
    "named_json": Format(by(write_performance, "a.json", DANCE), read_dance),
    "azure_json": Format(by(write_json, "a.json", {"joint_names": COCO_NAMES, "frames": AZURE_FRAMES}), read_dance),
    "joints_csv": Format(by(write_performance, "a.csv", DANCE), read_dance),
    "camera": Format(by(write_json, "a.json", CAMERA), read_a_camera),
    "realsense_camera": Format(by(write_json, "a.json", {"depth_intrinsics": REALSENSE}), read_a_camera),
    "azure_camera": Format(by(write_json, "a.json", {"CalibrationInformation": AZURE}), read_a_camera),
    "depth_png": Format(by(write_pngs, "", depth_mm(2)), read_depth),
    "depth_tif": Format(by(write_pngs, "", depth_mm(2), ".tif"), read_depth),
    "depth_npz": Format(by(write_npz, "a.npz", depth_mm(3), fps=25.0), read_depth),
    "depth_npy": Format(by(np.save, "a.npy", depth_mm(3)), read_depth),
    "depth_hdf5": Format(by(write_hdf5, "a.h5", depth_mm(6), chunk=2), read_depth),
    "depth_video": Format(by(write_video, "a.mkv", depth_mm(3)), read_depth),
    "depth_sent": Format(by(write_sent, "a.depth", depth_mm(3)), read_depth),
    "azure_recording": Format(by(write_azure_kinect, "a.mkv", AZURE_MM, ("IR", "DEPTH")), read_recording),
    "ros1_bag": Format(by(write_ros, "a.bag", depth_mm(3)), read_recording),
    "ros1_compressed": Format(
        by(write_ros, "a.bag", depth_mm(3), {f"{TOPIC}/compressedDepth": "32FC1; compressedDepth png"}), read_recording
    ),
    "ros2_db3": Format(by(write_ros, "a.db3", depth_mm(3)), read_recording),
    "ros2_mcap": Format(by(write_ros, "a.mcap", depth_mm(3)), read_recording),
    "stray_scanner": Format(by(write_stray, "", depth_mm(2)), read_recording),
    "record3d": Format(by(write_record3d, "a.r3d", depth_mm(2)), read_recording),
    "tum": Format(make_tum, read_recording),
    "scannet": Format(by(write_scannet, "", depth_mm(2)), read_recording),
    "shards": Format(make_set, read_set, is_own=True),
    "kpop_set": Format(make_dances, read_dances, is_own=True),
    "library": Format(make_taught, read_taught),
    "names": Format(make_names, read_names, every=5),
    "checkpoint": Format(make_checkpoint, read_checkpoint),
    "child": Format(by(write_json, "deed.json", {"do": "answer"}), read_deed, every=50),
}
"""What strangers send, to `scannet`; then what lies on one's own disk, or comes as a request. `child` is no format: its
files say what a parser does to the process that reads for us (`fuzz.hostile.perform`)."""
