"""Measures what Algorithm 2 as printed reaches, and where it fails, on SIMULATED people of the training split.

    PYTHONPATH=. python tools/paper_claims.py films data/paper              # once: eight films, 240 images a second, no noise
    PYTHONPATH=. python tools/paper_claims.py factors data/paper            # the other way: results/paper/factors.json
    PYTHONPATH=. python tools/paper_claims.py easiest|still|steps|table1 data/paper
    PYTHONPATH=. python tools/paper_claims.py picture data/paper            # docs/figures/paper_still.png

Everything that the text leaves open is varied (docs/paper.md has the figures). The films show the motions of `eval_sim`, each
by another person. At pace 8 all images are seen, 240 a second: the motion between images is an eighth of that at 30. A joint
counts within 10 cm of the true joint (`centre`), or of the surface before it, where a printed joint lies (`surface`). A run
that was stopped goes on where it was, film by film.
"""

import argparse
import itertools
import json
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from datetime import date
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from kpopnet.camera import CAMERAS
from kpopnet.paper_tracker.algorithm2 import Frame, State, candidates_of, track_frame
from kpopnet.paper_tracker.tracker import PaperTracker, PaperTrackerConfig, on_surface
from kpopnet.pose.extraction import extract_person
from kpopnet.runtime.atomic_write import atomic_path, write_npz
from kpopnet.runtime.provenance import git_revision
from kpopnet.skeleton import JOINT_GROUPS, JOINT_NAMES, NUM_JOINTS, PAPER_JOINTS, Joint
from kpopnet.viz.drawing import (
    ESTIMATED,
    TRUE,
    Style,
    depth_rgb,
    draw_skeleton,
    enlarged,
    person_view,
    save_png,
    sheet,
    with_captions,
)
from kpopnet.y_pose.initial_pose import find_initial_pose
from synth.sensor.film_noise import FilmNoise
from synth.sensor.model import SENSORS
from synth.simulated.film import CleanFrame, measure_frame
from synth.simulated.stand_ins import EvalSim, EvalSimConfig
from tools.slow_motion import slowed

CAMERA, SEED, FILMS, SECONDS, FINEST = CAMERAS["eval"], 24101, 8, 8, 8
"""The finest pace has `FINEST` images for each of 30 a second."""

PRINTED, JOINTS = PaperTrackerConfig(), list(PAPER_JOINTS)


class TrainEvalSim(EvalSim):
    """The motions of `eval_sim` by people of the training split, another one in each film."""

    people_of = "train"


def make_films(folder: Path) -> None:
    """Renders the films that are missing in the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    frames = (30 * SECONDS + 1,) * 2
    maker = TrainEvalSim(EvalSimConfig(seed=SEED, sequences=FILMS), frames=frames)
    for index in range(FILMS):
        if (path := folder / f"{index}.npz").exists():
            continue
        take = maker.take(index)
        take = replace(take, played=slowed(take.played, FINEST, sys.maxsize))
        clean = list(maker.studio.render(take, range(len(take))))
        person_m, room_m = np.array([one.person_m for one in clean]), clean[0].room_m
        visible_m = np.where((room_m == 0) | (person_m <= room_m), person_m, np.float32(0))  # where the room does not hide them
        write_npz(
            path,
            person=np.rint(1e4 * visible_m).astype(np.uint16),
            joints_m=np.array([one.joints_camera_m for one in clean]),
            room_m=room_m,
            kind=maker.kind(index),
        )
        print(path, maker.kind(index), flush=True)


@dataclass(frozen=True)
class View:
    """How a film is seen."""

    pace: int = 1  # images for each of 30 a second
    ideal: bool = False  # no noise and the true mask; otherwise a Kinect v1
    true_mask: bool = False  # the person as rendered; otherwise as our extraction finds them
    seconds: float = 6.0


class Film(NamedTuple):
    """A film of T images: person alone (T, H, W) and true joints (T, 15, 3), metres; kind of motion; first Y pose."""

    depth_m: np.ndarray
    joints_m: np.ndarray
    kind: str
    y_start: tuple[int, np.ndarray] | None


@cache
def read_film(path: Path) -> dict[str, np.ndarray]:
    with np.load(path) as stored:
        return dict(stored)


def seen(path: Path, view: View) -> Film:
    """The film of a file in a view."""
    stored = read_film(path)
    rows = slice(0, int(30 * FINEST * view.seconds) + 1, FINEST // view.pace)
    depth_m, joints_m = stored["person"][rows].astype(np.float32) / 1e4, stored["joints_m"][rows].astype(float)
    if not view.ideal:
        noise = FilmNoise((SEED, int(path.stem)))
        clean = (CleanFrame(t, one, stored["room_m"], joints_m[t]) for t, one in enumerate(depth_m))
        measured = [measure_frame(one, CAMERA, SENSORS["kinect_v1"], noise) for one in clean]
        if view.true_mask:
            depth_m = np.array([np.where(mask, image, np.float32(0)) for image, mask in measured])
        else:
            depth_m = extract_person(np.array([image for image, _ in measured]), CAMERA)
    return Film(depth_m, joints_m, str(stored["kind"]), first_y_pose(depth_m))


def first_y_pose(depth_m: np.ndarray) -> tuple[int, np.ndarray] | None:
    """The number of the first image with the Y pose, and its joints."""
    for number, image in enumerate(depth_m):
        if (joints_m := find_initial_pose(image, CAMERA)) is not None:
            return number, joints_m
    return None


def surface_joints(film: Film) -> np.ndarray:
    """(T, 15, 3) the true joints as far before their centres, along their rays, as the surface is in the first image."""
    shift = np.linalg.norm(film.joints_m[0] - on_surface(film.joints_m[0], film.depth_m[0], CAMERA), axis=-1)
    return film.joints_m * (1 - shift / np.linalg.norm(film.joints_m, axis=-1))[..., None]


@dataclass(frozen=True)
class Setting:
    """A tracker in a view."""

    config: PaperTrackerConfig = PRINTED
    view: View = View()
    start: str = "y"  # the first Y pose found, or "true": the first true pose, on the surface
    velocity: bool = True  # of Eq. (3); without it is a repair


def started(film: Film, setting: Setting) -> tuple[PaperTracker, int] | None:
    """A tracker before its first image, and that image's number."""
    tracker, (number, joints_m) = PaperTracker(CAMERA, setting.config), (0, film.joints_m[0])
    if setting.start == "y":
        if film.y_start is None:
            return None
        number, joints_m = film.y_start
    tracker.start(joints_m if setting.config.repaired else on_surface(joints_m, film.depth_m[number], CAMERA))
    return tracker, number


