"""Tries of dances on the disk: a JSON file with the result and an .npz file with the learner's joints for each."""

import contextlib
import csv
import io
import json
import re
import time
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path

import numpy as np

from kpopnet.dance.performance import Performance
from kpopnet.errors import InputError
from kpopnet.runtime.atomic_write import atomic_path, claim, remove_unfinished, write_npz
from kpopnet.runtime.input_files import ArraySchema, expect, read_json, read_npz
from kpopnet.skeleton import NUM_JOINTS
from kpopnet.teacher.library import IDENTITY

NAME = re.compile(r"[0-9]{8}-[0-9]{6}-[0-9]{3}")
SUFFIXES = (".npz", ".mp4", ".json", ".mp4")
"""Of the files of a try as they are deleted: late the result, which says whose it is; then a film that was made meanwhile."""

SAVING_S = 60.0
"""Longest time from a try's joints to its result, while it is saved."""

JOINTS = {
    "joints_m": ArraySchema("f", ("frames", NUM_JOINTS, 3)),
    "times_s": ArraySchema("f", ("frames",)),
    "confidence": ArraySchema("f", ("frames", NUM_JOINTS)),
}
"""Of a try's .npz file."""


class Tries:
    """The folder of tries: DANCE/TIME.json and DANCE/TIME.npz."""

    def __init__(self, folder: Path) -> None:
        self.folder = Path(folder)
        self._known: dict[str, dict[str, tuple[int, dict | None]]] = {}  # by dance and name, when changed and what `_shown` is

    def save(self, result: dict, arrays: dict[str, np.ndarray]) -> str:
        """Writes a try and returns its name. The result is written last: a try that is listed is complete."""
        place = self.folder / result["dance"]
        place.mkdir(parents=True, exist_ok=True)
        while not claim(place / f"{(name := datetime.now().strftime('%Y%m%d-%H%M%S-%f')[:-3])}.npz"):
            time.sleep(0.002)
        try:
            write_npz(place / f"{name}.npz", **arrays)
            with atomic_path(place / f"{name}.json") as part:
                part.write_text(json.dumps(result | {"session": name}, allow_nan=False, ensure_ascii=False), encoding="utf-8")
        except BaseException:  # joints without a result could not be deleted
            (place / f"{name}.npz").unlink(missing_ok=True)
            raise
        return name

    def remove(self, dance: str, name: str) -> None:
        """Deletes a try: its joints, its film, also half a one, and its result; raises as `path`."""
        result = self.path(dance, name, "json")
        for path in (*result.parent.glob(f".{name}.*"), *map(result.with_suffix, SUFFIXES)):
            path.unlink(missing_ok=True)

    def remove_unfinished(self) -> None:
        """Deletes what killed programs left: hidden files, and joints whose result never came: whose they are is not known."""
        for dance in self.dances():
            remove_unfinished(self.folder / dance)
            for path in (self.folder / dance).glob("*.npz"):
                with contextlib.suppress(FileNotFoundError):  # a try that could not be saved
                    if not path.with_suffix(".json").exists() and time.time() - path.stat().st_mtime > SAVING_S:
                        path.unlink()

    def history(self, dance: str, who: str = "") -> list[dict]:
        """The tries of a dance by a profile, "" for those of none, the newest first: their dance, name, total, speed,
        excerpt, source, whom of a group they danced, whether as in a mirror, and the totals of their phrases.
        """
        if not IDENTITY.fullmatch(dance):
            raise InputError("there is no such dance")
        return list(self._of(dance, who))

    def dances(self) -> list[str]:
        """The dances that were tried."""
        return sorted(path.name for path in self.folder.glob("*") if IDENTITY.fullmatch(path.name))

    def of(self, who: str) -> list[tuple[str, str]]:
        """The tries of a profile: their dances and names."""
        return [(dance, one["session"]) for dance in self.dances() for one in self._of(dance, who)]

    def _of(self, dance: str, who: str) -> Iterator[dict]:
        """As `history`. A file is read once, unless it changes: it may hold a minute's course."""
        before, known = self._known.get(dance, {}), {}
        for path in sorted((self.folder / dance).glob("*.json"), reverse=True):
            with contextlib.suppress(FileNotFoundError):  # it is deleted just now
                if NAME.fullmatch(path.stem):
                    changed, kept = path.stat().st_mtime_ns, before.get(path.stem, (0, None))
                    known[path.stem] = kept if kept[0] == changed else (changed, self._shown(dance, path.stem))
        self._known[dance] = known
        for _, one in known.values():
            if one is not None and one["who"] == who:
                yield {key: value for key, value in one.items() if key != "who"}

    def _shown(self, dance: str, name: str) -> dict | None:
        """Whose a try is, and what the history shows of it; None for a damaged one."""
        try:
            one = self.result(dance, name)
        except InputError:
            return None
        phrases = one.get("phrases")
        phrases = [one for one in phrases if isinstance(one, dict)] if isinstance(phrases, list) else []  # or it is damaged
        keys = ("total", "speed", "from_s", "to_s", "source", "skill", "dancer", "mirrored")
        head = {"who": one.get("who", ""), "dance": dance, "session": name}
        totals = [{key: phrase.get(key) for key in ("start_s", "total")} for phrase in phrases]
        return head | {key: one.get(key) for key in keys} | {"phrases": totals}

    def result(self, dance: str, name: str) -> dict:
        """The result of a try; raises as `path`."""
        path = self.path(dance, name, "json")
        result = read_json(path)
        expect(isinstance(result, dict), str(path), "a saved try")
        return result

    def joints(self, dance: str, name: str) -> Performance:
        """The learner's joints, of which some may never have been seen; raises as `path`, and for a damaged file."""
        path = self.path(dance, name, "npz")
        arrays = read_npz(path, JOINTS)
        try:
            return Performance(**arrays)
        except InputError as error:
            raise InputError(f"{path}: {error}") from error

    def path(self, dance: str, name: str, suffix: str) -> Path:
        """The file of a try; what are no plain names never become a path. Raises InputError if there is none."""
        path = self.folder / dance / f"{name}.{suffix}"
        if not IDENTITY.fullmatch(dance) or not NAME.fullmatch(name) or not path.is_file():
            raise InputError("there is no such try")
        return path

    def film_path(self, dance: str, name: str) -> Path:
        """Where the film of a try is kept, which may not be made yet; raises as `path`."""
        return self.path(dance, name, "json").with_suffix(".mp4")


def as_csv(result: dict) -> str:
    """The course of a try as comma-separated values: a line for each window of the score."""
    try:
        course = result["course"]
        columns = {name: values for name, values in course.items() if name != "parts"} | course["parts"]
        rows = list(zip(*columns.values(), strict=True))
    except (KeyError, TypeError, AttributeError, ValueError) as error:
        raise InputError("this try holds no course of its score; it is damaged") from error
    text = io.StringIO(newline="")
    lines = csv.writer(text)
    lines.writerow([str(name).replace(" ", "_") for name in columns])
    lines.writerows(rows)
    return text.getvalue()
