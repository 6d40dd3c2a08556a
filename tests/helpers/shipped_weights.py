"""A network as if it came with the package."""

import runpy
import shutil
from pathlib import Path

import pytest
from programs import tool

import kpopnet.weights

ship_weights = tool("ship_weights")


def ship(checkpoint: Path, folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Writes a checkpoint into a folder as tools/ship_weights.py does, and lets the package take it for its own."""
    folder.mkdir()
    module = Path(shutil.copy(kpopnet.weights.__file__, folder))
    ship_weights.ship(checkpoint, folder)
    for name in kpopnet.weights.OVER_TIME_SHA256:
        shutil.copy(kpopnet.weights.FOLDER / name, folder)
    monkeypatch.setattr(kpopnet.weights, "FOLDER", folder)
    monkeypatch.setattr(kpopnet.weights, "SHA256", runpy.run_path(str(module))["SHA256"])
    return folder