def advance(tracker: PaperTracker, frame: Frame, velocity: bool = True) -> np.ndarray:
    """(15, 3) joints in the next image."""
    plan = tracker.plan()
    plan = plan if velocity else plan._replace(predicted=tracker.state.joints.copy())
    tracker.state, _ = track_frame(frame, tracker.state, plan)
    return tracker.state.joints


def tracked(film: Film, frames: list[Frame], setting: Setting) -> np.ndarray:
    """(T, 15, 3) joints, NaN before the start."""
    found = np.full(film.joints_m.shape, np.nan)
    if (start := started(film, setting)) is not None:
        tracker, first = start
        for number in range(first, len(frames)):
            found[number] = advance(tracker, frames[number], setting.velocity)
    return found


def within_10_cm(found_m: np.ndarray, true_m: np.ndarray) -> np.ndarray:
    """(T, 15) whether each joint is; a missing one is not."""
    with np.errstate(invalid="ignore"):
        return np.linalg.norm(found_m - true_m, axis=-1) < 0.1


def row_of(film: Film, found_m: np.ndarray, in_detail: bool) -> dict[str, Any]:
    """Percentages of the paper's fourteen joints after the first image; in detail, how soon each is lost."""
    surface, centre = (within_10_cm(found_m, true_m)[1:] for true_m in (surface_joints(film), film.joints_m))
    row = {"kind": film.kind, "surface": percent(surface[:, JOINTS]), "centre": percent(centre[:, JOINTS])}
    if in_detail:
        lost = np.where(surface.all(axis=0), len(surface), surface.argmin(axis=0))
        row["by_joint"] = {name: percent(surface[:, group]) for name, group in JOINT_GROUPS.items()}
        row["images_until_lost"] = {name: float(np.median(lost[list(group)])) for name, group in JOINT_GROUPS.items()}
    return row


def percent(hits: np.ndarray) -> float:
    return round(100 * float(np.mean(hits)), 1)


def sweep(films: list[Path], settings: dict[str, Setting], rows: "Rows", in_detail: bool = False) -> None:
    """Tracks every film in every setting; images are prepared once for all settings that see the same points."""
    for path in films:
        todo = {name: one for name, one in settings.items() if not rows.has(path, name)}
        for view, group in itertools.groupby(sorted(todo.items(), key=lambda one: str(one[1].view)), lambda one: one[1].view):
            film, frames = seen(path, view), {}
            for name, setting in group:
                points = (setting.config.epsilon_r, setting.config.repaired)
                if points not in frames:
                    frames = {points: [PaperTracker(CAMERA, setting.config).frame(image) for image in film.depth_m]}
                rows.add(path, name, row_of(film, tracked(film, frames[points], setting), in_detail))


