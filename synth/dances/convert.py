"""Makes dance sets (docs/kpop_format.md) from recorded motion: BVH files, ImperialDance, AIST++ keypoints.

    python -m synth.dances.convert bvh OUT --dance NAME --teacher T.bvh --learners BEST.bvh GOOD.bvh ...
    python -m synth.dances.convert aist OUT --dance NAME --teacher T.json --learners BEST.json GOOD.json ...
    python -m synth.dances.convert imperial FOLDER OUT

Learners are named from the best to the worst: their order becomes the labels. Then

    python evaluate.py benchmark=kpop benchmark.path=OUT 'estimator=[]'

The motion of BVH files is applied to a mean adult of `synth`, whose joints are stored. The other two formats contain points.
Their torso is the mean of shoulders and hips, as in the paper (section 2.3). The unit (metres, centimetres or millimetres) and
the vertical axis (y or z) are inferred from the dancer's trunk. Every dancer is rotated about the vertical axis to face the
camera on average over the first twentieth of the frames.

ImperialDance: files dance_level_[e|i|b]_GENRE_chN.npy, (takes, 3, frames, 21) at 100 Hz. For every choreography one expert's
take is the teacher; the learners are another expert's, an intermediate dancer's and a beginner's.

AIST++: its pickles can run code when they are opened, so they are refused. If you trust them, save them with

    numpy.savez("T.npz", keypoints3d=pickle.load(open("T.pkl", "rb"))["keypoints3d_optim"])
"""

import argparse
from pathlib import Path

import numpy as np

from kpopnet.datasets.dances.converters import by_name, convert_aist, convert_imperial, write_dance
from kpopnet.errors import InputError
from kpopnet.runtime.hydra_app import user_errors
from synth.body.asset import load_body
from synth.body.shape import shape_person
from synth.dances.simulate import KpopSim, KpopSimSet
from synth.motion.recorded.retargeting import bvh_motion


def convert_bvh(out: Path, dance: str, teacher: Path, learners: list[Path], fps: float | None) -> None:
    """Writes a dance from BVH files.

    Args:
        out: folder of the set.
        dance: name of the dance.
        teacher: the teacher's file.
        learners: the learners' files, from the best to the worst.
        fps: frames per second; None for the rate that the files state.

    Raises:
        InputError: A file cannot be read, the rates differ, or there are fewer than two learners of different names.
    """
    maker = KpopSim(KpopSimSet())
    adult = shape_person(np.zeros(len(load_body().basis), np.float32))
    motions = {path: bvh_motion(path, fps) for path in (teacher, *learners)}
    rates = {motion.fps for motion in motions.values()}
    if len(rates) > 1:
        raise InputError(f"the files are recorded at {', '.join(f'{rate:g}' for rate in rates)} frames a second; give --fps")
    joints_m = {path: maker.level_camera_joints_m(adult, motion) for path, motion in motions.items()}
    write_dance(out, dance, rates.pop(), joints_m[teacher], by_name({path: joints_m[path] for path in learners}))


@user_errors
def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    kinds = parser.add_subparsers(dest="kind", required=True)
    for kind in ("bvh", "aist"):
        one = kinds.add_parser(kind)
        one.add_argument("out", type=Path, help="folder of the set, may be new")
        one.add_argument("--dance", required=True, help="its name in the set")
        one.add_argument("--teacher", type=Path, required=True)
        one.add_argument("--learners", type=Path, nargs="+", required=True, help="from the best to the worst")
        one.add_argument("--fps", type=float, help="the true frame rate, where the files state none or a wrong one")
    imperial = kinds.add_parser("imperial")
    imperial.add_argument("source", type=Path, help="folder of dance_level_*.npy")
    imperial.add_argument("out", type=Path, help="folder of the set, may be new")
    given = parser.parse_args()
    if given.kind == "imperial":
        convert_imperial(given.source, given.out)
    elif given.kind == "bvh":
        convert_bvh(given.out, given.dance, given.teacher, given.learners, given.fps)
    else:
        convert_aist(given.out, given.dance, given.teacher, given.learners, given.fps)


if __name__ == "__main__":
    main()
