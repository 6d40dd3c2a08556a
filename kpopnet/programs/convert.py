"""Makes dance sets (docs/kpop_format.md) from recordings of joints, and from ImperialDance.

    kpopnet convert recordings OUT --dance NAME --teacher T.bvh --learners BEST.bvh GOOD.bvh ...
    kpopnet convert recordings OUT --dance NAME --teacher T.json --learners BEST.json GOOD.json ... --fps 60
    kpopnet convert imperial FOLDER OUT

Learners are named from the best to the worst: their order becomes the labels. Then

    python evaluate.py benchmark=kpop benchmark.path=OUT 'estimator=[]'

Recordings are files of any format that `kpopnet score` reads (docs/dance_scoring.md): BVH, CSV, JSON, npz. The torso is the
mean of shoulders and hips, as in the paper (section 2.3). The unit (metres, centimetres or millimetres) and the vertical axis
are inferred from the dancer's trunk. Every dancer is rotated about the vertical axis to face the camera on average over the
first twentieth of the frames.

ImperialDance: files dance_level_[e|i|b]_GENRE_chN.npy, (takes, 3, frames, 21) at 100 Hz. For every choreography one expert's
take is the teacher; the learners are another expert's, an intermediate dancer's and a beginner's.

AIST++: its keypoints are recorded at 60 frames per second. Its pickles can run code when they are opened, so they are refused.
If you trust them, save them with

    numpy.savez("T.npz", keypoints3d=pickle.load(open("T.pkl", "rb"))["keypoints3d_optim"], fps=60)
"""

import argparse
from pathlib import Path

from kpopnet.datasets.dances.converters import convert_imperial, convert_recordings
from kpopnet.runtime.endings import user_errors


@user_errors
def main() -> None:
    parser = argparse.ArgumentParser(
        "kpopnet convert", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    kinds = parser.add_subparsers(dest="kind", required=True)
    recordings = kinds.add_parser("recordings")
    recordings.add_argument("out", type=Path, help="folder of the set, may be new")
    recordings.add_argument("--dance", required=True, help="its name in the set")
    recordings.add_argument("--teacher", type=Path, required=True)
    recordings.add_argument("--learners", type=Path, nargs="+", required=True, help="from the best to the worst")
    recordings.add_argument("--fps", type=float, help="the true frame rate, where the files state none or a wrong one")
    imperial = kinds.add_parser("imperial")
    imperial.add_argument("source", type=Path, help="folder of dance_level_*.npy")
    imperial.add_argument("out", type=Path, help="folder of the set, may be new")
    given = parser.parse_args()
    if given.kind == "imperial":
        convert_imperial(given.source, given.out)
    else:
        convert_recordings(given.out, given.dance, given.teacher, given.learners, given.fps)


if __name__ == "__main__":
    main()
