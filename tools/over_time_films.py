"""Makes what a network and the fit say of SIMULATED films, for tools/over_time.py: joints and confidences, no depth.

    python tools/over_time_films.py data/over_time/train --split train --films 400 --clips PACK
    python tools/over_time_films.py data/over_time/fresh --split validation --films 40 --clips PACK

Films of seven seconds, each of another person: a rest and a composed dance, or a recording (every third film, given
--clips). In a third of the training films a part of the person is hidden for a while. Finished films stay when it is run again;
a folder takes those of one network, seed, split and --clips.
"""

import argparse
import hashlib
from pathlib import Path

import numpy as np

from kpopnet.camera import CAMERAS, Camera
from kpopnet.data.made_sets import claim_folder
from kpopnet.human import Human
from kpopnet.networks import PASSES, WEIGHTS
from kpopnet.networks.estimator import NetworkEstimator
from kpopnet.pose.person import DetectedPerson
from kpopnet.runtime.atomic_write import write_npz
from kpopnet.runtime.endings import user_errors
from kpopnet.weights import SHA256
from synth.body.shape import draw_person
from synth.motion import MotionConfig, build_motion
from synth.motion.choreography.programmes import held, show
from synth.motion.limbs import choose
from synth.motion.poses import kneel, squat, standing
from synth.motion.skeleton import Motion
from synth.motion.splice import cut, follow, resampled
from synth.scene.room import DANCE_HALL
from synth.sensor.film_noise import FilmNoise
from synth.sensor.model import SENSORS
from synth.simulated.film import Studio, Take
from synth.simulated.generator import is_faulty, random_excerpt
from synth.simulated.sequences import BODY, penetrates_itself
from synth.simulated.stand_ins import EvalSim

FPS, FRAMES, RECORDED_EVERY = 30.0, 210, 3
KINDS = ("dance", "dance", "dance", "mixture", "crossed_punches", "kicks", "turns", "sitting")
FILMED_BY = (*5 * ("kinect_v1",), *3 * ("kinect_2",), "swissranger", "ideal")
"""Sensors in the shares of the image network's training."""

TRIES, ROOMS, HIDDEN_FILMS = 40, 4, 1 / 3


class Films:
    """Makes film k from the seed, the split and k."""

    def __init__(self, seed: int, split: str, clips: str | None, checkpoint: Path | None) -> None:
        self.seed, self.split = (0x46696C6D, seed, ("train", "benchmark", "validation").index(split)), split
        source = None if clips is None else MotionConfig(source="clips", path=clips)
        self.recordings = source and build_motion(source, "train" if split == "train" else "validation")
        self.studio, self.network = Studio(CAMERAS["eval"], "cpu"), NetworkEstimator(checkpoint)

    def _rng(self, *numbers: int) -> np.random.Generator:
        return np.random.default_rng([*self.seed, *numbers])

    def _motion(self, rng: np.random.Generator, index: int) -> Motion:
        if self.recordings is not None and index % RECORDED_EVERY == RECORDED_EVERY - 1:
            recording = self.recordings.motion(int(rng.integers(len(self.recordings))))
            return random_excerpt(rng, resampled(recording, FPS), FRAMES)
        rest = held(rng, choose(rng, (standing, standing, squat, kneel))(rng), int(rng.integers(36, 60)), FPS, 0.5)
        dance = random_excerpt(rng, show(rng, choose(rng, KINDS), 2 * FRAMES / FPS, FPS), FRAMES)
        return cut(follow(rest, dance), 0, FRAMES)

    def _take(self, index: int) -> Take | None:
        person = draw_person(self._rng(index, 0), BODY, self.split)
        for attempt in range(TRIES):
            rng = self._rng(index, 1, attempt)
            motion = self._motion(rng, index)
            if len(motion) < FRAMES // 3 or is_faulty(motion):
                continue
            turn_rad = float(rng.choice([0.3 * rng.standard_normal(), rng.uniform(-np.pi, np.pi)]))
            played = self.studio.play(person, motion, turn_rad, rng.uniform(0, 1.5, 2))
            if penetrates_itself(played, min(20, len(motion))):
                continue
            if (take := self.studio.place_in_rooms(rng, played, EvalSim.view, ROOMS, DANCE_HALL)) is not None:
                return take
        return None

    def film(self, index: int) -> dict[str, np.ndarray] | None:
        """(T, ...) arrays of film `index`; None if no motion fits a room."""
        take = self._take(index)
        if take is None:
            return None
        camera, rows = CAMERAS["eval"], []
        people = {mode: DetectedPerson(camera, self.network, mode) for mode in ("realtime", "best")}
        covered = _covered(self._rng(index, 2), len(take), self.split == "train")
        noise, sensor = FilmNoise((*self.seed, index, 3)), SENSORS[choose(self._rng(index, 4), FILMED_BY)]
        for number, shot in enumerate(self.studio.shots(take, sensor, noise, range(len(take)))):
            mask = shot["person"].copy()
            ys, xs = np.nonzero(mask)
            if not len(ys):
                continue
            box = np.array([xs.min(), ys.min(), xs.max() + 1, ys.max() + 1])
            if covered is not None and number in covered[0]:
                first, last = (box[1] + part * (box[3] - box[1]) for part in covered[1])
                mask[int(first) : int(last)] = False
            human = Human.cut_out(0, shot["depth_m"], mask.astype(np.int32), 1, box, np.zeros(3, np.float32))
            row = self._estimates(human.depth_m, human.cropped(camera), people, number / FPS)
            if row is not None:
                hidden = _hidden(np.where(mask, shot["depth_m"], 0), camera, shot["joints_camera_m"])
                rows.append(row | {"true_m": shot["joints_camera_m"], "hidden": hidden, "times_s": number / FPS})
        return {name: np.array([row[name] for row in rows]) for name in rows[0]} if rows else None

    def _estimates(
        self, crop_m: np.ndarray, crop: Camera, people: dict[str, DetectedPerson], time_s: float
    ) -> dict[str, np.ndarray] | None:
        """The arrays of `Measured` of a crop in each mode; None where the body was not fitted."""
        row = {}
        for mode, person in people.items():
            measured = person.update(crop_m, crop, time_s).measured
            if measured is None or measured.fitted_m is measured.detected_m:
                return None
            row |= {f"{mode}_{name}": value for name, value in measured._asdict().items()}
        return row


