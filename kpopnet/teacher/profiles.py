"""Profiles: names of those who dance on this machine, and which tries are theirs to see, to take along and to delete."""

import contextlib
import io
import json
import re
import secrets
import zipfile
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from kpopnet.errors import InputError
from kpopnet.languages import Said
from kpopnet.runtime.atomic_write import write_whole
from kpopnet.runtime.input_files import can_be_printed, check_names, plain_name, read_json, settings_from
from kpopnet.teacher.tries import Tries

WHO = re.compile("p_[0-9a-f]{8}")
MAX_LETTERS = 40


@dataclass(frozen=True)
class Profile:
    """What is kept of a person beside their tries."""

    name: str  # as they are greeted, 1 to MAX_LETTERS letters

    def __post_init__(self) -> None:
        check_names("name", [self.name])
        object.__setattr__(self, "name", plain_name(self.name))
        known = can_be_printed(self.name) and self.name == self.name.strip() and 1 <= len(self.name) <= MAX_LETTERS
        if not known:
            text = "a name has 1 to {most} letters that can be printed, without spaces around them"
            raise InputError(Said(text, most=MAX_LETTERS))


class Profiles:
    """The folder of the profiles: WHO.json for each, where WHO is drawn at random and never a name; their tries name WHO."""

    def __init__(self, folder: Path, tries: Tries) -> None:
        self.folder, self._tries = Path(folder), tries

    def names(self) -> dict[str, str]:
        """Each profile's name, in the order of the names; a damaged one is left out."""
        found = {}
        for path in self.folder.glob("*.json"):
            with contextlib.suppress(InputError):
                found[path.stem] = self.profile(path.stem).name
        return dict(sorted(found.items(), key=lambda item: item[1].casefold()))

    def profile(self, who: str) -> Profile:
        """Raises InputError if there is none."""
        path = self._path(who)
        if not WHO.fullmatch(who) or not path.is_file():
            raise InputError(Said("there is no such profile"))
        return settings_from(Profile, read_json(path), str(path))

    def _path(self, who: str) -> Path:
        return self.folder / f"{who}.json"

    def add(self, profile: Profile) -> str:
        """Writes a new profile and returns its WHO. Raises InputError if the name is taken."""
        if profile.name.casefold() in map(str.casefold, self.names().values()):
            raise InputError(Said("{name} dances here already; choose another name", name=profile.name))
        self.folder.mkdir(parents=True, exist_ok=True)
        who = f"p_{secrets.token_hex(4)}"  # random: the tries of a deleted profile never become another's
        write_whole(self.folder / f"{who}.json", json.dumps(asdict(profile), ensure_ascii=False))
        return who

    def export(self, who: str) -> bytes:
        """The profile and all its tries as a zip archive; films are left out, they can be made again."""
        content = io.BytesIO()
        with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("profile.json", json.dumps(asdict(self.profile(who)), ensure_ascii=False))
            for dance, name in self._tries.of(who):
                result = self._tries.path(dance, name, "json")
                for path in (result.with_suffix(".npz"), result):
                    if path.is_file():
                        archive.write(path, f"tries/{dance}/{path.name}")
        return content.getvalue()

    def keep(self, result: dict, arrays: dict[str, np.ndarray]) -> str:
        """Saves a try, of which `result["who"]` says whose it is, and returns its name.

        Raises InputError, and nothing is left of the try, if that profile is deleted, also while it is saved.
        """
        who = result["who"]
        if who:
            self.profile(who)
        name = self._tries.save(result, arrays)
        if who and not self._path(who).is_file():
            self._tries.remove(result["dance"], name)
            raise InputError(Said("there is no such profile"))
        return name

    def delete(self, who: str) -> None:
        """Deletes the profile, then all its tries and their films."""
        self.profile(who)
        self._path(who).unlink()  # first: a dance that ends meanwhile is not kept
        for dance, name in self._tries.of(who):
            with contextlib.suppress(InputError):  # `keep` was faster
                self._tries.remove(dance, name)
        self._tries.remove_unfinished()
