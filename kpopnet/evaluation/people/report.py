"""The report on all people in films and images of any number of people: who is found, joints and identities, pictures.

People are found in the raw scene; no estimator is given their number.
"""

import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from kpopnet.camera import MM_PER_METRE, Camera
from kpopnet.datasets.protocol import evenly_spaced
from kpopnet.datasets.simulated import PeopleSet, StoredSequence
from kpopnet.errors import InputError
from kpopnet.evaluation import engine
from kpopnet.evaluation.config import EvaluateConfig
from kpopnet.evaluation.engine import Timed, stage
from kpopnet.evaluation.people.metrics import ALL, MatchedSequence, by_kind, causes, figures, match, wrong_joints
from kpopnet.evaluation.registry import BestConfig, RealtimeConfig
from kpopnet.evaluation.report import SIMULATED, Block, Heading, Picture, Report, future_remark, interval_remarks, save_view
from kpopnet.evaluation.values import Table, Value
from kpopnet.pose.estimator import MAX_PEOPLE, PersonPose, PoseEstimator
from kpopnet.pose.extraction import DEFAULT_EXTRACTION, extraction_name
from kpopnet.skeleton import NUM_JOINTS
from kpopnet.tracker.estimator import TrackerEstimatorConfig
from kpopnet.viz.drawing import Style, save_png, scene_tile, sheet
from kpopnet.viz.view_page import Shown

SHEET_COLUMNS, WORST_COLUMNS, WORST_IMAGES = 6, 5, 10
TILE_WIDTH_PX = 280

TRUTH = Style("true joints", *[(255, 255, 255)] * 3, width_px=1, filled=False)
COLOURS = ((235, 60, 60), (70, 130, 255), (60, 190, 80), (240, 170, 30), (190, 90, 230), (40, 200, 210))
"""RGB of identities, over again after six."""

DEFINITIONS = (
    "An estimate is taken for the person whose centre, the mean of the joints found, is within 30 cm, one for one. People are "
    "judged where at least half of the body shows; of the others an estimate within 50 cm counts as neither right nor wrong. "
    "Recall: share of the people judged who were found. Precision: share of the estimates, image by image, that are of one of "
    "them; false: those of no person. Joints: share within 10 cm of all joints of people judged, where a person who is not "
    "found counts as fifteen missed joints; mean error of those found. Hidden: the same for people in view of whom less than "
    "half shows. Empty images show no part of a person. Switches: people who get another identity. MOTA: CLEAR MOT (Bernardin "
    "& Stiefelhagen 2008); IDF1: Ristani et al. 2016; both over the same matches."
)
WHEN_JUDGED = {
    "rooms": "Half of the body is half of the pixels that it would have without a border and with nothing before it.",
    "two_people": "Half of the body: 80 % of the joints inside the image, and half of the pixels not hidden by the other.",
}
"""What counts as at least half of the body, by benchmark."""

CLOCK = "Images a second are those of one core, with the extraction and all people in view, after an untimed warm-up."

PEOPLE = (
    ("sequences", "sequences", ""),
    ("images", "images", ""),
    ("people judged", "seen", ""),
    ("recall", "people_recall", "%"),
    ("precision", "people_precision", "%"),
    ("false", "false", ""),
    ("empty images", "empty_images", ""),
    ("with people found", "empty_images_with_people", ""),
    ("images a second", "fps", ""),
)
JOINTS = (
    ("within 10 cm", "map_10cm", "%"),
    ("mean error", "mean_error_cm", "cm"),
    ("hidden: within 10 cm", "hidden_map_10cm", "%"),
    ("hidden: mean error", "hidden_mean_error_cm", "cm"),
    ("switches", "switches", ""),
    ("MOTA", "mota", "%"),
    ("IDF1", "idf1", "%"),
)
SEQUENCE = (PEOPLE[3], PEOPLE[4], JOINTS[0], JOINTS[1], JOINTS[4])

Follow = Callable[[np.ndarray, Camera, float], list[PersonPose]]
"""(T, H, W) depth of a whole scene, its camera and the frames per second to all people found."""


def follower(label: str, settings: Any, extraction: Any = DEFAULT_EXTRACTION) -> Follow:
    """What finds and follows people with an estimator's settings; raises InputError if these are for one person."""
    if isinstance(settings, TrackerEstimatorConfig):
        if settings != TrackerEstimatorConfig():
            raise InputError(f"estimator {label}: start, model and network are for one person; leave them out")
        return PoseEstimator(None, "tracker", MAX_PEOPLE, extraction).estimate
    if isinstance(settings, RealtimeConfig):
        mode = "best" if isinstance(settings, BestConfig) else "realtime"
        return PoseEstimator.load(settings.checkpoint, mode, MAX_PEOPLE, settings.device, extraction).estimate
    raise InputError(f"estimator {label}: estimates one person; for several take 'estimator=[tracker]', realtime or best")


