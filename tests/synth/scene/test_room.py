"""The compiled test for bodies in boxes against a plain one, where furniture stands, and what cameras see of the world."""

import numpy as np
import pytest

from synth.scene.mesh import Box, about_z
from synth.scene.room import LIVING_ROOM, ViewConfig, draw_room, draw_view, overlaps_boxes, posed_view


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


def shelf(rng: np.random.Generator) -> list[Box]:
    """A piece whose second box is its back."""
    return [((0, 0, 0.5), (0.5, 0.2, 0.5)), ((0, 0.19, 1.2), (0.5, 0.01, 0.2))]


def test_furniture_stands_inside_the_walls_with_its_back_to_one() -> None:
    pieces = 0
    for seed in range(30):
        room = draw_room(np.random.default_rng(seed), (shelf,))
        far, left, right = room.clear_m()
        for k in range(4, len(room.centres_m), 2):
            corners = np.array([(x, y, 0) for x in (-1, 1) for y in (-1, 1)]) * room.halves_m[k]
            x, y, _ = (corners @ about_z(room.yaws_rad[k]).T + room.centres_m[k]).T
            assert left - 1e-9 <= x.min() and x.max() <= right + 1e-9 and y.max() <= far + 1e-9
            to_wall = min((x.min() - left, 0), (right - x.max(), 1), (far - y.max(), 2))
            assert to_wall[0] < 0.02
            (dx, dy, _), wall = room.centres_m[k + 1] - room.centres_m[k], to_wall[1]
            assert (-dx, dx, dy)[wall] > 0.18
            pieces += 1
    assert pieces > 40


def test_a_camera_looks_down_by_its_pitch_to_the_left_by_its_yaw_and_leans_to_the_right_by_its_roll() -> None:
    ahead, pitch, roll, yaw = np.array([0, 2.0, 0]), 0.3, 0.2, 0.4
    seen = [posed_view(np.zeros(3), *turn).to_camera(ahead) for turn in ((pitch, 0, 0), (0, 0, yaw))]
    np.testing.assert_allclose(seen, [(0, -2 * np.sin(pitch), 2 * np.cos(pitch)), (2 * np.sin(yaw), 0, 2 * np.cos(yaw))])
    # What is above the axis of a camera that leans to the right is to the left in the image.
    leaning = posed_view(np.zeros(3), 0, roll).to_camera(np.array([0, 2.0, 1.0]))
    np.testing.assert_allclose(leaning, (-np.sin(roll), -np.cos(roll), 2), atol=1e-12)


def test_the_floor_of_a_view_is_the_plane_through_the_worlds_floor() -> None:
    rng = np.random.default_rng(3)
    view = draw_view(rng, ViewConfig(roll_deg=40))
    floor = view.floor()
    on_floor = view.to_camera(np.append(rng.normal(size=(5, 2)), np.zeros((5, 1)), axis=1))
    np.testing.assert_allclose(on_floor @ floor[:3] + floor[3], 0, atol=1e-12)
    assert np.linalg.norm(floor[:3]) == pytest.approx(1) and floor[3] == view.position_m[2] > 0
