r"""Fits the thickness of the tracker's body to simulated people with known joints.

    python -m synth preset=demo splits.train=2400 splits.validation=0 splits.test=0 props.seat=0 props.held=0 \
        props.second_person=0 body.clothes.backpack=0 body.clothes.bag=0 body.clothes.long_hair=0 out=data/body_shape
    PYTHONPATH=. python tools/body_shape.py data/body_shape/train

prints new values of RADII_M, TRUNK_OFFSETS_M and REFERENCE_SIZE_M in `kpopnet.geometry.body`: a robust least-squares fit of the
parts' surface to the visible points. Bags and long hair on a back would pull a trunk point 20 cm behind
it. Each person's own thickness offset per part is fitted at the same time and discarded, since the tracker measures it
(`kpopnet.tracker.body_estimate.fit_thickness`).
"""

import argparse
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor
from tqdm import tqdm, trange

from kpopnet.camera import Camera, depth_in_metres
from kpopnet.data.shards import ShardedSet
from kpopnet.errors import InputError
from kpopnet.geometry import body
from kpopnet.geometry.body import (
    PART_KIND,
    PARTS,
    RADII_M,
    REFERENCE_SIZE_M,
    RIGHT_CHEST,
    TRUNK_OFFSETS_M,
    TRUNK_POINT_JOINTS,
    size_m,
)
from kpopnet.geometry.cones import extend_joints, torso_frame
from kpopnet.geometry.depth_grid import MIN_POINTS, build_depth_grid
from kpopnet.geometry.human_model import HumanModel
from kpopnet.runtime.hydra_app import user_errors
from kpopnet.skeleton import NUM_JOINTS, Joint
from kpopnet.tracker.fit import ROBUST_SCALE_M

MAX_PEOPLE, FRAMES_PER_PERSON = 300, 5
"""Number of people, evenly spaced in the set, and of images of each."""

TRAINING_STEPS, BATCH_SIZE, LEARNING_RATE_M = 1000, 24, 0.003
MIN_RADIUS_M, MAX_RADIUS_M = 0.015, 0.25
"""Limits of the radii in metres."""

ROW_NAMES = {row: name for name, row in vars(body).items() if name.startswith("RIGHT_") and isinstance(row, int)}

VARIATION_WEIGHT = 1.0
"""Weight of the mean squared thickness offset of the people, relative to 1 for all points."""


class Frame(NamedTuple):
    """One image of one person."""

    person: int  # number of the person
    scale: float  # size of the person relative to `REFERENCE_SIZE_M`
    rows_m: Tensor  # (25, 3) from `kpopnet.geometry.cones.extend_joints` in metres, with the trunk points at their joints
    torso_axes: Tensor  # (3, 3) the torso's right, down and front
    points_m: Tensor  # (N, 3) visible points in the camera frame in metres


def observe(person: int, joints_m: np.ndarray, depth_m: np.ndarray, camera: Camera) -> Frame | None:
    """A frame from an (H, W) depth image of a person with (15, 3) known joints, metres; None with too few visible points."""
    grid = build_depth_grid(depth_m, camera)
    if len(grid.points_m) < MIN_POINTS:
        return None
    rows_m = extend_joints(joints_m, np.zeros((len(TRUNK_POINT_JOINTS), 3)))
    scale = size_m(HumanModel.from_joints(joints_m)) / REFERENCE_SIZE_M
    return Frame(person, scale, *map(torch.tensor, (rows_m, torso_frame(joints_m), grid.points_m)))


def load_frames(people: ShardedSet) -> list[Frame]:
    """Images of evenly spaced people of a set; raises InputError if no person is visible in any."""
    body_ids = people.column("body")
    first_samples = np.flatnonzero(np.diff(body_ids, prepend=-1))
    starts = first_samples[np.linspace(0, len(first_samples) - 1, min(MAX_PEOPLE, len(first_samples))).astype(int)]
    frames = []
    for person, start in enumerate(tqdm(starts, unit="person", desc=str(people.folder))):
        for index in range(start, min(start + FRAMES_PER_PERSON, len(people))):
            if body_ids[index] == body_ids[start]:
                sample = people[index]
                depth_m = depth_in_metres(sample.depth_mm[None], people.camera)[0]
                frames.append(observe(person, sample.joints_camera_m.astype(np.float64), depth_m, people.camera))
    visible = [frame for frame in frames if frame is not None]
    if not visible:
        raise InputError(f"{people.folder}: no person is visible in any image")
    return visible


