"""Films of the script of `kpopnet check`: the person does what the script says, on the floor, on the seat and out of view."""

import numpy as np
import pytest
from stand_ins import joints_world_m

from kpopnet.datasets.check_script import END_S, step_s
from kpopnet.skeleton import Joint
from synth.simulated.check_sim import FPS, SAT_S, CheckSim, CheckSimConfig
from synth.simulated.film import Studio
from synth.simulated.room_films import RoomTake

INDEX = 1
HIPS, FEET, HANDS = ([Joint[f"{side}_{one}"] for side in ("LEFT", "RIGHT")] for one in ("HIP", "FOOT", "HAND"))


@pytest.fixture(scope="module")
def maker() -> CheckSim:
    return CheckSim(CheckSimConfig(seed=5))


@pytest.fixture(scope="module")
def take(maker: CheckSim) -> RoomTake:
    return maker.take(INDEX)


@pytest.fixture(scope="module")
def joints_m(take: RoomTake) -> np.ndarray:
    """(T, 15, 3) in the world, metres."""
    return joints_world_m(Studio(take.camera, "cpu"), take.actors[0])


def during(step: str, margin_s: float = 0.0) -> slice:
    start_s, end_s = step_s(step)
    return slice(round((start_s + margin_s) * FPS), round((end_s - margin_s) * FPS))


def test_the_person_does_what_the_script_says(joints_m: np.ndarray) -> None:
    assert len(joints_m) == END_S * FPS
    assert np.ptp(joints_m[during("stand still")], axis=0).max() < 0.05
    assert np.ptp(joints_m[during("turn"), Joint.TORSO], axis=0).max() < 0.25
    across = joints_m[:, Joint.LEFT_SHOULDER, :2] - joints_m[:, Joint.RIGHT_SHOULDER, :2]
    heading = np.unwrap(np.arctan2(across[:, 1], across[:, 0]))[during("turn")]
    assert abs(heading[-1] - heading[0]) == pytest.approx(2 * np.pi, abs=0.1)
    highest = joints_m[during("raise hands"), :, 2].max(axis=0)
    assert (highest[HANDS] > highest[Joint.HEAD] + 0.3).all()
    sat = joints_m[round(SAT_S[0] * FPS) : round(SAT_S[1] * FPS)]
    assert ((sat[:, HIPS, 2] > 0.35) & (sat[:, HIPS, 2] < 0.65)).all() and np.ptp(sat[:, HIPS], axis=0).max() < 0.05


def test_nothing_jumps_and_feet_are_on_the_floor(take: RoomTake, joints_m: np.ndarray) -> None:
    assert np.linalg.norm(np.diff(joints_m, axis=0), axis=-1).max() * FPS < 6
    assert joints_m[:, FEET, 2].min(axis=1).max() < 0.13
    standing = joints_m[during("stand still")]
    assert np.ptp(standing[:, FEET], axis=0).max() < 0.01
    assert np.abs(take.actors[0].played.skin_m[:, 2].min()) < 0.01


def test_the_room_is_empty_when_it_should_be_and_the_person_whole_when_they_stand(maker: CheckSim, take: RoomTake) -> None:
    numbers = [0, *(round(one * FPS) for one in (7.9, 17.0, 30.0, 37.0, 50.0, 59.0))]
    shots = [next(maker.shots(INDEX, take, range(number, number + 1))) for number in numbers]
    assert [shot["seen_px"][0] == 0 for shot in shots] == [True, True, False, False, False, True, False]
    for shot in (shots[2], shots[4], shots[6]):
        assert shot["seen_px"][0] > 0.95 * shot["whole_px"][0]


def test_people_rooms_and_cameras_take_turns() -> None:
    maker = CheckSim(CheckSimConfig(seed=5, cameras=["kinect_2", "realsense"], sequences=10))
    assert [maker.kind(index) for index in range(3)] == ["kinect_2", "realsense", "kinect_2"]
    assert [maker.first_person(index) for index in range(10)] == [0, 0, 1, 1, 2, 2, 3, 3, 4, 4]
    one, other = (maker.take(index) for index in (0, 2))
    assert one.actors[0].played.person.leg_m == maker.person(0).leg_m != other.actors[0].played.person.leg_m
    assert one.views[0].position_m[2] != other.views[0].position_m[2]
