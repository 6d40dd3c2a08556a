"""The report on all people in films of several people: joints and identities by kind of scene, pictures and a film."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from kpopnet.camera import MM_PER_METRE
from kpopnet.datasets.simulated import PeopleSet, StoredSequence
from kpopnet.errors import InputError
from kpopnet.evaluation.config import EvaluateConfig
from kpopnet.evaluation.people.matching import MatchedSequence
from kpopnet.evaluation.people.run import ALL, by_kind, figures, run_people
from kpopnet.evaluation.report import SIMULATED, Block, Report, interval_remarks, save_video
from kpopnet.evaluation.values import Table, Value
from kpopnet.extraction import HumanExtractionConfig
from kpopnet.viz.drawing import Style, depth_rgb, draw_skeleton, enlarged, save_png, sheet, with_captions

SHEET_ROWS, SHEET_COLUMNS = 6, 6
TILE_WIDTH_PX, FILM_WIDTH_PX = 280, 640
FILM_STEP = 2
"""Every second frame of the worst sequence is in the film."""

TRUTH = Style("true joints", *[(255, 255, 255)] * 3, width_px=1, filled=False)
COLOURS = ((235, 60, 60), (70, 130, 255), (60, 190, 80), (240, 170, 30), (190, 90, 230), (40, 200, 210))
"""RGB of identities, over again after six."""

DEFINITIONS = (
    "Joints: share within 10 cm of all joints of people who are seen, where a person who is not found counts as fifteen missed "
    "joints; mean error of those found. Hidden: the same for people of whom others hide more than half; they count in nothing "
    "else, nor do people whom the border cuts. Missed: share of the people seen who were not found. False: estimates, image by "
    "image, that match no person. Switches: people who get another identity. MOTA, and how people and estimates are matched: "
    "CLEAR MOT (Bernardin & Stiefelhagen 2008), within a mean joint distance of 50 cm. IDF1 (Ristani et al. 2016) is "
    "taken over the same matches."
)
CLOCK = "Images a second are those of one core, with the extraction and all people in view, after an untimed warm-up."

JOINTS = (
    ("sequences", "sequences", ""),
    ("within 10 cm", "within_10cm", "%"),
    ("mean error", "mean_error_cm", "cm"),
    ("hidden: within 10 cm", "hidden_within_10cm", "%"),
    ("hidden: mean error", "hidden_mean_error_cm", "cm"),
)
IDENTITIES = (
    ("people seen", "seen", ""),
    ("missed", "missed", "%"),
    ("false", "false", ""),
    ("switches", "switches", ""),
    ("MOTA", "mota", "%"),
    ("IDF1", "idf1", "%"),
    ("images a second", "fps", ""),
)
SEQUENCE = (JOINTS[1], JOINTS[2], *IDENTITIES[1:4])


def evaluate_people(config: EvaluateConfig, folder: Path) -> Report:
    """Judges all people found in films of several people; writes pictures and a film into the folder.

    Raises:
        InputError: a setting is for other benchmarks, or see `run_people`.
    """
    name = config.benchmark.name
    if config.scorer or config.sweep is not None:
        raise InputError(f"benchmark={name}: scorer and sweep are for other benchmarks; leave them out")
    if config.extraction != HumanExtractionConfig():
        raise InputError(f"benchmark={name}: extraction.* is not used by estimators of several people; leave it out")
    benchmark = PeopleSet(config.benchmark)
    rows = run_people(benchmark, config.estimator, config.sequences, config.processes_at_work())
    found = {label: by_kind([row[label] for row in rows.found.values()], config.seed) for label in config.estimator}
    label, in_set = next(iter(found)), len(benchmark.names)
    fewest = min(one["sequences"] for one in found[label].values())
    blocks = _sequence_blocks(benchmark, label, [row[label] for row in rows.found.values()], folder)
    count = len(rows.found)
    remarks = [
        f"two_people: SIMULATED depth, compared with synthetic truth; {count}{'' if count == in_set else f' of {in_set}'} "
        "sequences.",
        benchmark.about,
        SIMULATED,
        *(f"Left out because of an error: {name}: {reason}" for name, reason in rows.failed.items()),
        *interval_remarks("sequences", count, ", in a row its own", fewest),
    ]
    joints, identities = _table(found, JOINTS), _table(found, IDENTITIES)
    metrics = {
        "estimator": label,
        **found[label][ALL],
        "benchmark": {
            "name": name,
            "depth": "simulated",
            "about": benchmark.about,
            **benchmark.provenance,
            "sequences": count,
            "sequences_in_set": in_set,
            "failed_sequences": rows.failed,
        },
        "estimators": found,
    }
    main: list[Block] = [("heading", "Joints"), ("table", joints), ("heading", "Identities"), ("table", identities)]
    blocks = [*main, ("text", DEFINITIONS), *blocks]
    return Report("kpopnet on two_people", remarks, blocks, [joints, identities], CLOCK, metrics)


def _cells(one: dict, columns: tuple[tuple[str, str, str], ...]) -> list[Value]:
    """The figures of `columns` (title, key, unit) with their intervals."""
    return [Value(one[key], unit, one["interval"].get(key)) for _, key, unit in columns]


def _table(found: dict[str, dict[str, dict]], columns: tuple[tuple[str, str, str], ...]) -> Table:
    """Figures by estimator and kind of scene."""
    rows: list = [[label, kind, *_cells(one, columns)] for label, kinds in found.items() for kind, one in kinds.items()]
    return Table(["estimator", "scene", *(title for title, _, _ in columns)], rows)


def _sequence_blocks(benchmark: PeopleSet, label: str, parts: list[MatchedSequence], folder: Path) -> list[Block]:
    """The sequences by an estimator: frames of one of each kind and a film of the worst, which it draws, and their figures."""
    folder.mkdir(parents=True, exist_ok=True)
    of_kinds = list({part.kind: part for part in reversed(parts)}.values())[::-1][:SHEET_ROWS]
    tiles = []
    for part in of_kinds:
        frames = np.linspace(0, len(part.seen) - 1, SHEET_COLUMNS + 1).round().astype(int)[1:].tolist()
        sequence = benchmark.read(part.name)
        tiles.append((f"{part.name}: {part.kind}", [frame_image(sequence, part, frame, TILE_WIDTH_PX) for frame in frames]))
    title = f"SIMULATED, two_people, {label}; white: true joints, a colour for each identity"
    save_png(folder / "people.png", sheet(tiles, (), title))
    rows: list = []
    within = {}
    for part in parts:
        one = figures([part], 0)
        within[part.name] = 2.0 if one["within_10cm"] is None else one["within_10cm"]
        rows.append([part.name, part.kind, *_cells(one, SEQUENCE)])
    worst = min(parts, key=lambda part: within[part.name])
    sequence = benchmark.read(worst.name)
    blocks: list[Block] = [
        ("heading", f"Sequences ({label})"),
        ("figure", ("people.png", "Frames of a sequence of each kind: depth, true joints in white, identities in colours")),
        ("table", Table(["sequence", "scene", *(title for title, _, _ in SEQUENCE)], rows)),
    ]
    if save_video(folder / "worst.mp4", film(sequence, worst), sequence.fps / FILM_STEP):
        blocks.append(("video", ("worst.mp4", f"Film of the worst sequence, {worst.name}: {worst.kind}")))
    return blocks


def frame_image(sequence: StoredSequence, matched: MatchedSequence, frame: int, width_px: int) -> np.ndarray:
    """RGB image of one frame: a skeleton in a colour for each identity, the true ones thin, and who is how far off."""
    image = enlarged(depth_rgb(sequence.depth[frame] / np.float32(MM_PER_METRE)), width_px)
    for identity, joints_m in zip(matched.identities.tolist(), matched.estimates_m[:, frame], strict=True):
        colour = COLOURS[identity % len(COLOURS)]
        draw_skeleton(image, joints_m, sequence.camera, Style("", *[colour] * 3, width_px=2, filled=True))
    states = []
    for person, person_m in enumerate(sequence.joints_m[frame]):
        draw_skeleton(image, person_m, sequence.camera, TRUTH)
        errors_m, hidden = matched.errors_m[frame, person], matched.hidden[frame, person]
        found = errors_m[np.isfinite(errors_m)]
        error = f"{100 * found.mean():.0f} cm" if len(found) else "not found"
        states.append(("hidden, " if hidden else "") + error if matched.seen[frame, person] or hidden else "not in view")
    return with_captions(image, (f"{sequence.name} frame {frame}: {'; '.join(states)}",))


def film(sequence: StoredSequence, matched: MatchedSequence) -> Iterator[np.ndarray]:
    """Every FILM_STEP-th frame as an RGB image of even width and height."""
    for frame in range(0, len(matched.seen), FILM_STEP):
        image = frame_image(sequence, matched, frame, FILM_WIDTH_PX)
        yield image[: len(image) // 2 * 2]
