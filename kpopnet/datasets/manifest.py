"""Manifests of simulated stand-ins, which have the file format of a published set.

The manifest.json beside the files distinguishes a stand-in from the published set.
"""

import logging
from pathlib import Path

from kpopnet.errors import InputError
from kpopnet.runtime.input_files import check_fields, read_json

log = logging.getLogger(__name__)

SCHEMA = {"simulated": bool, "benchmark": str, "seed": int, "hash": str, "sequences": int, "config": dict}


def manifest_path(folder: Path) -> Path:
    """Path of the manifest of a folder of simulated files."""
    return Path(folder) / "manifest.json"


def read_manifest(folder: Path) -> dict | None:
    """Reads the manifest of a simulated set; None if the folder has no manifest.

    Raises:
        InputError: the manifest cannot be read or lacks a key.
    """
    path = manifest_path(folder)
    if not path.exists():
        return None
    try:
        return check_fields(str(path), read_json(path, non_finite=True), SCHEMA)
    except InputError as error:
        raise InputError(f"{error}; make the set again") from error


def refuse_simulated(folder: Path, real: str) -> None:
    """Rejects a folder with a manifest, so that simulated files are never read as the published set.

    Raises:
        InputError: the folder has a manifest.
    """
    manifest = read_manifest(folder)
    if manifest is not None:
        raise InputError(
            f"{folder}: simulated according to its manifest.json, and not {real}: use benchmark={manifest['benchmark']}"
        )


def open_stand_in(folder: Path, benchmark: str, truth: str, size: str) -> dict:
    """Reads and checks the manifest of a folder that should hold a stand-in.

    Args:
        folder: of the files.
        benchmark: name of the stand-in.
        truth: key of the manifest entry with the ids of the true joints in the files.
        size: size of the whole set on disk, for messages: "8 GB".

    Raises:
        InputError: there is no manifest, or it is that of another set.
    """
    manifest = read_manifest(folder)
    if manifest is None:
        raise InputError(
            f"{folder}: no manifest.json in it; `python -m synth benchmark={benchmark} out={folder}` makes "
            f"the set ({size}; with benchmark.sequences=8 a third of it)"
        )
    if manifest["benchmark"] != benchmark:
        raise InputError(f"{folder}: holds {manifest['benchmark']}, not {benchmark}: use benchmark={manifest['benchmark']}")
    return check_fields(str(manifest_path(folder)), manifest, {truth: dict})


def provenance(manifest: dict) -> dict[str, object]:
    """Seed, generator version and configuration hash of a stand-in."""
    return {"seed": manifest["seed"], "version": manifest["config"].get("generator"), "config_hash": manifest["hash"]}


def warn_if_unfinished(folder: Path, manifest: dict, found: int) -> None:
    """Logs a warning if the folder holds fewer sequences than its manifest states."""
    if found < manifest["sequences"]:
        log.warning(
            "%s: only %d of its %d sequences exist; run the command that made it again",
            *(folder, found, manifest["sequences"]),
        )
