"""Joints of a webcam's learner: a small network lifts what MediaPipe finds in a picture to where the joints are.

MediaPipe places a person's points in the picture to within some centimetres, but how far each is before or behind the body it
guesses, and it holds a wrong guess for seconds. The network reads the joints in the picture, MediaPipe's guess and its
visibility; it answers the joints and a confidence. Pictures before told it nothing more (docs/ledger.md). Everything is in the
ray's frame: z along the ray from the camera to the middle of the hips, x right and level in the picture, y down.

tools/fit_lifting.py trains it on simulated people; the weights come with the package.
"""

from typing import NamedTuple

import numpy as np

from kpopnet.networks.layers import Layers
from kpopnet.skeleton import NUM_JOINTS, Joint

HIPS = [Joint.RIGHT_HIP, Joint.LEFT_HIP]

READ = 4 * NUM_JOINTS + 1
"""Numbers that the network reads: of each joint its place and visibility, and the ray's elevation."""


class Sighting(NamedTuple):
    """What one picture says of a person's joints, in the ray's frame; or pictures, along leading axes."""

    # (..., 15, 3) about the middle of the hips: x and y of the picture, at the person's distance; z guessed
    points_m: np.ndarray
    visibility: np.ndarray  # (..., 15) in 0..1
    elevation_rad: np.ndarray  # (...) of the ray, above the camera's axis

    def numbers(self) -> np.ndarray:
        """(..., READ) float32 what the network reads."""
        flat_m = self.points_m.reshape(*self.visibility.shape[:-1], -1)
        return np.concatenate([flat_m, self.visibility, self.elevation_rad[..., None]], axis=-1, dtype=np.float32)


def sighting(world_m: np.ndarray, rays: np.ndarray, visibility: np.ndarray, distance_m: float) -> tuple[Sighting, np.ndarray]:
    """A picture's sighting, and the (3, 3) rotation from the camera's frame to the ray's.

    Takes the (15, 3) joints that MediaPipe guesses, metres, the (15, 2) places of the joints in the image at 1 m before the
    camera, and how far away the person is. MediaPipe sees a crop around the person: its z is taken for one along the ray.
    """
    ray = np.append(rays[HIPS].mean(axis=0), 1.0)
    to_ray = frame_along(ray)
    turned = np.column_stack([rays, np.ones(NUM_JOINTS)]) @ to_ray.T
    across_m = turned[:, :2] / turned[:, 2:] * distance_m
    depth_m = world_m[:, 2:] - world_m[HIPS, 2].mean()
    elevation_rad = -np.arctan2(ray[1], np.hypot(ray[0], ray[2]))
    return Sighting(np.concatenate([across_m, depth_m], axis=1), visibility, np.asarray(elevation_rad)), to_ray


def frame_along(ray: np.ndarray) -> np.ndarray:
    """(3, 3) rotation to the frame whose z is a (3,) ray of the camera's frame, and whose x is level in the picture."""
    z = ray / np.linalg.norm(ray)
    x = np.cross((0.0, 1.0, 0.0), z)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z])


class Lifting(Layers):
    """The network, from its arrays by name: it adds what it has learnt to the points."""

    OTHERWISE = "no network that lifts joints"

    def __init__(self, arrays: dict[str, np.ndarray]) -> None:
        super().__init__(arrays)
        if self.inputs != READ:
            raise ValueError(f"reads {self.inputs} numbers, not {READ}")

    def __call__(self, seen: Sighting) -> tuple[np.ndarray, np.ndarray]:
        """(..., 15, 3) joints about the torso, metres, in the ray's frame, and (..., 15) their confidence: the chance of an
        error below 10 cm.
        """
        out = self.through(seen.numbers())
        moved_m = out[..., : 3 * NUM_JOINTS].reshape(seen.points_m.shape)
        joints_m = seen.points_m - seen.points_m[..., [Joint.TORSO], :] + moved_m
        return joints_m, 1 / (1 + np.exp(-out[..., 3 * NUM_JOINTS :]))