def _covered(rng: np.random.Generator, frames: int, wanted: bool) -> tuple[range, tuple[float, float]] | None:
    """Frames of which a part of the silhouette's height is hidden, and that part."""
    if not wanted or rng.random() > HIDDEN_FILMS:
        return None
    first, start = int(rng.integers(frames)), rng.uniform(0.0, 0.8)
    return range(first, first + int(rng.integers(10, 60))), (start, min(start + rng.uniform(0.15, 0.45), 1.0))


def _hidden(person_m: np.ndarray, camera, joints_m: np.ndarray) -> np.ndarray:
    """(15,) whether no pixel of the person beside the joint's pixel lies from 17 cm before to 8 cm behind the joint."""
    hidden = np.ones(len(joints_m), bool)
    for joint, (u, v, z) in enumerate(camera.project(joints_m)):
        x, y = max(round(u) - 1, 0), max(round(v) - 1, 0)
        near_m = person_m[y : y + 3, x : x + 3]
        hidden[joint] = not ((near_m > z - 0.17) & (near_m < z + 0.08)).any()
    return hidden


def _digest(checkpoint: Path | None) -> str:
    """SHA-256 of a network's weights."""
    if checkpoint is None:
        return SHA256["joints"][WEIGHTS]
    return hashlib.sha256((checkpoint / WEIGHTS if checkpoint.is_dir() else checkpoint).read_bytes()).hexdigest()


@user_errors
def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    whose = "whose people; those of benchmarks in their clothes: %(default)s"
    parser.add_argument("--split", choices=("train", "validation", "benchmark"), default="train", help=whose)
    parser.add_argument("--films", type=int, default=40, help="how many: %(default)s")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--clips", help="a motion pack, of which the train or the validation split is taken")
    parser.add_argument("--checkpoint", type=Path, help="another network than the one that comes with the package")
    given = parser.parse_args()
    films = Films(given.seed, given.split, given.clips, given.checkpoint)
    made_with = {name: getattr(given, name) for name in ("seed", "split", "clips")}
    made_with |= {"weights": _digest(given.checkpoint), "passes": PASSES}
    claim_folder(given.out, "film_*.npz", made_with)
    for index in range(given.films):
        path = given.out / f"film_{index:05d}.npz"
        if path.exists():
            continue
        if (film := films.film(index)) is None:
            print(f"film {index}: no motion fits a room", flush=True)
            continue
        write_npz(path, **film)
        print(f"film {index}: {len(film['times_s'])} images", flush=True)


if __name__ == "__main__":
    main()
