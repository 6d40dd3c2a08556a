"""Makes SIMULATED learners with one fault of known size each, and what a network and the fit say of their depth, no depth.

    python tools/graded_learners.py data/graded/best --dances 12 --mode best
    python tools/graded_learners.py data/graded/best_clips --dances 12 --mode best --clips PACK
    python tools/graded_learners.py data/graded/fresh --clips PACK --split test --people benchmark --seed 7

Dances are those of `kpop_sim` of another seed, each learner is another person, by default one of whom no network has learnt. A
file holds the name of the motion, the teacher's joints, the learner's true ones, and what the image network and the fit to the
depth say of every frame (`kpopnet.networks.over_time.Measured`), so that another estimate from these needs no new images.
Finished files stay when it is run again; a folder takes those of one network, mode, seed, split, people and length.
tools/measure_noise.py reads them. Run from the root of a checkout with `PYTHONPATH=.`.
"""

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kpopnet.camera import subsampled
from kpopnet.dance.noise.table import SEEN_PEOPLE
from kpopnet.data.made_sets import claim_folder
from kpopnet.networks import PASSES, WEIGHTS
from kpopnet.networks.estimator import NetworkEstimator
from kpopnet.networks.over_time import Measured
from kpopnet.pose.person import DetectedPerson
from kpopnet.rotations import conjugate, multiply, rotate, turns
from kpopnet.runtime.atomic_write import write_npz
from kpopnet.runtime.endings import user_errors
from kpopnet.weights import SHA256
from synth.body.asset import load_body
from synth.body.shape import SPLIT_RANGES, Person, draw_person
from synth.dances.faults import KEPT_AMPLITUDE, amplitude
from synth.dances.simulate import BODY, FPS, KpopSim, KpopSimConfig, dance_name
from synth.motion import SPLITS, MotionConfig
from synth.motion.skeleton import INDEX, LEG_M, PARENTS, Motion, forward_kinematics
from synth.motion.splice import as_high_as
from synth.samples.sampler import body_rotations

SEED = 27
DOWN = np.array([0.0, -1.0, 0.0])
REST = {"Left": np.array([1.0, 0.0, 0.0]), "Right": np.array([-1.0, 0.0, 0.0])}


def with_turn(motion: Motion, joint: str, rotation_rad: np.ndarray) -> Motion:
    """The motion with a joint turned by (T, 3) rotation vectors in the world's axes, as high above the floor as before."""
    quats, number = motion.quats.astype(np.float64), INDEX[joint]
    parent = forward_kinematics(quats, motion.root_m)[1][:, PARENTS[number]]
    quats[:, number] = multiply(multiply(conjugate(parent), multiply(turns(rotation_rad), parent)), quats[:, number])
    root_m = as_high_as(motion, quats, motion.root_m)
    return Motion(quats.astype(np.float32), root_m.astype(np.float32), motion.fps, motion.name, motion.leg_m)


def arm_low(motion: Motion, degrees: float, side: str = "Left") -> Motion:
    """An arm lowered at the shoulder, never beyond hanging."""
    arm = rotate(forward_kinematics(motion.quats, motion.root_m)[1][:, INDEX[f"{side}Arm"]], REST[side])
    axis = np.cross(arm, DOWN)
    axis /= np.maximum(np.linalg.norm(axis, axis=1, keepdims=True), 1e-9)
    left = np.arccos(np.clip(arm @ DOWN, -1, 1))
    return with_turn(motion, f"{side}Arm", axis * np.minimum(np.radians(degrees), left)[:, None])


def arms_low(motion: Motion, degrees: float) -> Motion:
    return arm_low(arm_low(motion, degrees, "Left"), degrees, "Right")


def bent_forward(motion: Motion, degrees: float) -> Motion:
    """The upper body bent forward above the middle of the torso."""
    across = rotate(forward_kinematics(motion.quats, motion.root_m)[1][:, INDEX["Spine1"]], np.array([1.0, 0.0, 0.0]))
    return with_turn(motion, "Spine1", np.radians(degrees) * across)


def smaller(motion: Motion, percent: float) -> Motion:
    """Movements that lack a part of their amplitude."""
    severity = np.log(1 - percent / 100) / np.log(KEPT_AMPLITUDE)
    return amplitude(motion, float(severity), np.random.default_rng(0))


def perfect(motion: Motion, _: float) -> Motion:
    return motion


FAULTS: dict[str, Callable[[Motion, float], Motion]] = {
    "perfect": perfect, "arm": arm_low, "arms": arms_low, "forward": bent_forward, "smaller": smaller,
}  # fmt: skip