class Rows:
    """A file of results: rows by setting and film, with what made them."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.rows = json.loads(path.read_text())["rows"] if path.exists() else {}

    def has(self, film: Path, name: str) -> bool:
        return film.stem in self.rows.get(name, {})

    def add(self, film: Path, name: str, row: dict[str, Any]) -> None:
        """Adds a row, prints it and writes the file."""
        self.rows.setdefault(name, {})[film.stem] = row
        print(f"{film.stem} {name}: {json.dumps(row)[:200]}", flush=True)
        self.path.parent.mkdir(parents=True, exist_ok=True)
        made = {"simulated": True, "split": "train", "seed": SEED, "date": str(date.today()), "commit": git_revision()}
        made["command"] = f"PYTHONPATH=. python tools/paper_claims.py {self.path.stem} FILMS"
        with atomic_path(self.path) as part:
            # A line for each setting and film
            text = json.dumps(made | {"rows": self.rows}).replace('"rows": {', '"rows": {\n').replace('}, "', '},\n"')
            part.write_text(text + "\n")


# What is open, one at a time from the printed setting


def factors(films: list[Path], rows: Rows) -> None:
    """One factor at a time: the images of a Kinect v1 at 30 a second, our extraction, the Y pose."""
    given = {"printed": Setting(), "true start": Setting(start="true"), "true mask": Setting(view=View(true_mask=True))}
    given["no noise, true mask"] = Setting(view=View(ideal=True, true_mask=True))
    changes = [("lost", lost) for lost in ("predicted", "carried")] + [("candidates", "depth")]
    changes += [("epsilon_r", value) for value in (0.36, 0.4, 0.45, 0.5, 0.55, 0.6)]
    changes += [("sufficient", value) for value in (3, 10, 30)]
    changes += [("r_m", value) for value in (0.06, 0.08, 0.14, 0.2, 0.3)]
    changes += [("epsilon_m", value) for value in (0.02, 0.03, 0.04, 0.06, 0.08, 0.12)]
    changes += [("straightness", value) for value in (0.0, 0.5, 0.85)]
    given |= {f"{name} {value}": Setting(replace(PRINTED, **{name: value})) for name, value in changes}
    given["repaired"] = Setting(replace(PRINTED, repaired=True))
    sweep(films, given | {f"pace {pace}": Setting(view=View(pace)) for pace in (2, 4)}, rows, in_detail=True)


def table1(films: list[Path], rows: Rows) -> None:
    """The paper's Table 1 as printed, and its corners and middle repaired."""
    view, epsilons_m, radii_m = View(seconds=4.0), (0.04, 0.045, 0.05, 0.055, 0.06), (0.08, 0.1, 0.11, 0.12, 0.14)
    grid = [(False, *one) for one in itertools.product(epsilons_m, radii_m)]
    grid += [(True, *one) for one in itertools.product(epsilons_m[::2], radii_m[::2])]
    given = {}
    for repaired, epsilon_m, r_m in grid:
        name = f"{'repaired' if repaired else 'printed'}, epsilon_m {epsilon_m}, r_m {r_m}"
        given[name] = Setting(PaperTrackerConfig(epsilon_m=epsilon_m, r_m=r_m, repaired=repaired), view)
    sweep(films, given, rows)


def easiest(films: list[Path], rows: Rows) -> None:
    """True start, true mask, no noise; then slower; then what holds a motionless person best."""
    given = {}
    for pace in (1, 8):
        view = View(pace, ideal=True, true_mask=True, seconds=4.0)
        for epsilon_r, (r_m, sufficient) in itertools.product((0.3, 0.55), ((0.11, 1), (0.06, 10), (0.04, 10))):
            config = PaperTrackerConfig(epsilon_r=epsilon_r, r_m=r_m, sufficient=sufficient)
            given[f"pace {pace}, epsilon_r {epsilon_r}, r_m {r_m}, sufficient {sufficient}"] = Setting(config, view, "true")
        given[f"pace {pace}, printed without velocity"] = Setting(PRINTED, view, "true", velocity=False)
        given[f"pace {pace}, repaired"] = Setting(replace(PRINTED, repaired=True), view, "true")
    sweep(films, given, rows)


# A motionless person, and one step from the truth

IMAGES = (40, 420, 900, 1500)
"""Numbers of images of each film, at the finest pace: the Y pose, arms that hang, and two of the dance."""

