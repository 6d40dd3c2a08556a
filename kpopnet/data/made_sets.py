"""What the sets that are made for trainings have in common: files of a pattern, and a manifest that says what made them."""

from bisect import bisect_right
from pathlib import Path
from typing import NamedTuple

from kpopnet.errors import InputError
from kpopnet.runtime.atomic_write import write_json
from kpopnet.runtime.input_files import expect, read_json

MANIFEST = "manifest.json"


class Identity(NamedTuple):
    """What tells sets of one kind apart."""

    hash: str  # of its settings
    split: str


def made_files(folder: Path | str, pattern: str, benchmark: str) -> tuple[list[Path], Identity]:
    """The files of a set in order, and what it is; raises InputError for none, or a damaged manifest."""
    folder = Path(folder)
    paths = sorted(folder.glob(pattern))
    if not paths:
        split = " benchmark.split=validation" if folder.name == "validation" else ""
        place = folder.parent.with_name(benchmark) / folder.name if (folder / MANIFEST).exists() else folder
        command = f"python -m synth benchmark={benchmark}{split} out={place}"
        raise InputError(f"{folder}: no {benchmark.replace('_', ' ')} ({pattern}) in this folder; make some: {command}")
    manifest = read_json(folder / MANIFEST)
    try:
        return paths, Identity(str(manifest["hash"]), str(manifest["config"]["benchmark"]["split"]))
    except (KeyError, TypeError):
        raise InputError(f"{folder}/{MANIFEST}: expected a hash and the split of a benchmark") from None


def located(ends: list[int], index: int) -> tuple[int, int]:
    """The file of a sample, and its row there, by how many samples there are up to the end of each file."""
    file = bisect_right(ends, index)
    return file, index - (ends[file - 1] if file else 0)


def claim_folder(folder: Path, pattern: str, settings: dict[str, str | int | float | None]) -> None:
    """Says in the manifest of a folder what its files are made with, before the first of them; those of an earlier run stay.

    Raises InputError if files there were made with other settings, or have no manifest.
    """
    path = folder / MANIFEST
    if not any(folder.glob(pattern)):
        write_json(path, settings)
        return
    if not path.exists():
        raise InputError(f"{folder}: holds {pattern} without a {MANIFEST} that says what made them; give another folder")
    found = read_json(path)
    expect(isinstance(found, dict), str(path), "settings by name")
    if other := [f"{name}={found.get(name)}" for name in settings | found if found.get(name) != settings.get(name)]:
        raise InputError(f"{folder}: holds files made with {', '.join(other)}; give another folder")


def check_others(train: Identity, validation: Identity, folder: Path | str) -> None:
    """Raises InputError where the validation set in `folder` is of those who are trained on."""
    if train.split == validation.split or train.hash == validation.hash:
        remedy = "make it with benchmark.split=validation, or take the samples of splits.validation"
        raise InputError(f"{folder}: the same people and scenes as are trained on (split {validation.split}); {remedy}")
