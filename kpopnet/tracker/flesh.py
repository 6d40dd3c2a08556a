"""How thick people are: the tracker's body, fitted to people whose joints are known.

    python -m kpopnet.tracker.flesh data/small/train

prints what `kpopnet.tracker.body` calls RADII_M and PLACES_M: the least-squares fit of the parts' surface to the points
that were seen, robust to what belongs to no body. By how much each person is thicker or thinner in each part is fitted
beside it and forgotten, since the tracker measures it (`kpopnet.tracker.surface.with_thickness`).
"""

import argparse
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor
from tqdm import tqdm, trange

from kpopnet.camera import Camera, depth_in_metres
from kpopnet.entry import user_errors
from kpopnet.errors import InputError
from kpopnet.shards import ShardedSet
from kpopnet.skeleton import NUM_JOINTS, Joint
from kpopnet.tracker import body
from kpopnet.tracker.body import (
    KIND_OF_PART,
    PARTS,
    PLACE_JOINTS,
    PLACES_M,
    RADII_M,
    REFERENCE_SIZE_M,
    RIGHT_CHEST,
    size_m,
)
from kpopnet.tracker.cells import FEWEST_CELLS, cells_of
from kpopnet.tracker.cones import extend, frame_of
from kpopnet.tracker.fitting import ROBUST_M
from kpopnet.tracker.model import HumanModel

PEOPLE, PICTURES = 300, 5
"""So many people of a set, evenly spaced, and so many pictures of each."""

STEPS, BATCH, RATE_M = 1000, 24, 0.003
THINNEST_M, THICKEST_M = 0.015, 0.25

ROW_NAMES = {row: name for name, row in vars(body).items() if name.startswith("RIGHT_") and isinstance(row, int)}

OTHERWISE = 1.0
"""Against 1 for all points: what it costs a person to be thicker or thinner than others, by the mean square of it."""


class Picture(NamedTuple):
    """One person as seen once.

    Attributes:
        person: number of the person.
        scale: their size.
        rows_m: (25, 3) as of `kpopnet.tracker.cones.extend`, but places in the trunk are where their joints are.
        frame: (3, 3) the torso's right, down and front.
        points_m: (N, 3) what was seen, in the camera frame as the rows.
    """

    person: int
    scale: float
    rows_m: Tensor
    frame: Tensor
    points_m: Tensor


def picture_of(person: int, joints_m: np.ndarray, depth_m: np.ndarray, camera: Camera) -> Picture | None:
    """A (H, W) picture of a person alone with (15, 3) known joints; None if next to nothing is seen of them."""
    cells = cells_of(depth_m, camera)
    if len(cells.points_m) < FEWEST_CELLS:
        return None
    rows_m = extend(joints_m, np.zeros((len(PLACE_JOINTS), 3)))
    scale = size_m(HumanModel.from_joints(joints_m)) / REFERENCE_SIZE_M
    return Picture(person, scale, *map(torch.tensor, (rows_m, frame_of(joints_m), cells.points_m)))


def pictures_of(people: ShardedSet) -> list[Picture]:
    """Pictures of evenly spaced people of a set.

    Raises:
        InputError: nobody is seen in it.
    """
    of_body = people.column("body")
    first = np.flatnonzero(np.diff(of_body, prepend=-1))
    chosen = first[np.linspace(0, len(first) - 1, min(PEOPLE, len(first))).astype(int)]
    found = []
    for person, start in enumerate(tqdm(chosen, unit="person", desc=str(people.folder))):
        for index in range(start, min(start + PICTURES, len(people))):
            if of_body[index] == of_body[start]:
                sample = people[index]
                depth_m = depth_in_metres(sample.depth_mm[None], people.camera)[0]
                found.append(picture_of(person, sample.joints_camera_m.astype(np.float64), depth_m, people.camera))
    seen = [picture for picture in found if picture is not None]
    if not seen:
        raise InputError(f"{people.folder}: nobody is seen in it")
    return seen