@contextmanager
def _without_advice() -> Iterator[None]:
    """Silences what `PoseEstimator` advises where it finds no person: rooms may be empty; the report counts who is missed."""
    log = logging.getLogger(PoseEstimator.__module__)
    log.disabled = True
    try:
        yield
    finally:
        log.disabled = False


def matched_people(benchmark: PeopleSet, followers: dict[str, Timed], name: str) -> dict[str, MatchedSequence]:
    """Reads a sequence by its name and matches all people that each follower, by estimator, finds in it."""
    sequence, matched = benchmark.read(name), {}
    for label, follow in followers.items():
        with stage(label), _without_advice():
            people, seconds = follow(sequence.depth, sequence.camera, fps=sequence.fps)
            joints_m = [one.joints_camera_m for one in people]
            estimates_m = np.array(joints_m).reshape(len(people), len(sequence.depth), NUM_JOINTS, 3)
            matched[label] = match(sequence, estimates_m, np.array([one.identity for one in people], int), seconds)
    return matched


def evaluate_people(config: EvaluateConfig, folder: Path) -> Report:
    """Judges all people found in films of several people; writes pictures into the folder.

    Raises InputError if there is no estimator, one finds one person only, a setting is for other benchmarks, or no sequence
    gave figures.
    """
    name = config.benchmark.name
    config.refuse("scorer", "sweep")
    if not config.estimator:
        raise InputError("estimator: expected at least one, for instance 'estimator=[tracker]'")
    followers = {
        label: Timed(follower(label, one, config.extraction), getattr(one, "device", "cpu"))
        for label, one in config.estimator.items()
    }
    benchmark = PeopleSet(config.benchmark)
    names = evenly_spaced(benchmark.names, config.sequences)
    matched, failed = engine.run(partial(matched_people, benchmark, followers), names, config.processes_at_work(), name)
    found = {label: by_kind([one[label] for one in matched.values()], config.seed) for label in config.estimator}
    main, count, in_set = next(iter(found)), len(matched), len(benchmark.names)
    extraction = extraction_name(config.extraction)
    size = f"{count}{'' if count == in_set else f' of {in_set}'} sequences"
    remarks = [
        f"{name}: SIMULATED depth, compared with synthetic truth; {size}.",
        benchmark.about,
        SIMULATED,
        f"The depth shows whole scenes: extraction={extraction} finds the people.",
        *(f"Left out because of an error: {name}: {reason}" for name, reason in failed.items()),
        *future_remark([label for label, one in config.estimator.items() if isinstance(one, BestConfig)]),
        *interval_remarks("sequences", count, ", in a row its own"),
    ]
    tables = [_table(found, PEOPLE), _table(found, JOINTS)]
    blocks = [Heading("People"), tables[0], Heading("Joints and identities"), tables[1], DEFINITIONS, WHEN_JUDGED[name]]
    blocks += _sequence_blocks(benchmark, main, [one[main] for one in matched.values()], folder)
    described = {"name": name, "depth": "simulated", "about": benchmark.about, **benchmark.provenance}
    described |= {"extraction": extraction, "sequences": count, "sequences_in_set": in_set, "failed_sequences": failed}
    metrics = {"estimator": main, **found[main][ALL], "benchmark": described, "estimators": found}
    return Report(f"kpopnet on {name}", remarks, blocks, tables, CLOCK, metrics)


def _cells(one: dict, columns: tuple[tuple[str, str, str], ...]) -> list[Value]:
    """The figures of `columns` (title, key, unit) with their intervals."""
    return [Value(one[key], unit, one["interval"].get(key)) for _, key, unit in columns]


def _table(found: dict[str, dict[str, dict]], columns: tuple[tuple[str, str, str], ...]) -> Table:
    """Figures by estimator and kind of scene."""
    rows: list = [[label, kind, *_cells(one, columns)] for label, kinds in found.items() for kind, one in kinds.items()]
    return Table(["estimator", "scene", *(title for title, _, _ in columns)], rows)


