"""Several people at a time: crossing, hugging, leaving and coming back; a tracker for each."""

from itertools import pairwise

import numpy as np
from two_people_files import CAMERA, WALL_M, draw_people

from kpopnet.pose import PersonPose, PoseEstimator
from kpopnet.sources.source import TimedDepth

STILL = 6


def film(*paths: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(P, T, 15, 3) true joints and (T, H, W) uint16 millimetres of people who glide along (T, 2) paths of x and z, metres."""
    depth_mm, joints_m, _ = draw_people(np.stack(paths, axis=1))
    return joints_m.swapaxes(0, 1), depth_mm


def path(*stations: tuple[float, float], step_m: float = 0.04) -> np.ndarray:
    """(T, 2) x and z: a straight way from station to station, after `STILL` frames at the first."""
    points = [np.repeat([stations[0]], STILL, axis=0)]
    for a, b in pairwise(stations):
        points.append(np.linspace(a, b, max(2, round(np.linalg.norm(np.subtract(b, a)) / step_m))))
    return np.concatenate(points)


def people_in(depth: np.ndarray) -> list[PersonPose]:
    return PoseEstimator.load(mode="tracker", people=2).estimate(depth, CAMERA)


def of(joints: np.ndarray, people: list[PersonPose], frame: int) -> PersonPose:
    """The person who is nearest to these true (T, 15, 3) joints in a frame."""
    return min(people, key=lambda one: np.nan_to_num(error_m(one, joints)[frame].mean(), nan=9.0))


def present(people: list[PersonPose], frame: int) -> int:
    return sum(np.isfinite(one.joints_camera_m[frame]).all() for one in people)


def error_m(person: PersonPose, joints: np.ndarray) -> np.ndarray:
    return np.linalg.norm(person.joints_camera_m - joints, axis=-1)


def test_people_who_hug_stay_two_and_are_told_apart_afterwards() -> None:
    joints, depth = film(path((-0.8, 2.8), (-0.22, 2.8), (-0.8, 2.8)), path((0.8, 2.8), (0.22, 2.8), (0.8, 2.8)))
    people = people_in(depth)
    assert present(people, -1) == 2
    for true in joints:
        assert of(true, people, 12) is of(true, people, -1)
        assert np.median(error_m(of(true, people, -1), true)[-5:]) < 0.08


def test_one_who_leaves_is_missing_and_the_other_is_not_disturbed() -> None:
    leaving = path((0.4, 2.6), (2.4, 2.6), step_m=0.06)
    swaying = path((-0.6, 2.8), (-0.3, 2.8), (-0.6, 2.8), (-0.3, 2.8), step_m=0.03)
    joints, depth = film(leaving[: len(swaying)], swaying[: len(leaving)])
    people = people_in(depth)
    left, stayed = of(joints[0], people, 10), of(joints[1], people, 20)
    assert np.isfinite(left.joints_camera_m[10]).all() and np.isnan(left.joints_camera_m[-1]).all()
    assert left.confidence[-1].max() == 0
    assert np.median(error_m(stayed, joints[1])[-10:]) < 0.1  # with the lengths of an average adult


def test_who_enters_is_tracked_once_whole_and_well_from_then_on() -> None:
    entering = path((2.3, 2.8), (0.5, 2.8), step_m=0.06)
    swaying = path((-0.8, 2.8), (-0.6, 2.8), (-0.8, 2.8), (-0.6, 2.8), step_m=0.02)[: len(entering)]
    joints, depth = film(entering[: len(swaying)], swaying)
    person = of(joints[0], people_in(depth), -1)
    first = np.flatnonzero(np.isfinite(person.joints_camera_m).all(axis=(1, 2)))[0]
    assert 0 < CAMERA.project(joints[0, first])[:, 0].max() < CAMERA.width
    assert np.median(error_m(person, joints[0])[first:]) < 0.08


def test_after_a_stall_of_the_camera_a_person_is_tracked_where_they_are() -> None:
    """Far away they show a third of what they showed nearby, as if hidden, but the pose of three seconds ago is not held."""
    paths = np.array([[(-0.6, 2.6)] * 4 + [(0.4, 4.0)] * 2])
    joints, depth = film(*paths)
    images = [np.where(image < 1000 * WALL_M, image, 0).astype(np.uint16) for image in depth]
    times_s = np.arange(6) / 30 + np.where(np.arange(6) < 4, 0, 3)
    recording = [TimedDepth(time_s, image) for time_s, image in zip(times_s, images, strict=True)]
    (person,) = PoseEstimator(None, "tracker").estimate(recording, CAMERA, segmented=True)
    assert error_m(person, joints[0]).mean(axis=1).max() < 0.1