ROUNDS = (
    (("perfect", 0), ("arm", 15)),
    (("arms", 10), ("forward", 15), ("smaller", 15), ("perfect", 1)),
    (("skill", 0), ("skill", 1), ("skill", 2), ("skill", 3)),
    (("arm", 30), ("arms", 20), ("forward", 30), ("smaller", 30)),
    (("perfect", 2), ("perfect", 3)),
)
"""Learners of each dance: the fault and its size, degrees or percent; of `perfect` and of the model of skill only a number."""


def on_body(motion: Motion) -> tuple[np.ndarray, np.ndarray]:
    """(T, B, 4) rotations of the bones of the generator's body, and (T, 3) hips in metres, that dance a motion."""
    # As `synth.dances.live.motion_of` reads it: from y up, z in front to z up, -y in front.
    hips_m = motion.root_m[:, (0, 2, 1)] * (1, -1, 1) * LEG_M / motion.leg_m
    return body_rotations(load_body(), motion.quats, 0.0, np.zeros(2)), hips_m


@dataclass(frozen=True)
class DancedBy(KpopSim):
    """`kpop_sim` whose teachers and learners are people of another split than its dances."""

    people_of: str = SEEN_PEOPLE

    def _person(self, rng: np.random.Generator) -> Person:
        return draw_person(rng, BODY, self.people_of)


class Learners:
    """Makes learner k of a dance from the seed, the split of dances, the dance's number and k."""

    def __init__(self, split: str, people_of: str, seed: int, clips: str | None, seconds: float, mode: str) -> None:
        motion = MotionConfig(source="choreography") if clips is None else MotionConfig(source="clips", path=clips)
        lengths_s = seconds, seconds + 1.0
        self.set = DancedBy(KpopSimConfig(seed=seed, split=split), motion, seconds=lengths_s, people_of=people_of)
        self.network, self.mode = NetworkEstimator(), mode

    def learner(self, dance: int, number: int, fault: str, size: int) -> dict[str, np.ndarray]:
        """Arrays of learner `number` of a dance, see the module."""
        if fault == "skill":
            motion = self.set.learner(dance, self.set.levels(dance).index(size)).motion
        else:
            motion = FAULTS[fault](self.set.teacher_motion(dance), size)
        packed, true_m = self.set.record(dance, number, self.set.take(dance, number, motion))
        person, rows = DetectedPerson(packed.camera, self.network, self.mode), []
        sizes = np.prod(packed.boxes[:, 2:] - packed.boxes[:, :2], axis=1)
        for (x0, y0, x1, y1), part in zip(packed.boxes, np.split(packed.depth_mm, np.cumsum(sizes)[:-1]), strict=True):
            whole = np.zeros((1, packed.camera.height, packed.camera.width), np.float32)
            whole[0, y0:y1, x0:x1] = part.reshape(y1 - y0, x1 - x0) / 1000
            depth_m, camera = subsampled(whole, packed.camera)
            rows.append(person.update(depth_m[0], camera, len(rows) / FPS).measured)
        columns = zip(Measured._fields, zip(*rows, strict=True), strict=True)
        measured = {name: np.array(column, np.float32) for name, column in columns}
        about = {"motion": np.array(self.set.teacher_motion(dance).name), "fps": np.array(FPS)}
        return measured | about | {"true_m": true_m, "teacher_m": self.set.teacher_joints_m(dance)}


@user_errors
def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--dances", type=int, default=6, help="how many: %(default)s")
    parser.add_argument("--rounds", type=int, default=len(ROUNDS), help="of learners, see ROUNDS: %(default)s")
    parser.add_argument("--seconds", type=float, default=12.0, help="least length of a dance: %(default)s")
    parser.add_argument("--split", choices=SPLITS, default="train", help="of dances: %(default)s")
    parser.add_argument("--people", choices=SPLIT_RANGES, default=SEEN_PEOPLE, help="of which split they are: %(default)s")
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--clips", help="a motion pack: recorded dances instead of composed ones")
    asked = "whom the network sees twice: everybody, or those whose confidence is low (%(default)s)"
    parser.add_argument("--mode", choices=("best", "realtime"), default="realtime", help=asked)
    given = parser.parse_args()
    learners = Learners(given.split, given.people, given.seed, given.clips, given.seconds, given.mode)
    made_with = {name: getattr(given, name) for name in ("seed", "split", "people", "seconds", "clips", "mode")}
    made_by = {"weights": SHA256["joints"][WEIGHTS], "passes": PASSES, "set": learners.set.hash}
    claim_folder(given.out, "*.npz", made_by | made_with)
    number = 0
    for chosen in ROUNDS[: given.rounds]:
        for dance in range(given.dances):
            for offset, (fault, size) in enumerate(chosen):
                path = given.out / f"{dance_name(dance)}_{fault}_{size}.npz"
                if path.exists():
                    continue
                write_npz(path, **learners.learner(dance, number + offset, fault, size))
                print(path.name, flush=True)
        number += len(chosen)


if __name__ == "__main__":
    main()