class Flesh(torch.nn.Module):
    """The right half of the body as parameters, in the order of RADII_M and PLACES_M.

    Attributes:
        radii_m: (K, 2) thickness of each kind of part.
        places_m: (3, 3) ways to the places in the trunk.
        otherwise_m: (people, K) how much thicker each person is.
    """

    def __init__(self, people: int) -> None:
        super().__init__()
        self.radii_m = torch.nn.Parameter(torch.tensor(list(RADII_M.values()), dtype=torch.float64))
        self.places_m = torch.nn.Parameter(torch.tensor([way for _, way in PLACES_M.values()], dtype=torch.float64))
        self.otherwise_m = torch.nn.Parameter(torch.zeros(people, len(RADII_M), dtype=torch.float64))

    def off_surface_m(self, picture: Picture) -> Tensor:
        """(N,) signed distances of a picture's points to the surface of all parts together."""
        right_m = picture.scale * self.places_m
        ways_m = torch.stack([right_m, right_m * right_m.new_tensor((-1, 1, 1))], dim=1).reshape(-1, 3)
        rows_m = torch.cat([picture.rows_m[:RIGHT_CHEST], picture.rows_m[RIGHT_CHEST:] + ways_m @ picture.frame])
        radii_m = picture.scale * (self.radii_m + self.otherwise_m[picture.person, :, None])[KIND_OF_PART]
        first_m, axis_m = rows_m[PARTS[:, 0]], rows_m[PARTS[:, 1]] - rows_m[PARTS[:, 0]]
        from_first_m = picture.points_m[:, None] - first_m
        along = ((from_first_m * axis_m).sum(-1) / axis_m.square().sum(-1)).clamp(0, 1)
        off_axis_m = (from_first_m - along[..., None] * axis_m).norm(dim=-1)
        return (off_axis_m - radii_m[:, 0] - along * (radii_m[:, 1] - radii_m[:, 0])).min(dim=1).values


def fitted(pictures: list[Picture], steps: int = STEPS, seed: int = 0) -> Flesh:
    """The flesh that is nearest to the points, from that of `kpopnet.tracker.body` on."""
    flesh = Flesh(1 + max(picture.person for picture in pictures))
    optimiser = torch.optim.Adam(flesh.parameters(), lr=RATE_M)
    slower = torch.optim.lr_scheduler.LambdaLR(optimiser, lambda step: 1 - step / steps)
    drawn = np.random.default_rng(seed)
    for _ in trange(steps, unit="step", desc="flesh"):
        squared = [flesh.off_surface_m(pictures[k]).square() for k in drawn.integers(len(pictures), size=BATCH)]
        loss = torch.stack([(s * ROBUST_M**2 / (ROBUST_M**2 + s)).mean() for s in squared]).mean()
        loss = loss + OTHERWISE * flesh.otherwise_m.square().mean()
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        slower.step()
        with torch.no_grad():
            flesh.radii_m.clamp_(THINNEST_M, THICKEST_M)
    return flesh


def _named(row: int) -> str:
    return f"Joint.{Joint(row).name}" if row < NUM_JOINTS else ROW_NAMES[row]


@user_errors
def program() -> None:
    """See the head of this file."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", help="a split's folder of a set that python -m synth made")
    pictures = pictures_of(ShardedSet(parser.parse_args().folder))
    before, flesh = Flesh(1 + pictures[-1].person), fitted(pictures)
    for (a, b), radii_m in zip(RADII_M, flesh.radii_m.tolist(), strict=True):
        print(f"    ({_named(a)}, {_named(b)}): ({radii_m[0]:.3f}, {radii_m[1]:.3f}),")
    for (row, (joint, _)), way_m in zip(PLACES_M.items(), flesh.places_m.tolist(), strict=True):
        print(f"    {_named(row)}: ({_named(joint)}, ({', '.join(f'{c:.3f}' for c in way_m)})),")
    with torch.no_grad():
        for name, some in (("before", before), ("now", flesh)):
            off_m = torch.cat([some.off_surface_m(picture) for picture in pictures]).abs()
            mean_cm, half_cm = 100 * off_m.mean(), 100 * off_m.median()
            print(f"{name}: points are {mean_cm:.2f} cm off the surface on average, half of them less than {half_cm:.2f}")


if __name__ == "__main__":
    program()
