"""Reads a recording of joints from a file of any of the known formats: a reader for each kind of file."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from kpopnet.dance.joint_files import amass
from kpopnet.dance.joint_files.bvh_motion import BvhMotion, bvh_points, read_bvh_group
from kpopnet.dance.joint_files.markers import read_c3d, read_npy, read_trc
from kpopnet.dance.joint_files.mediapipe import OF_PICTURE, is_mediapipe, lifted
from kpopnet.dance.joint_files.points import (
    COCO_NAMES,
    MEDIAPIPE_NAMES,
    NamedPoints,
    checked_performance,
    frame_times_s,
    named_performances,
    unit_m,
    with_joint_map,
)
from kpopnet.dance.joint_files.tables import EACH_A_FILE, TIMES, joint_points, numbers_in, read_csv
from kpopnet.dance.performance import Performance
from kpopnet.errors import InputError, check_number
from kpopnet.runtime.input_files import ArraySchema, as_path, check_array, check_fields, expect, parse_json, read_json, read_npz
from kpopnet.runtime.untrusted import read_in_child
from kpopnet.skeleton import NUM_JOINTS

GLTF = (".glb", ".gltf", ".vrm", ".vrma")
SUFFIXES = (".npz", ".bvh", ".csv", ".json", ".vmd", ".c3d", ".trc", *GLTF)

NPZ_SCHEMA = {
    "joints_m": ArraySchema("fiu", ("frames", NUM_JOINTS, 3), False),
    "keypoints3d_optim": ArraySchema("fiu", ("frames", len(COCO_NAMES), 3), False),
    "keypoints3d": ArraySchema("fiu", ("frames", len(COCO_NAMES), 3), False),
    "points": ArraySchema("fiu", ("frames", "points", 3), False),
    "names": ArraySchema("U", ("points",), False),
    "times_s": ArraySchema("fiu", ("frames",), False),
    "confidence": ArraySchema("fiu", ("frames", None), False),
    "fps": ArraySchema("fiu", (), False),
    **amass.SCHEMA,
}
"""joints_m in metres in the camera frame, or keypoints3d in COCO's order, or points and their names; then times_s or fps, and
the confidence of each joint or point. Or poses, as of AMASS."""

MOST_FRAMES = 450_000
"""Of a stranger's file: more than two hours at 60 frames a second."""

_WORLD_LANDMARKS = ("pose_world_landmarks", "world_landmarks", "poseWorldLandmarks", "worldLandmarks")
_PICTURE_LANDMARKS = ("pose_landmarks", "landmarks", "poseLandmarks")


def read_performance(path: Path | str, fps: float | None = None, joint_map: Path | str | None = None) -> Performance:
    """Reads a recording of joints; the ending of the file's name gives the format (docs/joint_files.md).

    Joints of .npz files of our own stay in their camera frame, MediaPipe's points are lifted in that of theirs
    (`kpopnet.dance.joint_files.mediapipe`), those of all other files are turned to face a level camera (see
    `kpopnet.dance.joint_files.points`). `fps` is the true rate of a file with none or a wrong one; `joint_map` says
    which of the points that a file names are which joints (`with_joint_map`). A stranger's file is read by
    `read_strangers_performance`.
    """
    return read_performances([path], fps, joint_map)[0]


def read_performances(
    paths: Sequence[Path | str], fps: float | None = None, joint_map: Path | str | None = None
) -> list[Performance]:
    """As `read_performance`, of dancers who were recorded together, on one clock and in one frame: a file for each.

    All stand before one camera, which the first faces at first, in the places that they had.
    """
    paths = _all_paths(paths)
    if fps is not None:
        check_number("fps", fps)
    of_bvh = [path for path in paths if path.suffix.lower() == ".bvh"]
    motions = dict(zip(of_bvh, read_bvh_group(of_bvh, fps), strict=True))
    group = [(_recorded(path, fps, joint_map, motions), str(path)) for path in paths]
    own = [one for one, _ in group if isinstance(one, Performance)]
    named = [(one, where) for one, where in group if not isinstance(one, Performance)]
    expect(not own or not named, str(paths[-1]), "a file of the same kind as the others'")
    return own or named_performances(named, fps)


