"""The reader of films of two people: what it accepts and refuses."""

import json
from pathlib import Path

import numpy as np
import pytest
from two_people_files import CAMERA, write_two_people

from kpopnet.datasets.two_people import TwoPeopleConfig, TwoPeopleSet
from kpopnet.errors import InputError


def changed(folder: Path, **arrays: np.ndarray) -> None:
    """Replaces arrays of the sequence."""
    path = folder / "pair_00.npz"
    with np.load(path) as found:
        kept = dict(found)
    np.savez(path, **kept | arrays)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_two_people(tmp_path, frames=3)
    return tmp_path


def opened(folder: Path) -> TwoPeopleSet:
    return TwoPeopleSet(TwoPeopleConfig(path=str(folder)))


def test_a_sequence_is_read_as_it_was_written(folder: Path) -> None:
    a_set = opened(folder)
    sequence = a_set.read("pair_00")
    assert a_set.names == ["pair_00"] and sequence.kind == "side_by_side" and sequence.camera == CAMERA
    assert sequence.depth_mm.shape == (3, CAMERA.height, CAMERA.width) and sequence.joints_camera_m.shape == (3, 2, 15, 3)
    assert "SIMULATED" in a_set.about and a_set.provenance["seed"] == 3


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"depth_mm": np.zeros((2, CAMERA.height, CAMERA.width), np.uint16)}, "shape"),
        ({"depth_mm": np.zeros((3, 4, 4), np.uint16)}, "as the camera's"),
        ({"depth_mm": np.zeros((3, CAMERA.height, CAMERA.width), np.uint8)}, "uint16"),
        ({"joints_m": np.full((3, 2, 15, 3), np.nan)}, "finite metres"),
        ({"joints_m": np.full((3, 2, 15, 3), 2500.0)}, "finite metres"),
        ({"seen_px": np.full((3, 2), 10**6)}, "at most alone_px"),
        ({"seen_px": np.full((3, 2), -1)}, "at least 0"),
    ],
)
def test_what_does_not_fit_is_refused_in_one_line(folder: Path, arrays: dict, message: str) -> None:
    changed(folder, **arrays)
    with pytest.raises(InputError, match=message) as refused:
        opened(folder).read("pair_00")
    assert "\n" not in str(refused.value) and "pair_00.npz" in str(refused.value)


def test_a_damaged_manifest_and_an_empty_folder_are_refused(folder: Path, tmp_path_factory) -> None:
    manifest = json.loads((folder / "manifest.json").read_text())
    for change, message in (({"fps": 0}, "fps"), ({"camera": {}}, "camera"), ({"benchmark": "eval_sim"}, "eval_sim")):
        (folder / "manifest.json").write_text(json.dumps(manifest | change))
        with pytest.raises(InputError, match=message):
            opened(folder)
    (folder / "manifest.json").write_text(json.dumps(manifest | {"contents": {}}))
    with pytest.raises(InputError, match="kind of scene of pair_00"):
        opened(folder).read("pair_00")
    with pytest.raises(InputError, match=r"no manifest.json"):
        opened(tmp_path_factory.mktemp("empty"))


def test_an_array_larger_than_the_budget_is_refused_before_it_is_read(folder: Path, monkeypatch) -> None:
    monkeypatch.setenv("KPOPNET_FILE_BUDGET_GB", "0.0001")
    with pytest.raises(InputError, match="KPOPNET_FILE_BUDGET_GB"):
        opened(folder).read("pair_00")
