"""Trains the network that lifts a webcam's joints (kpopnet.networks.lifting) on films of SIMULATED people.

    python tools/fit_lifting.py films data/lifting --count 378 --clips PACK
    python tools/fit_lifting.py fit data/lifting --out data/lifting.safetensors --held-out 7 --figures results/lifting.json
    python tools/fit_lifting.py fit data/lifting --out data/lifting.safetensors

A film shows a person in colour, and MediaPipe in a browser says of each picture where its points are (Chromium, chromedriver
and selenium have to be there). `--held-out 7` leaves out every seventh film and prints the errors in these. Finished films stay
when it is run again. Run from the root of a checkout with `PYTHONPATH=.`; tools/ship_weights.py puts the weights into the
package.
"""

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import safetensors.numpy
import torch
from torch import Tensor, nn
from tqdm import tqdm

from kpopnet.camera import Camera
from kpopnet.dance.joint_files.mediapipe import CAMERA, seen_joints
from kpopnet.data.made_sets import MANIFEST, claim_folder
from kpopnet.errors import InputError
from kpopnet.networks.lifting import READ, Lifting, Sighting
from kpopnet.rotations import about, multiply
from kpopnet.runtime.atomic_write import write_json, write_npz, write_whole
from kpopnet.runtime.endings import user_errors
from kpopnet.runtime.input_files import parsing, read_json
from kpopnet.runtime.provenance import measured_by
from kpopnet.skeleton import MIRROR, NUM_JOINTS, Joint
from kpopnet.teacher.live.webcam import read_seen
from synth.dances.taught import DANCES, composed
from synth.motion import MotionConfig, MotionSource, build_motion
from synth.motion.choreography.programmes import show
from synth.motion.limbs import choose
from synth.motion.skeleton import Motion
from synth.motion.splice import resampled
from synth.simulated.generator import is_faulty, random_excerpt
from tools.measure_webcam import FilmedLearner, on_body, points_in, webcam_page

FPS, FRAMES, STRIDE = 30.0, 180, 2
"""Of the motions, and of how many of their frames one is seen."""

LEAST_FRAMES, LEAST_SEEN = 60, 20
"""Of a motion; and pictures with a person of a film, which is left out otherwise."""

TURNS = ("composed", "recorded", "other")
"""In turn: dances composed as the teacher's are, recordings where there are any, other choreography, of these kinds."""

KINDS = ("dance", "dance", "dance", "mixture", "crossed_punches", "kicks", "turns")
FOV_DEG = (52.0, 78.0)
"""Webcams' angles of view; the program takes 60 degrees for all."""

HIDDEN, STEPS, BATCH_SIZE, LR, WEIGHT_DECAY = 256, 4000, 1024, 3e-3, 2.0
SIZE_NOISE, DIMMEST, LEAST_SPREAD = 0.05, 0.7, 0.1
"""Spread of the size for which MediaPipe may take a person, least share of its visibility that a picture keeps, and the least
standard deviation by which a number is divided."""

SURE_WEIGHT, NEAR_M = 0.05, 0.1
"""Weight of the confidence, whose event is an error below NEAR_M."""


def drawn_motion(rng: np.random.Generator, index: int, recordings: MotionSource | None) -> Motion:
    """In turn a dance composed as the teacher's are, a recording where there are any, and other choreography: at most FRAMES
    frames. Two of three people face the camera.
    """
    while True:
        if index % 3 == 0:
            motion = random_excerpt(rng, composed(DANCES + 100 + index)[0], FRAMES)
        elif index % 3 == 1 and recordings is not None:
            recording = recordings.motion(int(rng.integers(len(recordings))))
            motion = random_excerpt(rng, resampled(recording, FPS), FRAMES)
        else:
            motion = random_excerpt(rng, show(rng, choose(rng, KINDS), 2 * FRAMES / FPS, FPS), FRAMES)
        if len(motion) > LEAST_FRAMES and not is_faulty(motion):
            break
    turn_rad = rng.choice([0.3 * rng.standard_normal(), 0.3 * rng.standard_normal(), rng.uniform(-np.pi, np.pi)])
    return turned(motion, float(turn_rad))


def turned(motion: Motion, yaw_rad: float) -> Motion:
    """The motion of a person who begins at the origin and is turned to the left."""
    quats, cos, sin = motion.quats.astype(float), np.cos(yaw_rad), np.sin(yaw_rad)
    quats[:, 0] = multiply(about(1, yaw_rad), quats[:, 0])
    x, y, z = (motion.root_m - motion.root_m[0] * (1, 0, 1)).T
    return replace(motion, quats=quats.astype(np.float32), root_m=np.stack([cos * x + sin * z, y, cos * z - sin * x], axis=1))


