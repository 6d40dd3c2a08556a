"""What people answered who compared learners of a dance pair by pair: FOLDER/ratings/RATER.json (docs/kpop_format.md)."""

from dataclasses import asdict, dataclass, replace
from itertools import combinations
from pathlib import Path

import numpy as np

from kpopnet.datasets.dances.dance_set import is_learner_name
from kpopnet.errors import InputError, check_seed
from kpopnet.runtime.atomic_write import write_json
from kpopnet.runtime.input_files import as_path, check_fields, check_names, expect, read_json, settings_from

RATINGS = "ratings"
FORMAT, VERSION = "kpopnet ratings", 1
MAX_BYTES = 16_000_000
CHOICES = {"left": 1, "equal": 0, "right": -1}
"""What a rater answers: which learner dances better."""


@dataclass(frozen=True)
class Answer:
    """A pair of learners of a dance, as they were shown, and what a rater answered."""

    dance: str
    left: str
    right: str
    repeat: bool = False  # whether the rater saw this pair before; it then shows how consistent the rater is, and no more
    choice: str = ""  # one of CHOICES; "" in a pair that is not answered yet

    @property
    def pair(self) -> tuple[str, frozenset[str], bool]:
        """What identifies it: it is shown to a rater once."""
        return self.dance, frozenset((self.left, self.right)), self.repeat


def all_pairs(dances: dict[str, list[str]], rater: str, seed: int) -> list[Answer]:
    """Every pair that a rater is shown, in the rater's own order, which the seed and the rater's name determine.

    Dances come one after the other, so that whoever stops early has completed some. One pair of each dance is shown again, with
    sides swapped, after the next dance, when the rater does not remember the first answer: one of the first third, since the
    last dance's comes right after it. `dances` has the names of the learners by dance, two or more of each.
    """
    check_seed("seed", seed)
    for name, learners in dances.items():
        expect(len(learners) > 1, f"dance {name}", f"two learners or more, found {len(learners)}")
    rng = np.random.default_rng([seed, *rater.encode()])
    shown, again = [], []
    for name in rng.permutation(sorted(dances)).tolist():
        pairs = [Answer(name, *rng.permutation(pair).tolist()) for pair in combinations(sorted(dances[name]), 2)]
        pairs = [pairs[k] for k in rng.permutation(len(pairs))]
        one = pairs[rng.integers(-(-len(pairs) // 3))]
        shown += pairs + again
        again = [replace(one, left=one.right, right=one.left, repeat=True)]
    return shown + again


def ratings_path(folder: Path | str, rater: str) -> Path:
    """The file of a rater in the folder of a set; raises InputError for what is no name."""
    if not (isinstance(rater, str) and is_learner_name(rater)):
        raise InputError(f"{rater!r:.42}: a rater's name or code is of letters, digits, spaces, - and _")
    return as_path(folder) / RATINGS / f"{rater}.json"


def read_ratings(path: Path | str, dances: dict[str, list[str]]) -> list[Answer]:
    """The answers of a rater in the order given; none where the file does not exist yet.

    Raises InputError if the file is damaged, or rates what is not in the set.
    """
    if not (path := as_path(path)).exists():
        return []
    fields = check_fields(str(path), read_json(path, MAX_BYTES), {"format": str, "version": int, "rater": str, "answers": list})
    expect((fields["format"], fields["version"]) == (FORMAT, VERSION), str(path), f"format {FORMAT}, version {VERSION}")
    expect(fields["rater"] == path.stem, f"{path}: rater", f"{path.stem}, as the file is named")
    answers, seen = [], set()
    for number, given in enumerate(fields["answers"]):
        where = f"{path}, answer {number}"
        answer = settings_from(Answer, given, where)
        expect(answer.choice in CHOICES, f"{where}: choice", f"one of {', '.join(CHOICES)}")
        learners = dances.get(answer.dance, [])
        expect(answer.left in learners and answer.right in learners, where, "two learners of a dance of this set")
        expect(answer.left != answer.right and answer.pair not in seen, where, "a new pair of learners")
        seen.add(answer.pair)
        answers.append(answer)
    return answers


def write_ratings(path: Path, answers: list[Answer]) -> None:
    """Writes the file of a rater, whole or not at all."""
    content = {"format": FORMAT, "version": VERSION, "rater": path.stem, "answers": [asdict(one) for one in answers]}
    write_json(path, content)


def read_all_ratings(folder: Path | str, dances: dict[str, list[str]]) -> dict[str, list[Answer]]:
    """The answers of every rater of a set, by name; raises as `read_ratings`, or if no person has rated anything."""
    folder = as_path(folder)
    paths = sorted((folder / RATINGS).glob("[!.]*.json"))
    check_names(str(folder / RATINGS), [path.name for path in paths])
    found = {path.stem: read_ratings(path, dances) for path in paths}
    if not found:
        raise InputError(f"{folder / RATINGS}: no ratings yet; `kpopnet rate {folder}` collects them")
    return found
