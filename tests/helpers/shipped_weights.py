"""A network as if it came with the package."""

import importlib.util
import shutil
import sys
from pathlib import Path

import pytest
from programs import ROOT

import kpopnet.weights

sys.path.insert(0, str(ROOT / "tools"))
import ship_weights as tool


def ship(checkpoint: Path, folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Writes a checkpoint into a folder as tools/ship_weights.py does, and lets the package take it for its own."""
    folder.mkdir()
    shutil.copy(kpopnet.weights.__file__, folder)
    tool.ship(checkpoint, folder)
    monkeypatch.setattr(kpopnet.weights, "FOLDER", folder)
    monkeypatch.setattr(kpopnet.weights, "SHA256", digests(folder))
    return folder


def digests(folder: Path) -> dict[str, str]:
    """What the `__init__.py` of such a folder says."""
    spec = importlib.util.spec_from_file_location("shipped", folder / "__init__.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    assert folder == module.FOLDER
    return module.SHA256
