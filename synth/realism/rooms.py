"""People who stick in the furniture or walls of their rooms: the generator's geometry, drawn again for stored samples."""

from collections.abc import Iterable
from dataclasses import is_dataclass
from typing import Any, get_type_hints

import numpy as np
from tqdm import tqdm

from kpopnet.data.shards import ShardedSet
from kpopnet.errors import InputError
from synth.samples.sampler import SampleConfig, Sampler
from synth.scene.room import Room

TOUCH_M = 0.02
"""A vertex that lies deeper in a box intersects it; the distance of a pixel's neighbours at 5 m."""

WALLS, FURNITURE = (1, 4), (4, None)
"""The boxes of a room: first the floor, then three walls, then furniture."""


def overlaps(shards: ShardedSet, indices: Iterable[int]) -> np.ndarray:
    """(N, 2) bool for each of N samples: whether the body intersects furniture, and whether it intersects a wall.

    Args:
        shards: samples that this version of the generator has made.
        indices: of the samples to draw again.

    Raises:
        InputError: the settings cannot be built, or this version draws other samples.
    """
    header = shards.header
    sampler = Sampler(_sample_config(shards), header.seed, header.split)
    found = []
    try:
        for index in tqdm(list(indices), "rooms", disable=None):
            for drawn in sampler.samples(index, index + 1):
                if not np.allclose(drawn.sample.joints_camera_m, shards[index].joints_camera_m, atol=1e-3, equal_nan=True):
                    raise InputError(
                        f"{shards.folder}: this version of the generator draws other samples; generate the set anew"
                    )
                vertices_m = sampler.renderer.vertices_world_m()
                room = sampler.room(sampler.room_of(index)).room
                furniture, wall = (is_inside(room, vertices_m, *boxes) for boxes in (FURNITURE, WALLS))
                found.append([furniture, wall])
    finally:
        sampler.close()
    return np.array(found, bool).reshape(-1, 2)


def is_inside(room: Room, points_world_m: np.ndarray, first: int, last: int | None) -> bool:
    """Whether any of (N, 3) points lies more than TOUCH_M inside any of the boxes first to last - 1."""
    boxes = (array[first:last] for array in (room.centres_m, room.halves_m, room.yaws_rad))
    for centre_m, half_m, yaw_rad in zip(*boxes, strict=True):
        x, y, z = (np.asarray(points_world_m, np.float64) - centre_m).T
        cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
        own_m = np.stack([cos * x + sin * y, cos * y - sin * x, z], axis=1)
        if (np.abs(own_m) < np.asarray(half_m) - TOUCH_M).all(axis=1).any():
            return True
    return False


def _sample_config(shards: ShardedSet) -> SampleConfig:
    try:
        return _built(SampleConfig, shards.header.config["sample"])
    except (KeyError, TypeError, AttributeError) as error:
        raise InputError(
            f"{shards.folder}: this version has other settings than the generator of the set ({error}); generate it anew"
        ) from error


def _built(kind: type, values: dict[str, Any]) -> Any:
    """A settings dataclass, nested, from the JSON that `dataclasses.asdict` gave.

    The JSON of a set has sorted keys, but a mix of motions draws by the order of its weights: that of the defaults comes first.
    """
    hints, arguments = get_type_hints(kind), {}
    for name, value in values.items():
        hint = hints[name]
        if isinstance(hint, type) and is_dataclass(hint):
            arguments[name] = _built(hint, value)
        elif isinstance(value, dict):
            usual = [key for key in getattr(kind(), name) if key in value]
            arguments[name] = {key: value[key] for key in dict.fromkeys([*usual, *value])}
        else:
            arguments[name] = tuple(value) if isinstance(value, list) else value
    return kind(**arguments)