def film(index: int, recordings: MotionSource | None, browser) -> dict[str, np.ndarray]:
    """(T, 33, 6) points as the page sends them, NaN without a person, and (T, 15, 3) true joints in metres."""
    rng = np.random.default_rng([77, index])
    motion = drawn_motion(rng, index, recordings)
    camera = Camera.from_fov(float(rng.uniform(*FOV_DEG)), CAMERA.width, CAMERA.height)
    learner = FilmedLearner(*on_body(motion), FPS, "perfect", seed=700_000 + index, camera=camera)
    numbers, points, true_m = range(0, len(learner), STRIDE), [], []
    for number in numbers:
        bgr, joints_m = learner.picture(number)
        points.append(points_in(browser, bgr, not number, 1000 * STRIDE / FPS) or np.full((33, 6), np.nan))
        true_m.append(joints_m)
    return {"points": np.array(points, np.float32), "true_m": np.array(true_m)}


# --- what is learned from --------------------------------------------------------------------------------------------------


class Pictures(NamedTuple):
    """Pictures of one person, and where their joints are: (T, 15, 3) about the torso, metres, in the ray's frame."""

    seen: Sighting
    true_m: np.ndarray


def of_film(path: Path) -> Pictures | None:
    """The pictures of a film in which a person was found; None where there are too few."""
    with parsing(path, "not a readable film", "delete it and make it again"), np.load(path) as stored:
        points, true_m = stored["points"], stored["true_m"]
    seen, expected_m = [], []
    for found, joints_m in zip(points, true_m, strict=True):
        person = None if np.isnan(found).any() else read_seen({"points": found.tolist(), "age_ms": 0.0}).person
        if person is not None and (one := seen_joints(person, CAMERA)) is not None:
            seen.append(one.sighting)
            expected_m.append((joints_m - joints_m[Joint.TORSO]) @ one.to_ray.T)
    if len(seen) < LEAST_SEEN:
        return None
    return Pictures(Sighting(*map(np.array, zip(*seen, strict=True))), np.array(expected_m))


# --- training --------------------------------------------------------------------------------------------------------------


def trained(films: list[Pictures], steps: int) -> dict[str, np.ndarray]:
    """The arrays of `kpopnet.networks.lifting.Lifting`."""
    torch.manual_seed(0)
    of_films = zip(*((*one.seen, one.true_m) for one in films), strict=True)
    points_m, visibility, elevation_rad, true_m = (torch.from_numpy(np.concatenate(arrays)).float() for arrays in of_films)
    numbers = torch.cat([points_m.flatten(1), visibility, elevation_rad[:, None]], dim=1)
    # Points of films are seen so well that a worse picture would be many standard deviations away.
    mean, spread = numbers.mean(dim=0), numbers.std(dim=0).clamp(min=LEAST_SPREAD)
    last = nn.Linear(HIDDEN, 4 * NUM_JOINTS)
    network = nn.Sequential(nn.Linear(READ, HIDDEN), nn.ReLU(), nn.Linear(HIDDEN, HIDDEN), nn.ReLU(), last)
    with torch.no_grad():
        last.weight[: 3 * NUM_JOINTS] *= 0.3  # the network begins near the points
    optimiser = torch.optim.AdamW(network.parameters(), lr=LR, weight_decay=WEIGHT_DECAY)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, LR, total_steps=steps)
    for _ in tqdm(range(steps), "training", unit="step"):
        drawn = torch.randint(len(points_m), (BATCH_SIZE,))
        here_m, shown, true_here_m = points_m[drawn], visibility[drawn], true_m[drawn]
        mirrored = torch.rand(BATCH_SIZE) < 0.5
        here_m, true_here_m = (torch.where(mirrored[:, None, None], _mirrored(one), one) for one in (here_m, true_here_m))
        shown = torch.where(mirrored[:, None], shown[:, MIRROR], shown) * torch.empty(BATCH_SIZE, 1).uniform_(DIMMEST, 1.0)
        here_m = here_m * torch.exp(SIZE_NOISE * torch.randn(BATCH_SIZE, 1, 1))
        read = torch.cat([here_m.flatten(1), shown, elevation_rad[drawn, None]], dim=1)
        out = network((read - mean) / spread)
        joints_m = here_m - here_m[:, [Joint.TORSO]] + out[:, : 3 * NUM_JOINTS].unflatten(1, (NUM_JOINTS, 3))
        error_m = (joints_m - true_here_m).norm(dim=-1)
        sure = nn.functional.binary_cross_entropy_with_logits(out[:, 3 * NUM_JOINTS :], (error_m.detach() < NEAR_M).float())
        optimiser.zero_grad()
        (error_m.mean() + SURE_WEIGHT * sure).backward()
        optimiser.step()
        schedule.step()
    arrays = {name: value.detach().numpy() for name, value in network.state_dict().items()}
    arrays["0.weight"] = arrays["0.weight"] / spread.numpy()
    arrays["0.bias"] = arrays["0.bias"] - arrays["0.weight"] @ mean.numpy()
    return arrays