def _all_paths(given: Sequence[Path | str]) -> list[Path]:
    if isinstance(given, Path | str) or not isinstance(given, Sequence) or not given:
        raise InputError(f"expected a list of one file or more, got {given!r:.80}")
    return [as_path(path) for path in given]


def _recorded(
    path: Path, fps: float | None, joint_map: Path | str | None, motions: Mapping[Path, BvhMotion]
) -> NamedPoints | Performance:
    """What a file holds; `motions` are those of the BVH files."""
    match path.suffix.lower():
        case ".npz":
            recorded = _read_npz(path, fps)
        case ".bvh":
            recorded = bvh_points(motions[path])
        case ".npy":
            expect(joint_map is not None, str(path), "--joint-map FILE beside an array without names of joints")
            recorded = read_npy(path)
        case ".c3d":
            recorded = read_c3d(path)
        case ".trc":
            recorded = read_trc(path)
        case ".vmd":
            from kpopnet.dance.joint_files.vmd import read_vmd  # with scipy, slow to import

            recorded = read_vmd(path)
        case ".csv":
            recorded = read_csv(path)
        case ".json":
            recorded = _read_json(path)
        case suffix if suffix in GLTF:
            expect(fps is None, str(path), "no frame rate beside it: the file states its times in seconds")
            from kpopnet.dance.joint_files.gltf import read_gltf  # with scipy, slow to import

            recorded = read_gltf(path)
        case ".fbx":
            raise InputError(f"{path}: FBX is a closed format; import it in Blender (free) and export BVH, or glTF as .glb")
        case ".pkl" | ".pickle":
            raise InputError(f"{path}: a pickle can run code when it is opened; save its arrays with numpy.savez first")
        case _:
            raise InputError(f"{path}: expected a file that ends with {', '.join(SUFFIXES)}")
    if not isinstance(recorded, NamedPoints):
        return recorded
    if joint_map is not None:
        recorded = with_joint_map(recorded, joint_map, str(path))
    return lifted(recorded, fps, str(path)) if is_mediapipe(recorded) else recorded


def read_strangers_performance(path: Path | str, fps: float | None = None, joint_map: Path | str | None = None) -> Performance:
    """`read_performance` in a process with limits of time and memory, which a hostile file may harm."""
    return read_strangers_group([path], fps, joint_map)[0]


def read_strangers_group(
    paths: Sequence[Path | str], fps: float | None = None, joint_map: Path | str | None = None
) -> list[Performance]:
    """`read_performances` in such a process."""
    first, *others = _all_paths(paths)
    return [Performance(**one) for one in read_in_child(_arrays, first, others, fps, joint_map)]


def _arrays(path: Path, others: list[Path], fps: float | None, joint_map: Path | str | None) -> list[dict[str, Any]]:
    found = read_performances([path, *others], fps, joint_map)
    for one, where in zip(found, (path, *others), strict=True):  # which the process that asked has to hold
        expect(len(one) <= MOST_FRAMES, str(where), f"at most {MOST_FRAMES:,} frames, found {len(one):,}")
    return [vars(one) for one in found]


def read_page_recording(path: Path) -> Performance:
    """A dance that the page recorded: of each image its time in seconds, and joints in metres in the camera's frame with their
    confidence; raises InputError for anything else. A process with limits of time and memory reads it, which a hostile one may
    harm.

    The message is {"frames": [{"time_s": 0.1, "joints": [[x, y, z, confidence], ...]}]}, null where a joint is missing.
    """
    return Performance(**read_in_child(_page_recording, path))


