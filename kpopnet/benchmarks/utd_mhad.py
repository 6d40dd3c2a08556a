"""Benchmark `utd_mhad`: real Kinect v1 depth (Chen, Jafari, Kehtarnavaz, ICIP 2015), read from its original .mat files.

    Depth/a<action>_s<subject>_t<trial>_depth.mat          d_depth (240, 320, T) uint16 mm, background removed
    Skeleton/a<action>_s<subject>_t<trial>_skeleton.mat    d_skel  (20, 3, T) metres, x right, y up, z forward

Its joints are what Microsoft's Kinect SDK estimated from this same depth, not what anybody measured: a score against
them says how far two estimators agree, and a few centimetres of it are a difference in what a joint is called.
"""

import logging
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.io import loadmat
from scipy.spatial import cKDTree

from kpopnet.benchmarks.sequences import Origin, Sequence
from kpopnet.camera import Camera, depth_in_metres
from kpopnet.errors import InputError
from kpopnet.skeleton import Joint

log = logging.getLogger(__name__)

STORED_CAMERA = Camera(285.63, 285.63, 160.0, 120.0, 320, 240)
"""Nominal Kinect v1 intrinsics, with which the SDK's joints fall on the body; of the image as stored."""

KINECT_JOINTS = (
    *("head", "shoulder_center", "spine", "hip_center"),
    *("left_shoulder", "left_elbow", "left_wrist", "left_hand"),
    *("right_shoulder", "right_elbow", "right_wrist", "right_hand"),
    *("left_hip", "left_knee", "left_ankle", "left_foot"),
    *("right_hip", "right_knee", "right_ankle", "right_foot"),
)
"""The rows of d_skel."""

FROM_KINECT = {joint: (joint.name.lower(),) for joint in Joint} | {
    Joint.NECK: ("shoulder_center",),
    # The SDK's spine lies low in the belly; ours is the middle of shoulders and hips (paper, section 2.3).
    Joint.TORSO: ("left_shoulder", "right_shoulder", "left_hip", "right_hip"),
}
"""Our fifteen from their twenty, each the mean of the named."""

LAGS = (-3, -2, -1, 0)
LAG_JOINTS = [KINECT_JOINTS.index(f"{side}_{part}") for side in ("left", "right") for part in ("wrist", "hand")]


@dataclass
class UtdMhadConfig:
    """Where the set lies and how its labels are read.

    Attributes:
        path: the folder that holds Depth/ and Skeleton/.
        lag: which skeleton row belongs to depth frame t: row t + lag. By default estimated for every sequence.
    """

    name: str = "utd_mhad"
    path: str | None = None
    lag: int | None = None


