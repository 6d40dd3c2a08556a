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
from kpopnet.benchmarks.eval_benchmark import sequence_names as eval_names
from kpopnet.benchmarks.id_pictures import eval_ids, id_picture, smmc10_ids
from kpopnet.benchmarks.smmc10_benchmark import sequence_names as smmc10_names
from kpopnet.drawing import save_png
from kpopnet.entry import user_errors
from kpopnet.errors import InputError


def first_picture(path: Path) -> np.ndarray:
    """RGB: the ids in a set's first sequence, or in the one that is given.

    Raises:
        InputError: a format whose joints have names, or nothing to be seen.
    """
    name, folder = recognised(path)
    if name == "EVAL":
        first, read = folder / f"{eval_names(folder)[0]}.bin", eval_ids
    elif name == "SMMC-10":
        first, read = folder / f"{smmc10_names(folder)[0]}.cal.bin", smmc10_ids
    else:
        raise InputError(
            f"{folder}: --picture shows the ids of EVAL's joints and SMMC-10's markers; those of {name} have names"
        )
    first = path if path.is_file() else first
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