def _page_recording(path: Path) -> dict[str, Any]:
    where = "the recording"
    message = parse_json(path.read_bytes(), where)
    check_fields(where, message, {"frames": list[dict]})
    for frame in message["frames"]:
        check_fields(where, frame, {"time_s": float, "joints": list})
        expect(len(frame["joints"]) == NUM_JOINTS, where, f"{NUM_JOINTS} joints")
    expect(bool(message["frames"]), where, "images, found none")
    seen = np.array([[numbers_in(one, (4,), where) for one in frame["joints"]] for frame in message["frames"]])
    times_s = np.array([frame["time_s"] for frame in message["frames"]], float)
    return vars(checked_performance(seen[..., :3], times_s, np.nan_to_num(seen[..., 3]), where))


def _read_npz(path: Path, fps: float | None) -> NamedPoints | Performance:
    found, source = read_npz(path, NPZ_SCHEMA), str(path)
    times_s, confidence = found.get("times_s"), found.get("confidence")
    stated_fps = float(found["fps"]) if "fps" in found else None
    if "joints_m" in found:
        joints_m = found["joints_m"].astype(np.float64)
        if (unit := unit_m(joints_m, source)) != 1:
            raise InputError(f"{source}: joints_m is in units of {unit:g} m; expected metres")
        times_s = frame_times_s(len(joints_m), times_s, stated_fps, fps, source)
        return checked_performance(joints_m, times_s, confidence, source)
    if "poses" in found:
        posed = amass.smpl_points(found, source)
        return posed._replace(times_s=times_s, fps=stated_fps if posed.fps is None else posed.fps)
    name = next((name for name in ("keypoints3d_optim", "keypoints3d", "points") if name in found), None)
    if name is None:
        arrays = "joints_m (kpopnet predict makes it of depth), keypoints3d, poses, or points with names"
        raise InputError(f"{source}: expected an array {arrays}")
    expect(name != "points" or "names" in found, source, "an array names, of its points")
    names, points = [str(one) for one in found["names"]] if name == "points" else COCO_NAMES, found[name]
    if confidence is not None:
        check_array(f"{source}: confidence", confidence.shape, confidence.dtype, ArraySchema("fiu", points.shape[:2]))
    return NamedPoints(names, points.astype(np.float64), times_s, confidence, stated_fps)


def _read_json(path: Path) -> NamedPoints:
    """One of four kinds of JSON.

    - {"keypoints3d": [[[x, y, z], 17 times], ...], "fps": 60}: COCO's order; keypoints3d_optim is preferred.
    - {"fps": 30, "frames": [{"joints": {"WristLeft": [x, y, z], ...}}, ...]}: names of COCO, of a Kinect or our own; a fourth
      number is the confidence, null or a name left out a missing point. Frames may state time_s instead of fps.
    - {"joint_names": [...], "frames": [{"timestamp_usec": 0, "bodies": [{"body_id": 1, "joint_positions": [...]}]}]}: of Azure
      Kinect's offline processor; see `_azure_points`.
    - {"frames": [{"timestamp_ms": 0, "pose_world_landmarks": [{"x": 0, "y": 0, "z": 0, "visibility": 1}, 33 times]}]}: of
      MediaPipe; better with pose_landmarks beside, where they are in the picture.
    """
    content, where = read_json(path, non_finite=True), str(path)
    _refuse_2d(content, where)
    expect(isinstance(content, dict), where, "an object with keypoints3d or frames")
    check_fields(where, content, {"fps": float}, ["fps"])
    fps = float(content["fps"]) if "fps" in content else None
    if (keypoints := content.get("keypoints3d_optim", content.get("keypoints3d"))) is not None:
        expect(isinstance(keypoints, list) and len(keypoints) > 0, where, "keypoints3d, a list of frames")
        named = [_named(COCO_NAMES, frame, f"{where}: keypoints3d, frame {k}") for k, frame in enumerate(keypoints)]
        return joint_points(named, fps, where)
    check_fields(where, content, {"frames": list[dict], "joint_names": list[str]}, ["joint_names"])
    expect(len(content["frames"]) > 0, where, "frames, found none")
    world, picture = (
        next((key for key in keys if any(key in frame for frame in content["frames"])), None)
        for keys in (_WORLD_LANDMARKS, _PICTURE_LANDMARKS)
    )
    if world is not None:
        found, *in_picture = (
            joint_points([_mediapipe_frame(frame, key, where) for frame in content["frames"]], fps, where)
            for key in (world, picture)
            if key is not None
        )
        images = [one.points[..., :2] for one in in_picture if one.names == found.names]
        return found._replace(image=images[0]) if images else found
    if picture is not None and not any("joints" in frame for frame in content["frames"]):
        raise InputError(f"{where}: {OF_PICTURE}")
    if "joint_names" in content:
        return _azure_points(content["joint_names"], content["frames"], where)
    return joint_points(content["frames"], fps, where)