REPEATS, SHOWN = 60, (1, 3, 10, 30, 60)


def still(films: list[Path], rows: Rows) -> None:
    """One image again and again, from its exact pose and lengths: a person who does not move, without noise."""
    grid = itertools.product((0.3, 0.55), (0.04, 0.06, 0.08, 0.11, 0.14), (1, 10))
    given = {
        f"epsilon_r {epsilon_r}, r_m {r_m}, sufficient {sufficient}": Setting(
            PaperTrackerConfig(epsilon_r=epsilon_r, r_m=r_m, sufficient=sufficient), start="true"
        )
        for epsilon_r, r_m, sufficient in grid
    }
    given["lost predicted"] = Setting(PaperTrackerConfig(lost="predicted"), start="true")
    given["without velocity"] = Setting(start="true", velocity=False)
    given["repaired"] = Setting(PaperTrackerConfig(repaired=True), start="true")
    for path, (name, setting) in itertools.product(films, given.items()):
        if rows.has(path, name):
            continue
        hits = []
        for number in IMAGES:
            film = still_film(path, number)
            frame = PaperTracker(CAMERA, setting.config).frame(film.depth_m[0])
            found = tracked(film, [frame] * REPEATS, setting)
            target = film.joints_m if setting.config.repaired else surface_joints(film)
            hits.append(within_10_cm(found, target)[:, JOINTS])
        rows.add(path, name, {str(after): percent(np.array(hits)[:, after - 1]) for after in SHOWN})


def still_film(path: Path, number: int) -> Film:
    """A person in the pose of one image, who does not move."""
    stored = read_film(path)
    image, joints_m = stored["person"][number].astype(np.float32) / 1e4, stored["joints_m"][number].astype(float)
    return Film(np.array([image]), np.repeat(joints_m[None], REPEATS, axis=0), str(stored["kind"]), None)


def steps(films: list[Path], rows: Rows) -> None:
    """Which stage fails: with the true last poses, with true parents, alone; the ridge near true joints; the response."""
    for path, pace, epsilon_r in itertools.product(films, (1, 8), (0.3, 0.55)):
        name = f"pace {pace}, epsilon_r {epsilon_r}"
        if rows.has(path, name):
            continue
        film = seen(path, View(pace, ideal=True, true_mask=True, seconds=4.0))
        setting, true_m = Setting(PaperTrackerConfig(epsilon_r=epsilon_r), start="true"), surface_joints(film)
        frames = [PaperTracker(CAMERA, setting.config).frame(image) for image in film.depth_m]
        near_m = np.array([nearest_m(frame.ridge_m, now_m) for frame, now_m in zip(frames, true_m, strict=True)])
        row = {"ridge within r_j": by_joint(near_m <= setting.config.r_m), "ridge within 5 cm": by_joint(near_m <= 0.05)}
        for kind, step in (("alone", alone), ("true last poses", from_truth), ("true parents", with_true_parents)):
            found = list(played(film, frames, setting, true_m, step))
            row[kind] = by_joint(within_10_cm(np.array(found), true_m))
        row["response"] = [response(film, frames[number], setting, number) for number in range(0, len(frames), 30 * pace)]
        rows.add(path, name, row)


def nearest_m(points_m: np.ndarray, joints_m: np.ndarray) -> np.ndarray:
    """(15,) distance of each joint to the nearest point."""
    apart_m = np.linalg.norm(points_m[None] - joints_m[:, None], axis=-1)
    return apart_m.min(axis=1, initial=np.inf)


def by_joint(hits: np.ndarray) -> dict[str, float]:
    """Percentages of (T, 15) after the first image, of all fourteen joints and by group."""
    return {"all": percent(hits[1:, JOINTS])} | {name: percent(hits[1:, group]) for name, group in JOINT_GROUPS.items()}


Step = Callable[[PaperTracker, Frame, np.ndarray, int], np.ndarray]


def played(film: Film, frames: list[Frame], setting: Setting, true_m: np.ndarray, step: Step) -> Iterator[np.ndarray]:
    tracker, _ = started(film, setting)
    for number, frame in enumerate(frames):
        yield step(tracker, frame, true_m, number).copy()


def alone(tracker: PaperTracker, frame: Frame, true_m: np.ndarray, number: int) -> np.ndarray:
    return advance(tracker, frame)


def from_truth(tracker: PaperTracker, frame: Frame, true_m: np.ndarray, number: int) -> np.ndarray:
    """One step of Algorithm 2 from the true poses of the last two images."""
    last, before = true_m[max(number - 1, 0)], true_m[max(number - 2, 0)]
    tracker.state = State(last, last - before, np.zeros(NUM_JOINTS, np.int64))
    return advance(tracker, frame)


