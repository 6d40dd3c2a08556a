"""What the sets that `python -m synth benchmark=...` makes for trainings have in common: files of a pattern, and a manifest."""

from pathlib import Path

from kpopnet.errors import InputError
from kpopnet.runtime.input_files import expect, read_json


def made_files(folder: Path | str, pattern: str, benchmark: str) -> tuple[list[Path], str]:
    """The files of a set in order, and the hash of its settings; raises InputError for none, or a damaged manifest."""
    folder = Path(folder)
    paths = sorted(folder.glob(pattern))
    if not paths:
        split = " benchmark.split=validation" if folder.name == "validation" else ""
        command = f"python -m synth benchmark={benchmark}{split} out={folder}"
        raise InputError(f"{folder}: no {benchmark.replace('_', ' ')} ({pattern}) in this folder; make some: {command}")
    manifest = read_json(folder / "manifest.json")
    expect(isinstance(manifest, dict) and "hash" in manifest, f"{folder}/manifest.json", "a hash")
    return paths, str(manifest["hash"])


def check_others(train_hash: str, validation_hash: str, folder: Path | str) -> None:
    """Raises InputError where the validation set in `folder` is what is trained on."""
    if train_hash == validation_hash:
        raise InputError(f"{folder}: the same people and scenes as are trained on; make it with benchmark.split=validation")
