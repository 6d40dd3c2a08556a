"""Compares generated depth with real depth: statistics as a table, and random frames side by side.

    python -m synth.realism --real UTD_MHAD --synthetic data/small
    python -m synth.realism --real UTD_MHAD --real ITOP --synthetic data/small/train --film data/eval_sim --out outputs/realism

Writes realism.txt, realism.json and realism.png. Each line of the table is a statistic: its median and quartiles over real
frames and over generated frames after sensor and segmentation, and whether the generated median lies within the real
quartiles. What is not given is left out, with a line that says so.
"""

import argparse
import json
from pathlib import Path

from kpopnet.data.shards import ShardedSet
from kpopnet.errors import InputError, check_between, check_seed
from kpopnet.runtime.atomic_write import atomic_path
from kpopnet.runtime.hydra_app import user_errors
from kpopnet.viz.drawing import save_png
from synth.realism.rooms import overlaps
from synth.realism.sheet import comparison_sheet
from synth.realism.sources import Source, chosen_indices, open_generated, read_film_noise, read_generated, read_real
from synth.realism.statistics import measure
from synth.realism.table import Line, as_json, as_text, compare, summary
from synth.sensor.model import SENSORS

MOST_ROOMS = 200
"""Samples that are drawn again for their overlap with furniture: each takes some hundredths of a second."""


def room_lines(shards: ShardedSet, count: int, seed: int) -> list[Line]:
    """The lines that need the generator's geometry.

    Raises:
        InputError: this version of the generator does not draw these samples.
    """
    found = overlaps(shards, chosen_indices(shards, min(count, MOST_ROOMS), seed).tolist())
    names = ("bodies that intersect furniture", "bodies that intersect a wall")
    return [
        Line(name, "share", "", None, summary(values, is_share=True))
        for name, values in zip(names, found.T.astype(float), strict=True)
    ]


def notes_on(options: argparse.Namespace, real: list[Source]) -> list[str]:
    """What is left out because it was not given."""
    notes = []
    if not any(source.frames for source in real):
        notes.append("no real depth: real silhouettes and noise are left out; give a folder of UTD-MHAD with --real")
    if not any(source.name == "ITOP" for source in real):
        notes.append("no ITOP: its distances of the feet are left out; give its folder with --real")
    if options.film is None:
        notes.append("no film: the generated noise in time is left out; give a simulated EVAL with --film")
    return notes


def settings_of(options: argparse.Namespace, shards: ShardedSet) -> dict:
    """The command line and the identity of the generated set, for JSON."""
    given = {
        name: [str(one) for one in value] if isinstance(value, list) else str(value) for name, value in vars(options).items()
    }
    header = shards.header
    generator = header.config.get("generator")
    return given | {"hash": header.config_hash, "split": header.split, "generator": generator}


@user_errors
def main() -> None:
    options = parse()
    real = [read_real(path, options.frames, options.seed) for path in options.real]
    shards = open_generated(options.synthetic)
    synthetic = read_generated(shards, SENSORS[options.sensor], options.frames, options.seed)
    notes = notes_on(options, real)
    if options.film is not None:
        synthetic.noise = read_film_noise(options.film)
    lines = compare({source.name: measure(source) for source in real}, measure(synthetic))
    try:
        lines += room_lines(shards, options.frames, options.seed)
    except InputError as error:
        notes.append(f"overlap with furniture is left out: {error}")
    text = as_text(lines, notes)
    options.out.mkdir(parents=True, exist_ok=True)
    document = as_json(lines, notes, settings_of(options, shards))
    for name, content in (("txt", text), ("json", json.dumps(document, indent=1))):
        with atomic_path(options.out / f"realism.{name}") as part:
            part.write_text(content + "\n")
    pictured = next((source for source in real if source.frames), None)
    save_png(options.out / "realism.png", comparison_sheet(pictured, synthetic, options.seed))
    print(f"{text}\nwritten to {options.out}: realism.txt, realism.json, realism.png")


def parse() -> argparse.Namespace:
    """The command line.

    Raises:
        InputError: a number out of range.
    """
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--real", type=Path, action="append", default=[], metavar="PATH", help="UTD-MHAD or ITOP; repeatable")
    parser.add_argument("--synthetic", type=Path, required=True, metavar="FOLDER", help="shards, or out= of python -m synth")
    parser.add_argument("--film", type=Path, metavar="FOLDER", help="simulated EVAL, for the noise in time")
    parser.add_argument("--out", type=Path, default=Path("outputs/realism"), metavar="FOLDER", help="default: outputs/realism")
    parser.add_argument("--frames", type=int, default=300, help="frames of each kind and origin; default: 300")
    parser.add_argument("--seed", type=int, default=0, help="of the choice of frames and of the sensor's noise; default: 0")
    parser.add_argument("--sensor", choices=sorted(SENSORS), default="kinect_v1", help="measures clean shards")
    options = parser.parse_args()
    check_between("--frames", options.frames, 1, 1e6)
    check_seed("--seed", options.seed)
    return options


if __name__ == "__main__":
    main()
