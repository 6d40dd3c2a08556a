"""Benchmark `utd_mhad`: real Kinect v1 depth (Chen, Jafari, Kehtarnavaz, ICIP 2015), read from its original .mat files.

    Depth/a<action>_s<subject>_t<trial>_depth.mat          d_depth (240, 320, T) uint16 mm, background removed
    Skeleton/a<action>_s<subject>_t<trial>_skeleton.mat    d_skel  (20, 3, T) metres, x right, y up, z forward

Its joints are estimates of Microsoft's Kinect SDK from the same depth, not measurements. An error against them is the
disagreement of two estimators, and a few centimetres of it are differences in the definitions of the joints.
"""

import logging
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.io import loadmat
from scipy.spatial import cKDTree

from kpopnet.camera import Camera, depth_in_metres
from kpopnet.datasets.protocol import BenchmarkConfig, Origin, Sequence, check_joints
from kpopnet.errors import InputError
from kpopnet.runtime.input_files import ArraySchema, check_array, check_names, expect, read_with
from kpopnet.skeleton import Joint

log = logging.getLogger(__name__)

SHIFT_PX = -1.7
"""The people in the stored images lie this many columns beside the SDK's joints, projected with the nominal centre (160, 120).

A body fitted to the depth of 108 sequences, started from the labels, lies beside them, left and right joints averaged, by
1.82 columns in subject 1 (standard deviation 0.34 over 54 sequences) and by 1.60 in subject 3 (0.57); the mid-lines of heads
by 1.63 and 1.74, those of trunks by 2.07 and 2.26. The shift of one subject leaves 0.2 columns, 2 mm at 2.8 m, in the other.
The files do not tell whether the sensor's principal point or a shift of the image is the cause: the people stand in its middle
third. Upwards, outstretched arms lie 0 to 1.5 rows above the labels, within what the definitions differ: not corrected.
"""

STORED_CAMERA = Camera(285.63, 285.63, 160.0 + SHIFT_PX, 120.0, 320, 240)
"""Nominal Kinect v1 intrinsics of the image as stored, with the principal point moved by SHIFT_PX: labels and people agree."""

KINECT_JOINTS = (
    *("head", "shoulder_center", "spine", "hip_center"),
    *("left_shoulder", "left_elbow", "left_wrist", "left_hand"),
    *("right_shoulder", "right_elbow", "right_wrist", "right_hand"),
    *("left_hip", "left_knee", "left_ankle", "left_foot"),
    *("right_hip", "right_knee", "right_ankle", "right_foot"),
)
"""The rows of d_skel."""

_OTHER_NAMES = {
    Joint.NECK: ("shoulder_center",),
    # The SDK's spine joint lies low in the belly. Our torso is the mean of shoulders and hips (paper, section 2.3).
    Joint.TORSO: ("left_shoulder", "right_shoulder", "left_hip", "right_hip"),
}
FROM_KINECT = {joint: [KINECT_JOINTS.index(name) for name in _OTHER_NAMES.get(joint, (joint.name.lower(),))] for joint in Joint}
"""The rows of d_skel whose mean is each of our fifteen joints."""

CANDIDATE_LAGS = (-3, -2, -1, 0)
LAG_JOINTS = [KINECT_JOINTS.index(f"{side}_{part}") for side in ("left", "right") for part in ("wrist", "hand")]


@dataclass
class UtdMhadConfig(BenchmarkConfig):
    """Settings of the benchmark `utd_mhad`.

    Attributes:
        lag: row t + lag of the skeleton belongs to depth frame t, in frames. Estimated for each sequence by default.
    """

    name: str = "utd_mhad"
    lag: int | None = None


