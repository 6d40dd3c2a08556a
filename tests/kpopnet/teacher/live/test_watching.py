"""Cameras, the newest image, and who the learner is."""

import threading
import time

import numpy as np

from kpopnet.camera import CAMERAS
from kpopnet.pose import PersonPose
from kpopnet.teacher.live.watching import Learner, NewestImage


class Counting:
    """A camera whose images count; it takes one whenever it is told to."""

    camera = CAMERAS["kinect_v1"]

    def __init__(self, images: int) -> None:
        self.allowed, self.taken, self.images = threading.Semaphore(0), 0, images

    def read(self):
        self.allowed.acquire(timeout=5)
        if self.taken == self.images:
            return None
        self.taken += 1
        return np.full((2, 2), self.taken, np.float32), time.monotonic()

    def close(self) -> None:
        self.allowed.release()


def test_the_newest_image_wins_and_the_others_are_dropped():
    camera = Counting(5)
    images = NewestImage(camera)
    camera.allowed.release(4)
    while camera.taken < 4 or images.dropped < 3:
        time.sleep(0.01)
    assert images.fetch(1.0).depth_m[0, 0] == 4 and images.dropped == 3
    assert images.fetch(0.01) is None and not images.ended
    camera.allowed.release(2)
    assert images.fetch(5.0).depth_m[0, 0] == 5
    while not images.ended:
        time.sleep(0.01)
    assert images.error is None
    images.close()


def test_a_camera_that_fails_is_told():
    class Broken(Counting):
        def read(self):
            raise OSError("unplugged")

    images = NewestImage(Broken(1))
    assert images.fetch(5.0) is None and images.ended and "unplugged" in images.error
    images.close()


def person(identity: int, x_m: float) -> PersonPose:
    return PersonPose(identity, np.full((15, 3), x_m, np.float32), np.ones(15, np.float32))


def test_who_stands_in_the_middle_is_the_learner_and_passers_by_do_not_take_over():
    learner = Learner()
    assert learner.choose([], 0.0) is None
    assert learner.choose([person(4, -0.9), person(7, 0.1)], 0.0).identity == 7
    assert learner.choose([person(4, 0.0), person(7, 1.0)], 1.0).identity == 7
    assert learner.choose([person(4, 0.0)], 2.0) is None
    assert learner.choose([person(4, 0.0)], 4.5).identity == 4
    assert learner.choose([person(7, 0.0), person(4, 0.5)], 5.0).identity == 4