def _refuse_2d(content: Any, where: str) -> None:
    """Raises InputError for the 2D keypoints of OpenPose and of COCO."""
    first = content[0] if isinstance(content, list) and content else content
    if isinstance(first, dict) and any(key in first for key in ("people", "annotations", "keypoints", "pose_keypoints_2d")):
        raise InputError(
            f"{where}: 2D keypoints, as of OpenPose or COCO; a score needs 3D joints, from depth or motion capture"
        )


def _mediapipe_frame(frame: dict, key: str, where: str) -> dict:
    """A frame of MediaPipe's with "joints" by name; one without a person has none."""
    check_fields(where, frame, {key: list | None}, [key])
    landmarks = frame.get(key) or []
    if landmarks and isinstance(landmarks[0], list):  # a list for each person, in any order
        expect(len(landmarks) == 1, f"{where}: {key}", f"one person, found {len(landmarks)}; {EACH_A_FILE}")
        (landmarks,) = landmarks
    expect(not landmarks or len(landmarks) == len(MEDIAPIPE_NAMES), f"{where}: {key}", f"{len(MEDIAPIPE_NAMES)} landmarks")
    joints = {}
    for name, one in zip(MEDIAPIPE_NAMES, landmarks, strict=False):
        check_fields(f"{where}: {key}, {name}", one, {"x": float, "y": float, "z": float, "visibility": float}, ["visibility"])
        joints[name] = [one["x"], one["y"], one["z"], one.get("visibility", 1.0)]
    return {"joints": joints} | {time: frame[time] for time in TIMES if time in frame}


def _named(names: Sequence[str], points: Any, where: str) -> dict[str, Any]:
    """A frame with "joints" by name, from a list of points in the order of the names."""
    expect(isinstance(points, list) and len(points) == len(names), where, f"a list of {len(names)} points")
    return {"joints": dict(zip(names, points, strict=True))}


def _azure_points(names: list[str], frames: list[dict], where: str) -> NamedPoints:
    """The recording of the body that is seen most; times count from the first frame."""
    bodies: dict[int, dict[int, dict]] = {}  # the frames in which each is seen, by number
    for number, frame in enumerate(frames):
        check_fields(f"{where}: frame {number}", frame, {"bodies": list[dict], "timestamp_usec": int})
        for body in frame["bodies"]:
            check_fields(f"{where}: frame {number}", body, {"body_id": int, "joint_positions": list})
            own = _named(names, body["joint_positions"], f"{where}: frame {number}, joint_positions")
            bodies.setdefault(body["body_id"], {})[number] = own
    expect(bool(bodies), where, "a body in some frame, found none")
    seen, start = max(bodies.values(), key=len), frames[0]["timestamp_usec"]
    times = [{"time_s": (frame["timestamp_usec"] - start) / 1e6} for frame in frames]
    return joint_points([seen.get(k, {"joints": {}}) | time for k, time in enumerate(times)], None, where)
