"""Looks at downloaded data sets.

python -m kpopnet.benchmarks describe PATH                      what a folder of EVAL, SMMC-10, ITOP or UTD-MHAD holds,
                                                                and what is missing for a score
python -m kpopnet.benchmarks describe PATH --picture ids.png    and the ids of EVAL's joints or SMMC-10's markers, drawn
                                                                where they are
"""

import argparse
from pathlib import Path

import numpy as np

from kpopnet.benchmarks.describe import describe, recognised
from kpopnet.benchmarks.eval_benchmark import EVAL
from kpopnet.benchmarks.id_pictures import eval_ids, id_picture, smmc10_ids
from kpopnet.benchmarks.smmc10_benchmark import SMMC10
from kpopnet.drawing import save_png
from kpopnet.entry import user_errors
from kpopnet.errors import InputError

PICTURED = {"EVAL": (EVAL, eval_ids), "SMMC-10": (SMMC10, smmc10_ids)}
"""The formats in which joints or markers have ids and no names."""


def first_picture(path: Path) -> np.ndarray:
    """RGB: the ids in a set's first sequence, or in the one that is given.

    Raises:
        InputError: a format whose joints have names, or nothing to be seen.
    """
    name, folder = recognised(path)
    if name not in PICTURED:
        raise InputError(
            f"{folder}: --picture shows the ids of EVAL's joints and SMMC-10's markers; those of {name} have names"
        )
    files, read = PICTURED[name]
    first = path if path.is_file() else files.path(folder, files.sequence_names(folder)[0])
    frame = read(first)
    if frame is None:
        raise InputError(f"{first}: not one point is measured before the camera")
    return id_picture(frame, str(first))


@user_errors
def main() -> None:
    parser = argparse.ArgumentParser(
        "python -m kpopnet.benchmarks", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = parser.add_subparsers(dest="command", required=True)
    describing = commands.add_parser("describe", help="what a download contains, and what is missing for a score")
    describing.add_argument("path", type=Path, help="the set's folder, or a file in it")
    describing.add_argument("--picture", type=Path, metavar="FILE.png", help="draw EVAL's or SMMC-10's ids over the depth")
    given = parser.parse_args()
    print(describe(given.path))
    if given.picture is not None:
        save_png(given.picture, first_picture(given.path))
        print(f"ids: {given.picture}")


if __name__ == "__main__":
    main()