class BodySurface(torch.nn.Module):
    """The right half of the body as parameters in metres, in the order of RADII_M and TRUNK_OFFSETS_M."""

    def __init__(self, people: int) -> None:
        super().__init__()
        offsets_m = [offset for _, offset in TRUNK_OFFSETS_M.values()]
        self.radii_m = torch.nn.Parameter(torch.tensor(list(RADII_M.values()), dtype=torch.float64))  # (K, 2)
        self.trunk_offsets_m = torch.nn.Parameter(torch.tensor(offsets_m, dtype=torch.float64))  # (3, 3)
        self.thickness_offset_m = torch.nn.Parameter(torch.zeros(people, len(RADII_M), dtype=torch.float64))  # to the radii

    def signed_distance_m(self, frame: Frame) -> Tensor:
        """(N,) signed distances in metres of a frame's points to the surface of the union of all parts."""
        right_m = frame.scale * self.trunk_offsets_m
        offsets_m = torch.stack([right_m, right_m * right_m.new_tensor((-1, 1, 1))], dim=1).reshape(-1, 3)
        rows_m = torch.cat([frame.rows_m[:RIGHT_CHEST], frame.rows_m[RIGHT_CHEST:] + offsets_m @ frame.torso_axes])
        radii_m = frame.scale * (self.radii_m + self.thickness_offset_m[frame.person, :, None])[PART_KIND]
        first_m, axis_m = rows_m[PARTS[:, 0]], rows_m[PARTS[:, 1]] - rows_m[PARTS[:, 0]]
        from_first_m = frame.points_m[:, None] - first_m
        along = ((from_first_m * axis_m).sum(-1) / axis_m.square().sum(-1)).clamp(0, 1)
        off_axis_m = (from_first_m - along[..., None] * axis_m).norm(dim=-1)
        return (off_axis_m - radii_m[:, 0] - along * (radii_m[:, 1] - radii_m[:, 0])).min(dim=1).values


def fit_surface(frames: list[Frame]) -> BodySurface:
    """Fits the body's surface to the points of all frames, starting from that of `kpopnet.geometry.body`."""
    surface = BodySurface(1 + max(frame.person for frame in frames))
    optimiser = torch.optim.Adam(surface.parameters(), lr=LEARNING_RATE_M)
    schedule = torch.optim.lr_scheduler.LambdaLR(optimiser, lambda step: 1 - step / TRAINING_STEPS)
    generator = np.random.default_rng(0)
    for _ in trange(TRAINING_STEPS, unit="step", desc="body shape"):
        squared = [surface.signed_distance_m(frames[k]).square() for k in generator.integers(len(frames), size=BATCH_SIZE)]
        loss = torch.stack([(s * ROBUST_SCALE_M**2 / (ROBUST_SCALE_M**2 + s)).mean() for s in squared]).mean()
        loss = loss + VARIATION_WEIGHT * surface.thickness_offset_m.square().mean()
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        schedule.step()
        with torch.no_grad():
            surface.radii_m.clamp_(MIN_RADIUS_M, MAX_RADIUS_M)
    return surface


def _named(row: int) -> str:
    """Source text of a row: a joint or a trunk point."""
    return f"Joint.{Joint(row).name}" if row < NUM_JOINTS else ROW_NAMES[row]


@user_errors
def program() -> None:
    """Command line, described in the module's docstring."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", help="folder of a split that python -m synth wrote")
    frames = load_frames(ShardedSet(parser.parse_args().folder))
    initial, surface = BodySurface(1 + frames[-1].person), fit_surface(frames)
    for (a, b), radii_m in zip(RADII_M, surface.radii_m.tolist(), strict=True):
        print(f"    ({_named(a)}, {_named(b)}): ({radii_m[0]:.3f}, {radii_m[1]:.3f}),")
    for (row, (joint, _)), offset_m in zip(TRUNK_OFFSETS_M.items(), surface.trunk_offsets_m.tolist(), strict=True):
        print(f"    {_named(row)}: ({_named(joint)}, ({', '.join(f'{c:.3f}' for c in offset_m)})),")
    reference_m = REFERENCE_SIZE_M * np.mean([frame.scale for frame in frames])
    print(f"REFERENCE_SIZE_M = {reference_m:.2f}")
    with torch.no_grad():
        for name, shape in (("before", initial), ("after", surface)):
            distance_m = torch.cat([shape.signed_distance_m(frame) for frame in frames]).abs()
            mean_cm, median_cm = 100 * distance_m.mean(), 100 * distance_m.median()
            print(f"{name}: distance of the points to the surface: mean {mean_cm:.2f} cm, median {median_cm:.2f} cm")


if __name__ == "__main__":
    program()
