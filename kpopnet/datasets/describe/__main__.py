"""Describes a downloaded data set.

python -m kpopnet.datasets.describe PATH                   contents of a folder of EVAL, SMMC-10, ITOP or UTD-MHAD, and
                                                           what an evaluation still needs
python -m kpopnet.datasets.describe PATH --figure ids.png  also draws the ids of EVAL's joints or SMMC-10's markers at
                                                           their positions
"""

import argparse
from pathlib import Path

import numpy as np

from kpopnet.datasets.describe.describe import describe, recognise_format
from kpopnet.datasets.describe.id_figures import draw_ids, eval_ids, smmc10_ids
from kpopnet.datasets.eval.benchmark import EVAL
from kpopnet.datasets.smmc10.benchmark import SMMC10
from kpopnet.errors import InputError
from kpopnet.runtime.hydra_app import user_errors
from kpopnet.viz.drawing import save_png

FORMATS_WITH_IDS = {"EVAL": (EVAL, eval_ids), "SMMC-10": (SMMC10, smmc10_ids)}
"""The formats whose joints or markers have ids instead of names."""


def id_figure(path: Path) -> np.ndarray:
    """RGB image of the ids in a sequence: the file at `path`, or the first one of the folder.

    Raises:
        InputError: the joints of the format have names, or no point is measured.
    """
    name, folder = recognise_format(path)
    if name not in FORMATS_WITH_IDS:
        raise InputError(
            f"{folder}: --figure shows the ids of EVAL's joints and SMMC-10's markers; the joints of {name} have names"
        )
    files, read_ids = FORMATS_WITH_IDS[name]
    first = path if path.is_file() else files.path(folder, files.sequence_names(folder)[0])
    frame = read_ids(first)
    if frame is None:
        raise InputError(f"{first}: no point in front of the camera is measured")
    return draw_ids(frame, str(first))


@user_errors
def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("path", type=Path, help="folder of the set, or a file in it")
    parser.add_argument("--figure", type=Path, metavar="FILE.png", help="draw the ids of EVAL or SMMC-10 over the depth")
    options = parser.parse_args()
    print(describe(options.path))
    if options.figure is not None:
        save_png(options.figure, id_figure(options.path))
        print(f"ids: {options.figure}")


if __name__ == "__main__":
    main()
