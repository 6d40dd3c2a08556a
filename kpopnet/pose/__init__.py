"""Joints of people in the depth images of one's own camera: the API of a few lines.

from kpopnet.camera import Camera
from kpopnet.pose import PoseEstimator

estimator = PoseEstimator.load()                    # the weights that come with the package
camera = Camera.from_fov(58, 320, 240)
people = estimator.estimate(depth, camera)          # (T, H, W) uint16 millimetres or float metres of a room
people[0].joints_camera_m, people[0].confidence     # (T, 15, 3) metres, (T, 15) probability of being within 10 cm

`PoseEstimator.load(mode="tracker", people=2)` needs no network: each person is followed by a body tracker.
"""

from kpopnet.pose.estimator import PersonPose, PoseEstimator

__all__ = ["PersonPose", "PoseEstimator"]