def with_true_parents(tracker: PaperTracker, frame: Frame, true_m: np.ndarray, number: int) -> np.ndarray:
    """Every joint goes its own way, but Eqs. (5) to (9) measure from the true other joints of the image."""
    plan, joints = tracker.plan(), tracker.state.joints.copy()
    for joint in JOINTS:
        found = candidates_of(int(joint), frame, true_m[number], plan)
        if found.count >= plan.sufficient:
            joints[joint] = found.total / found.count
    tracker.state = State(joints, joints - tracker.state.joints, np.zeros(NUM_JOINTS, np.int64))
    return joints


def response(film: Film, frame: Frame, setting: Setting, number: int, moved_m: float = 0.01) -> dict[str, float]:
    """How an error of the last pose comes back: the largest eigenvalue of the step's derivative at the true pose.

    Without velocity an error grows by it in each image. With that of Eq. (3) by `with_velocity`: e' = A (2 e - e_before).
    """
    pose_m = surface_joints(film)[number]
    still = Film(film.depth_m[number : number + 1], film.joints_m[number : number + 1], film.kind, None)
    tracker, _ = started(still, setting)
    derivative = np.zeros((3 * NUM_JOINTS,) * 2)
    for column in (3 * joint + axis for joint in JOINTS for axis in range(3)):
        moved = []
        for sign in (1, -1):
            from_m = pose_m.copy()
            from_m.reshape(-1)[column] += sign * moved_m
            tracker.state = State(from_m, np.zeros_like(from_m), np.zeros(NUM_JOINTS, np.int64))
            moved.append(advance(tracker, frame))
        derivative[:, column] = (moved[0] - moved[1]).reshape(-1) / (2 * moved_m)
    identity = np.eye(len(derivative))
    twice = np.block([[2 * derivative, -derivative], [identity, np.zeros_like(identity)]])
    own = {JOINT_NAMES[j]: derivative[3 * j : 3 * j + 3, 3 * j : 3 * j + 3] for j in (*JOINT_GROUPS["shoulders"], Joint.HEAD)}
    return {
        "without_velocity": growth(derivative),
        "with_velocity": growth(twice),
        **{name: round(float(np.linalg.norm(block, 2)), 2) for name, block in own.items()},
    }


def growth(derivative: np.ndarray) -> float:
    return round(float(np.abs(np.linalg.eigvals(derivative)).max()), 2)


def picture(films: list[Path]) -> np.ndarray:
    """RGB: one image given to the printed and to the repaired tracker again and again, from its true pose."""
    film, rows = still_film(films[2], IMAGES[1]), []
    for config in (PRINTED, replace(PRINTED, repaired=True)):
        frame, setting = PaperTracker(CAMERA, config).frame(film.depth_m[0]), Setting(config, start="true")
        found = tracked(film, [frame] * REPEATS, setting)
        true_m = film.joints_m if config.repaired else surface_joints(film)
        tiles = []
        for after in SHOWN:
            caption = f"step {after}: {percent(within_10_cm(found, true_m)[after - 1, JOINTS])} % within 10 cm"
            tiles.append(tile(film.depth_m[0], ((true_m[0], TRUE), (found[after - 1], ESTIMATED)), caption))
        rows.append(("repaired" if config.repaired else "as printed", tiles))
    return sheet(rows, (TRUE, ESTIMATED))


def tile(depth_m: np.ndarray, skeletons: tuple[tuple[np.ndarray, Style], ...], caption: str) -> np.ndarray:
    """A person with skeletons, cut to the person and the true joints: lost ones may be anywhere."""
    view_m, camera = person_view(depth_m, CAMERA, (skeletons[0][0],), margin=0.1)
    image = enlarged(depth_rgb(view_m), 200)
    for joints_m, style in skeletons:
        draw_skeleton(image, joints_m, camera, style)
    return with_captions(image, (caption,))


MEASURED = {"factors": factors, "table1": table1, "easiest": easiest, "still": still, "steps": steps}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["films", "picture", *MEASURED])
    parser.add_argument("films", type=Path, help="folder of the films")
    parser.add_argument("--out", type=Path, default=Path("results/paper"), help="for the figures: %(default)s")
    given = parser.parse_args()
    if given.what == "films":
        make_films(given.films)
        return
    films = sorted(given.films.glob("*.npz"))
    if given.what == "picture":
        save_png("docs/figures/paper_still.png", picture(films))
    else:
        MEASURED[given.what](films, Rows(given.out / f"{given.what}.json"))


if __name__ == "__main__":
    main()
