"""Simulated stand-ins for published sets: what tells them from the real ones is the manifest that lies beside the files."""

import json
import logging
from pathlib import Path

from kpopnet.errors import InputError

log = logging.getLogger(__name__)

KEYS = {"simulated", "benchmark", "seed", "hash", "sequences", "config"}


def manifest_path(folder: Path) -> Path:
    """What lies beside simulated files and says so."""
    return Path(folder) / "manifest.json"


def read_manifest(folder: Path) -> dict | None:
    """What a simulated set says of itself, or None where there is no manifest.

    Raises:
        InputError: there is one, and it cannot be read.
    """
    path = manifest_path(folder)
    if not path.exists():
        return None
    try:
        manifest = json.loads(path.read_text())
        missing = KEYS - set(manifest)
    except (ValueError, TypeError) as error:
        raise InputError(f"{path}: not readable as a manifest ({error}); make the set anew") from error
    if missing:
        raise InputError(f"{path}: lacks {', '.join(sorted(missing))}; make the set anew")
    return manifest


def refuse_simulated(folder: Path, real: str) -> None:
    """Files with a manifest are never taken for the published set.

    Raises:
        InputError: there is a manifest.
    """
    manifest = read_manifest(folder)
    if manifest is not None:
        raise InputError(
            f"{folder}: simulated, as its manifest.json says, and not {real}: take benchmark={manifest['benchmark']}"
        )


def open_stand_in(folder: Path, benchmark: str, truth: str, size: str) -> dict:
    """The manifest of a folder that is to hold a stand-in.

    Args:
        folder: of the files.
        benchmark: the stand-in's name.
        truth: the manifest's key that says where the truth of each joint lies in the files.
        size: of the whole set, for messages: "8 GB".

    Raises:
        InputError: no manifest, or another set's.
    """
    manifest = read_manifest(folder)
    if manifest is None:
        raise InputError(
            f"{folder}: no manifest.json that says what it is; `python -m synth benchmark={benchmark} out={folder}` makes "
            f"the set ({size}; with benchmark.sequences=8 a third of it)"
        )
    if manifest["benchmark"] != benchmark:
        raise InputError(f"{folder}: holds {manifest['benchmark']}, not {benchmark}: take benchmark={manifest['benchmark']}")
    if truth not in manifest:
        raise InputError(f"{manifest_path(folder)}: lacks {truth}; make the set anew")
    return manifest


def provenance(manifest: dict) -> dict[str, object]:
    """Which set of its kind a stand-in is."""
    return {"seed": manifest["seed"], "version": manifest["config"].get("generator"), "config_hash": manifest["hash"]}


def warn_if_unfinished(folder: Path, manifest: dict, found: int) -> None:
    if found < manifest["sequences"]:
        log.warning(
            "%s: %d of its %d sequences are there; run the command that made it again",
            *(folder, found, manifest["sequences"]),
        )