class UtdMhadBenchmark:
    """The original files, un-mirrored, with the labels' lead over the depth taken out; what is absent is logged."""

    name = "utd_mhad"
    origin = Origin.REAL
    truth = "Kinect SDK labels"
    about = (
        "Real Kinect v1 depth, background removed by the data set's authors, one person facing the camera. The labels "
        "are the Kinect SDK's own estimates, not motion capture: the score says how far two estimators agree."
    )

    def __init__(self, config: UtdMhadConfig) -> None:
        """Lists the set's sequences.

        Raises:
            InputError: the folder does not hold the set.
        """
        if config.path is None:
            raise InputError("benchmark=utd_mhad needs benchmark.path=PATH, the folder that holds Depth/ and Skeleton/")
        self.folder = Path(config.path)
        self.lag = config.lag
        names = [path.name.removesuffix("_depth.mat") for path in self.folder.glob("Depth/*_depth.mat")]
        if not names:
            raise InputError(
                f"{self.folder}: no Depth/*_depth.mat there; give UTD-MHAD's folder, the one that holds Depth/ and "
                "Skeleton/, with benchmark.path=..."
            )
        self._names = sorted(names, key=lambda name: [int(digits) for digits in re.findall(r"\d+", name)])

    def sequence_names(self) -> list[str]:
        return self._names

    def read(self, name: str) -> Sequence:
        depth_m = self._read_depth(name)  # (T, 240, 320), still mirrored
        skeleton_m = self._read_skeleton(name)  # (S, 20, 3), likewise
        if absent := int(np.isnan(skeleton_m).any(axis=-1).sum()):
            log.warning("%s: left out %d joints that are absent", name, absent)
        lag = estimate_lag(depth_m, skeleton_m) if self.lag is None else self.lag
        joints = aligned(skeleton_m, lag, len(depth_m))
        joints = np.stack([joints[:, kinect_rows(joint)].mean(axis=1) for joint in Joint], axis=1)
        # The stored image is a mirror's: what it names right has x > 0 in a person who faces the camera. Flipping image
        # and joints alike, and no name, puts the person's right where the person's right was.
        joints[..., 0] *= -1
        return Sequence(
            name=name,
            identity="s" + re.findall(r"\d+", name)[1] if name.count("_") == 2 else "",
            fps=30.0,
            camera=STORED_CAMERA.mirrored(),
            depth_m=np.ascontiguousarray(depth_m[:, :, ::-1]),
            joints_camera_m=joints.astype(np.float32),
            # The SDK's own mark for joints that it only inferred is not in the files.
            visible=np.isfinite(joints).all(axis=-1),
        )

    def _read_depth(self, name: str) -> np.ndarray:
        path = self.folder / "Depth" / f"{name}_depth.mat"
        stored = read_variable(path, "d_depth")
        if stored.ndim != 3 or not len(stored.T):
            raise InputError(f"{path}: expected d_depth of shape (240, 320, T), found {stored.shape}")
        return depth_in_metres(np.ascontiguousarray(stored.transpose(2, 0, 1)), STORED_CAMERA, where=str(path))

    def _read_skeleton(self, name: str) -> np.ndarray:
        """(S, 20, 3) float64 metres in the stored image's camera frame, y down; NaN where a joint is absent."""
        path = self.folder / "Skeleton" / f"{name}_skeleton.mat"
        stored = read_variable(path, "d_skel")
        if stored.ndim != 3 or stored.shape[:2] != (len(KINECT_JOINTS), 3) or stored.dtype.kind != "f":
            raise InputError(f"{path}: expected d_skel of shape (20, 3, T), found {stored.shape} {stored.dtype}")
        skeleton_m = stored.transpose(2, 0, 1).astype(np.float64)
        absent = ~np.isfinite(skeleton_m).all(axis=-1) | (skeleton_m == 0).all(axis=-1)
        skeleton_m[absent] = np.nan
        return skeleton_m * [1, -1, 1]


def kinect_rows(joint: Joint) -> list[int]:
    return [KINECT_JOINTS.index(name) for name in FROM_KINECT[joint]]


def read_variable(path: Path, variable: str) -> np.ndarray:
    """One variable of a MATLAB file.

    Raises:
        InputError: the file is missing, is not a whole MATLAB file, or lacks the variable.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    try:
        found = loadmat(path)
    except Exception as error:  # scipy raises whatever its parser trips over
        raise InputError(f"{path}: not a whole MATLAB file ({error}); fetch it again") from error
    if variable not in found:
        held = ", ".join(name for name in found if not name.startswith("__"))
        raise InputError(f"{path}: expected a variable {variable}, found {held or 'none'}")
    return found[variable]


def aligned(skeleton_m: np.ndarray, lag: int, frames: int) -> np.ndarray:
    """(T, 20, 3): row t + lag of the skeleton for each depth frame t, NaN beyond either end."""
    rows = np.arange(frames) + lag
    there = (rows >= 0) & (rows < len(skeleton_m))
    out = np.full((frames, *skeleton_m.shape[1:]), np.nan)
    out[there] = skeleton_m[rows[there]]
    return out


def estimate_lag(depth_m: np.ndarray, skeleton_m: np.ndarray) -> int:
    """The lag in LAGS with which the labels' wrists and hands lie nearest to the depth's points, in the mean.

    Hands move fastest and have little flesh around them, so they tell. Every lag is judged on the same depth frames. In
    a sequence in which the hands hardly move all lags fit alike; there the choice matters as little as it is certain.

    Args:
        depth_m: (T, H, W) metres, as stored.
        skeleton_m: (S, 20, 3) metres in the same camera frame, NaN where absent.
    """
    labels = np.stack([aligned(skeleton_m, lag, len(depth_m))[:, LAG_JOINTS] for lag in LAGS], axis=1)  # (T, L, 4, 3)
    usable = np.isfinite(labels).all(axis=(1, 2, 3)) & depth_m.any(axis=(1, 2))
    if not usable.any():
        return -2  # the commonest in the set
    distances = [
        cKDTree(STORED_CAMERA.points(image)[image > 0]).query(candidates)[0].mean(axis=-1)
        for image, candidates in zip(depth_m[usable], labels[usable], strict=True)
    ]
    return LAGS[int(np.argmin(np.mean(distances, axis=0)))]
