"""What the dance teacher keeps: adds dances of the user's own, and saves tries, until there is the wanted number of each.

    python -m tests.kill.lessons FOLDER BODY COUNT

As `kpopnet teach add` and the teacher's server do, with the body in the file BODY. Says the name of each once it is kept.
"""

import sys
from pathlib import Path

import numpy as np

from kpopnet.dance.performance import Performance
from kpopnet.runtime.folder_lock import locked
from kpopnet.teacher.adding import add_group
from kpopnet.teacher.library import Library, TeacherBody
from kpopnet.teacher.tries import Tries

DANCE = "dance_001"


def main() -> None:
    folder, body, count = Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3])
    with np.load(body, allow_pickle=False) as arrays:
        library, tries = Library(folder, TeacherBody(**arrays)), Tries(folder / "tries")
    joints_m = library.body.joints_m @ np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]]) + [0, 1, 3]  # at rest before a level camera
    performance = Performance(np.repeat(joints_m[None], 180, axis=0), np.arange(180) / 30)
    with locked(folder):
        while (dances := len(library.identities())) < count:
            print(add_group(library, [performance], "a.npz", f"title {dances}"), flush=True)
        while len(tries.history(DANCE)) < count:
            result = {"dance": DANCE, "total": 80.0, "speed": 1.0, "from_s": 0.0, "to_s": 6.0, "course": [0.0] * 1000}
            print(tries.save(result, {"joints_m": performance.joints_m}), flush=True)


if __name__ == "__main__":
    main()
