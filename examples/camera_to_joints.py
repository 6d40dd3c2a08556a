"""From a depth camera to 3D joints, image by image, in a program of your own; `kpopnet predict` does it for recordings.

    python examples/camera_to_joints.py recording.npy --fov 58.6
    python examples/camera_to_joints.py recording.npy --fov 58.6 --people 2 --checkpoint outputs/train/RUN/best

recording.npy stands for the camera here: (T, H, W) depth, uint16 millimetres or float metres, 0
where nothing was measured; any other recording of docs/predicting.md will do. Prints where each person's hands are.
"""

import argparse
from pathlib import Path

from kpopnet.errors import InputError
from kpopnet.pose import PoseEstimator
from kpopnet.skeleton import Joint
from kpopnet.sources import chosen_camera, open_depth

SURE = 0.5
"""Joints are used whose error is probably below 10 cm."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recording", type=Path, help="depth, such as a file of numpy.save")
    parser.add_argument("--fov", type=float, help="horizontal field of view in degrees, if the recording states no camera")
    parser.add_argument("--people", type=int, default=1, help="largest number of people to follow")
    parser.add_argument("--checkpoint", help="folder of a network of your own, used instead of the one that comes along")
    given = parser.parse_args()

    source = open_depth(given.recording, chosen_camera(fov_deg=given.fov))
    estimator = PoseEstimator.load(given.checkpoint, people=given.people)
    for number, (time_s, depth_m) in enumerate(source.timed()):
        for person in estimator.update(depth_m, source.camera, time_s):
            for joint in (Joint.RIGHT_HAND, Joint.LEFT_HAND):
                if person.confidence[joint] > SURE:
                    x, y, z = person.joints_camera_m[joint]
                    name = joint.name.lower().replace("_", " ")
                    print(f"image {number}: person {person.identity}, {name} at {x:.2f}, {y:.2f}, {z:.2f} m")


if __name__ == "__main__":
    try:
        main()
    except InputError as error:  # what was wrong, where, and what to do
        raise SystemExit(f"error: {error}") from None
