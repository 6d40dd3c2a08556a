"""The compiled test for bodies in boxes against a plain one, on random bodies and rooms and on constructed cases."""

import numpy as np
import pytest

from synth.scene.mesh import about_z
from synth.scene.room import LIVING_ROOM, draw_room, overlaps_boxes


def overlaps_plainly(vertices_m, place_m, centres_m, halves_m, yaws_rad, clearance_m) -> bool:
    for centre, half, yaw in zip(centres_m, halves_m, yaws_rad, strict=True):
        if (np.abs((vertices_m + place_m - centre) @ about_z(yaw)) < half + clearance_m).all(axis=1).any():
            return True
    return False


@pytest.mark.parametrize("seed", range(3))
def test_the_compiled_test_equals_a_plain_one(seed: int) -> None:
    rng = np.random.default_rng(seed)
    room = draw_room(rng, LIVING_ROOM)
    boxes = room.centres_m[1:], room.halves_m[1:], room.yaws_rad[1:]
    body = (rng.normal(size=(60, 3)) * (0.15, 0.15, 0.3)).astype(np.float32)
    found = []
    for _ in range(40):
        place_m = rng.uniform((-3.5, 0.5, 0.2), (3.5, 7, 1.0))
        for clearance_m in (0.0, 0.1):
            found.append(overlaps_boxes(body, place_m, *boxes, clearance_m))
            assert found[-1] == overlaps_plainly(body, place_m, *boxes, clearance_m)
    assert 0 < sum(found) < len(found)