class UtdMhadBenchmark:
    """Reads the published files, mirrors them back, and shifts the labels in time to the depth; logs absent joints."""

    name = "utd_mhad"
    origin = Origin.REAL
    truth = "Kinect SDK labels"
    label_definition = "Kinect SDK"
    about = (
        "Real Kinect v1 depth, background removed by the data set's authors, one person facing the camera. The labels "
        "are estimates of the Kinect SDK, not motion capture: the errors are the disagreement of two estimators."
    )

    def __init__(self, config: UtdMhadConfig) -> None:
        """Lists the sequences; raises InputError if there are none."""
        self.folder, self.lag = config.folder("the folder that holds Depth/ and Skeleton/"), config.lag
        names = [path.name.removesuffix("_depth.mat") for path in self.folder.glob("Depth/[!.]*_depth.mat")]
        expect(bool(names), str(self.folder), "Depth/*_depth.mat in it, as in the folder of UTD-MHAD")
        check_names(str(self.folder), names)
        self._names = sorted(names, key=lambda name: [int(digits) for digits in re.findall(r"\d+", name)])

    def sequence_names(self) -> list[str]:
        return self._names

    def read(self, name: str) -> Sequence:
        depth_m = self._read_depth(name)  # (T, 240, 320), still mirrored
        skeleton_m = self._read_skeleton(name)  # (S, 20, 3), mirrored too
        if absent := int(np.isnan(skeleton_m).any(axis=-1).sum()):
            log.warning("%s: left out %d joints that are absent", name, absent)
        lag = estimate_lag(depth_m, skeleton_m) if self.lag is None else self.lag
        joints = shift_labels(skeleton_m, lag, len(depth_m))
        joints = np.stack([joints[:, FROM_KINECT[joint]].mean(axis=1) for joint in Joint], axis=1)
        # The stored image is mirrored: joints named right have x > 0 in a person who faces the camera. Mirroring image and
        # joints, without exchanging names, puts the person's right side back in its place.
        joints[..., 0] *= -1
        return Sequence(
            name=name,
            identity=named[1] if (named := re.fullmatch(r"a\d+_(s\d+)_t\d+", name)) else "",
            fps=30.0,
            camera=STORED_CAMERA.mirrored(),
            depth_m=np.ascontiguousarray(depth_m[:, :, ::-1]),
            joints_camera_m=joints.astype(np.float32),
            # The files lack the SDK's flag for inferred joints, so every finite joint counts as visible.
            visible=np.isfinite(joints).all(axis=-1),
        )

    def _read_depth(self, name: str) -> np.ndarray:
        path = self.folder / "Depth" / f"{name}_depth.mat"
        stored = _read_frames(path, "d_depth", ArraySchema("uf", (STORED_CAMERA.height, STORED_CAMERA.width, None)))
        return depth_in_metres(np.ascontiguousarray(stored), STORED_CAMERA, where=str(path))

    def _read_skeleton(self, name: str) -> np.ndarray:
        """(S, 20, 3) float64 metres in the camera frame of the mirrored image, y down; NaN where a joint is absent."""
        path = self.folder / "Skeleton" / f"{name}_skeleton.mat"
        stored = _read_frames(path, "d_skel", ArraySchema("f", (len(KINECT_JOINTS), 3, None)))
        skeleton_m = stored.astype(np.float64)
        absent = ~np.isfinite(skeleton_m).all(axis=-1) | (skeleton_m == 0).all(axis=-1)
        skeleton_m[absent] = np.nan
        check_joints(str(path), skeleton_m)
        return skeleton_m * [1, -1, 1]


def _read_frames(path: Path, variable: str, schema: ArraySchema) -> np.ndarray:
    """A variable of a MATLAB file of version 5 to 7, its last axis first; InputError if file or variable is not as expected."""
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    problem = "not a complete MATLAB file; download it again"
    found = read_with(lambda file: loadmat(file, variable_names=[variable]), path, problem)
    expect(variable in found, str(path), f"a variable {variable}")
    stored = found[variable]
    check_array(f"{path}: {variable}", stored.shape, stored.dtype, schema)
    expect(stored.size > 0, f"{path}: {variable}", "at least one frame")
    return stored.transpose(2, 0, 1)


def shift_labels(skeleton_m: np.ndarray, lag: int, frames: int) -> np.ndarray:
    """(T, 20, 3): row t + lag of the skeleton for each depth frame t, NaN beyond either end."""
    rows = np.arange(frames) + lag
    inside = (rows >= 0) & (rows < len(skeleton_m))
    out = np.full((frames, *skeleton_m.shape[1:]), np.nan)
    out[inside] = skeleton_m[rows[inside]]
    return out


def estimate_lag(depth_m: np.ndarray, skeleton_m: np.ndarray) -> int:
    """The lag in CANDIDATE_LAGS with the smallest mean distance of labelled wrists and hands from the depth points.

    Hands move fastest and are thin, so their distance from the surface depends most on the lag. All lags are compared on
    the same depth frames. In a sequence in which the hands hardly move, all lags fit nearly equally well, and the choice
    has little effect. The (T, H, W) depth and the (S, 20, 3) skeleton, NaN where absent, are mirrored as stored, metres.
    """
    # (T, L, 4, 3)
    labels = np.stack([shift_labels(skeleton_m, lag, len(depth_m))[:, LAG_JOINTS] for lag in CANDIDATE_LAGS], axis=1)
    usable = np.isfinite(labels).all(axis=(1, 2, 3)) & depth_m.any(axis=(1, 2))
    if not usable.any():
        return -2  # the most frequent lag in the set
    # Trees that are quick to build: each answers 16 queries.
    distances = [
        cKDTree(_surface(image), compact_nodes=False, balanced_tree=False).query(candidates)[0].mean(axis=-1)
        for image, candidates in zip(depth_m[usable], labels[usable], strict=True)
    ]
    return CANDIDATE_LAGS[int(np.argmin(np.mean(distances, axis=0)))]


def _surface(depth_m: np.ndarray) -> np.ndarray:
    """(N, 3) points in metres of the measured pixels of an image."""
    v, u = np.nonzero(depth_m)
    return STORED_CAMERA.back_project(np.stack([u.astype(np.float32), v.astype(np.float32), depth_m[v, u]], axis=-1))
