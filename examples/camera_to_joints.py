"""From your own depth camera to 3D joints: a recording in, joints and an overlay of skeletons out.

    python examples/camera_to_joints.py recording.npy joints.npz --focal 365 --overlay overlay.png
    python examples/camera_to_joints.py recording.npy joints.npz --focal 365 --checkpoint outputs/train/RUN/best

recording.npy holds (T, H, W) depth of a camera that does not move: uint16 millimetres or float metres, 0 where nothing was
measured. Without a checkpoint the tracker starts with a person who stands upright in view.
"""

import argparse
from pathlib import Path

import numpy as np

from kpopnet.camera import Camera, sequence_in_metres
from kpopnet.extraction import extract_person
from kpopnet.runtime.input_files import ArraySchema, open_npy
from kpopnet.tracker.estimator import TrackerEstimator, TrackerEstimatorConfig
from kpopnet.viz.drawing import ESTIMATED, person_tile, save_png, sheet

FRAMES_IN_OVERLAY = 8


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recording", type=Path, help="(T, H, W) depth, a file of numpy.save")
    parser.add_argument("joints", type=Path, help="the .npz to write: joints_m (T, 15, 3), confidence (T, 15)")
    parser.add_argument(
        "--focal", type=float, required=True, help="focal length in pixels; the centre is assumed in the middle"
    )
    parser.add_argument("--checkpoint", help="folder of a trained network, used instead of the tracker")
    parser.add_argument("--overlay", type=Path, help="a PNG to write: skeletons over the depth of some frames")
    given = parser.parse_args()

    depth = open_npy(given.recording, ArraySchema("uf", (None, None, None)))
    camera = Camera.centred(given.focal, depth.shape[2], depth.shape[1])
    person_m = extract_person(sequence_in_metres(depth, camera), camera)
    if given.checkpoint:
        from kpopnet.networks.estimator import NetworkEstimator  # torch takes seconds to import

        estimator = NetworkEstimator(given.checkpoint)
    else:
        estimator = TrackerEstimator(TrackerEstimatorConfig(start="standing"))
    joints_m, confidence = estimator.estimate(person_m, camera)
    np.savez_compressed(given.joints, joints_m=joints_m, confidence=confidence)

    found = np.flatnonzero(np.isfinite(joints_m).all(axis=(1, 2)))
    print(f"{len(found)} of {len(depth)} frames have all joints, mean confidence {confidence.mean():.2f}: {given.joints}")
    if given.overlay and len(found):
        chosen = found[np.linspace(0, len(found) - 1, FRAMES_IN_OVERLAY).astype(int)]
        tiles = [person_tile(person_m[k], camera, ((joints_m[k], ESTIMATED),), 240, (f"frame {k}",)) for k in chosen]
        save_png(given.overlay, sheet([("", tiles[:4]), ("", tiles[4:])], (ESTIMATED,)))
        print(f"look at {given.overlay}")


if __name__ == "__main__":
    main()