def _mirrored(points_m: Tensor) -> Tensor:
    return points_m[:, MIRROR] * torch.tensor([-1.0, 1.0, 1.0])


def report(network: Lifting, films: dict[int, Pictures], recordings: bool) -> dict[str, Any]:
    """Prints the errors about the torso in films, by their numbers, of the points and of the network; cm and percent.

    `recordings` tells whether every third film is a recording.
    """
    points_cm, lifted_cm, chances = [], [], []
    for one in films.values():
        joints_m, chance = network(one.seen)
        points_m = one.seen.points_m - one.seen.points_m[:, [Joint.TORSO]]
        for found_cm, found_m in ((points_cm, points_m), (lifted_cm, joints_m)):
            found_cm.append(100 * np.linalg.norm(found_m - one.true_m, axis=-1))
        chances.append(chance)
    kinds: dict[str, list[np.ndarray]] = {kind: [] for kind in TURNS}
    for number, error_cm in zip(films, lifted_cm, strict=True):
        kind = TURNS[number % len(TURNS)]
        kinds["other" if kind == "recorded" and not recordings else kind].append(error_cm)
    figures: dict[str, Any] = {}
    for name, errors in {"points": points_cm, "lifted": lifted_cm, **kinds}.items():
        if errors:
            error_cm = np.concatenate(errors)
            figures[name] = {"cm": float(error_cm.mean()), "within": float(100 * (error_cm < 100 * NEAR_M).mean())}
            print(f"{name}: {figures[name]['cm']:.1f} cm, {figures[name]['within']:.0f} % within 10 cm")
    chance, is_near, figures["sure"] = np.concatenate(chances), np.concatenate(lifted_cm) < 100 * NEAR_M, {}
    for low in (0.0, 0.2, 0.4, 0.6, 0.8):
        if (inside := (chance >= low) & (chance < low + 0.2)).any():
            figures["sure"][f"{low}"] = share = float(100 * is_near[inside].mean())
            print(f"confidence {low:.1f} to {low + 0.2:.1f}: {share:.0f} % of {inside.sum()} within 10 cm")
    return figures


@user_errors
def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("do", choices=("films", "fit"))
    parser.add_argument("folder", type=Path, help="of the films")
    parser.add_argument("--count", type=int, default=378, help="how many films: %(default)s")
    parser.add_argument("--clips", help="a motion pack, of which the train split is taken for every third film")
    parser.add_argument("--out", type=Path, help="file of the weights")
    parser.add_argument("--held-out", type=int, default=0, metavar="N", help="every N-th film is not learned from, and judges")
    parser.add_argument("--figures", type=Path, help="a JSON file for the errors in these, as those of results/")
    parser.add_argument("--steps", type=int, default=STEPS, help="%(default)s")
    given = parser.parse_args()
    if given.do == "films":
        given.folder.mkdir(parents=True, exist_ok=True)
        claim_folder(given.folder, "film_*.npz", {"clips": given.clips})
        recordings = given.clips and build_motion(MotionConfig(source="clips", path=given.clips), "train")
        with webcam_page() as browser:
            for index in tqdm(range(given.count), "films", unit="film"):
                path = given.folder / f"film_{index:05d}.npz"
                if not path.exists():
                    write_npz(path, **film(index, recordings, browser))
        return
    if given.out is None:
        parser.error("fit needs --out")
    if given.figures is not None and not given.held_out:
        parser.error("--figures are of films that are not learned from: give --held-out N")
    paths = sorted(given.folder.glob("film_*.npz"))
    films = {int(path.stem.removeprefix("film_")): one for path in paths if (one := of_film(path)) is not None}
    if not films:
        raise InputError(f"{given.folder}: no film_*.npz in which a person was found; `tools/fit_lifting.py films` makes them")
    held_out = dict(list(films.items())[:: given.held_out]) if given.held_out else {}
    if len(held_out) == len(films):
        raise InputError(f"{given.folder}: no film is left to learn from with --held-out {given.held_out}")
    arrays = trained([one for number, one in films.items() if number not in held_out], given.steps)
    given.out.parent.mkdir(parents=True, exist_ok=True)
    write_whole(given.out, safetensors.numpy.save(arrays))
    if held_out:
        manifest = read_json(given.folder / MANIFEST)
        figures = report(Lifting.load(given.out), held_out, bool(manifest.get("clips")))
        if given.figures:
            write_json(given.figures, {"what": "SIMULATED films in colour", "films": len(held_out)} | measured_by() | figures)


if __name__ == "__main__":
    main()