def _sequence_blocks(benchmark: PeopleSet, label: str, parts: list[MatchedSequence], folder: Path) -> list[Block]:
    """The sequences by an estimator: frames of each kind, the worst images, figures, a film in 3D; draws and writes these."""
    folder.mkdir(parents=True, exist_ok=True)
    title = f"SIMULATED, {benchmark.name}, {label}; white: true joints, a colour for each identity"
    save_png(folder / "people.png", sheet(_kind_rows(benchmark, parts), (), title))
    worst = sorted(parts, key=lambda part: -wrong_joints(part).max())[:WORST_IMAGES]
    rows = []
    for first in range(0, len(worst), WORST_COLUMNS):
        some = worst[first : first + WORST_COLUMNS]
        rows.append((f"rank {first + 1} to {first + len(some)}", [_worst_image(benchmark.read(one.name), one) for one in some]))
    save_png(folder / "worst.png", sheet(rows, (), title))
    films = [part for part in parts if len(part.seen) > 1]
    blocks: list[Block] = [
        Heading(f"Sequences ({label})"),
        Picture("people.png", "Frames of a sequence of each kind: depth, true joints in white, identities in colours"),
        Picture("worst.png", "The images with the most wrong joints, one of a sequence, and why they are wrong"),
    ]
    if not films:
        return blocks
    found = {part.name: figures([part], 0) for part in films}
    table = [[part.name, part.kind, *_cells(found[part.name], SEQUENCE)] for part in films]
    last = max(films, key=lambda part: wrong_joints(part).mean())
    sequence = benchmark.read(last.name)
    people = [
        Shown(joints_m, np.isfinite(joints_m).all(axis=-1), str(identity))
        for identity, joints_m in zip(last.identities.tolist(), last.estimates_m, strict=True)
    ]
    true_m = sequence.joints_m.swapaxes(0, 1)
    people += [Shown(joints_m, np.ones(joints_m.shape[:2]), "true joints", reference=True) for joints_m in true_m]
    title = f"{last.name}: {label} on simulated depth"
    save_view(folder / "worst.html", title, sequence.camera, sequence.fps, sequence.depth, people)
    return [
        *blocks,
        Table(["film", "scene", *(title for title, _, _ in SEQUENCE)], table),
        Picture("worst.html", f"The worst film, {last.name}: {last.kind}; true joints thin"),
    ]


def _kind_rows(benchmark: PeopleSet, parts: list[MatchedSequence]) -> list[tuple[str, list[np.ndarray]]]:
    """A row for each kind of scene: frames of its first sequence, or the first sequences where these are single images."""
    rows = []
    for kind in dict.fromkeys(part.kind for part in parts):
        some = [part for part in parts if part.kind == kind]
        shown, last = [(part, 0) for part in some[:SHEET_COLUMNS]], len(some[0].seen) - 1
        if last > 0:
            shown = [(some[0], frame) for frame in np.linspace(0, last, SHEET_COLUMNS + 1).round().astype(int)[1:].tolist()]
        rows.append((kind, [frame_image(benchmark.read(part.name), part, frame) for part, frame in shown]))
    return rows


def _worst_image(sequence: StoredSequence, part: MatchedSequence) -> np.ndarray:
    """The image of a sequence with the most wrong joints, named by what is wrong."""
    frame = int(wrong_joints(part).argmax())
    found = [f"{number} {cause}" for cause, number in causes(sequence.joints_m[frame], part, frame).items()]
    return frame_image(sequence, part, frame, ", ".join(found) or "nothing wrong")


def frame_image(sequence: StoredSequence, matched: MatchedSequence, frame: int, remark: str | None = None) -> np.ndarray:
    """RGB image of one frame: a skeleton in a colour for each identity, the true ones thin, with a remark, or how far off."""
    colours = (COLOURS[identity % len(COLOURS)] for identity in matched.identities.tolist())
    styles = (Style("", *[colour] * 3, width_px=2, filled=True) for colour in colours)
    skeletons = [*zip(matched.estimates_m[:, frame], styles, strict=True), *((one, TRUTH) for one in sequence.joints_m[frame])]
    states = []
    for person in range(len(sequence.people)):
        errors_m, hidden = matched.errors_m[frame, person], matched.hidden[frame, person]
        found = errors_m[np.isfinite(errors_m)]
        error = f"{100 * found.mean():.0f} cm" if len(found) else "not found"
        states.append(("hidden, " if hidden else "") + error if matched.seen[frame, person] or hidden else "not in view")
    captions = f"{sequence.name} frame {frame}, {sequence.kind}", remark or "; ".join(states) or "no person"
    return scene_tile(sequence.depth[frame] / np.float32(MM_PER_METRE), sequence.camera, skeletons, TILE_WIDTH_PX, captions)
