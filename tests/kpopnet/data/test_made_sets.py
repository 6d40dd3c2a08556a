"""Folders of made files: a claim on them by what the files are made with."""

import pytest

from kpopnet.data.made_sets import claim_folder
from kpopnet.errors import InputError

MADE_WITH = {"weights": "12ab", "seed": 3, "clips": None}


def test_a_folder_takes_files_of_one_origin(tmp_path):
    folder = tmp_path / "new" / "films"
    claim_folder(folder, "*.npz", MADE_WITH | {"seed": 4})  # of a run that made no file
    claim_folder(folder, "*.npz", MADE_WITH)
    (folder / "film_0.npz").touch()
    claim_folder(folder, "*.npz", MADE_WITH)  # it goes on
    for other in ({"weights": "34cd"}, {"seed": 4}, {"clips": "pack"}):
        (name,) = other
        with pytest.raises(InputError, match=f"films: holds files made with {name}={MADE_WITH[name]}; give another folder"):
            claim_folder(folder, "*.npz", MADE_WITH | other)
    with pytest.raises(InputError, match="holds files made with fps=None"):
        claim_folder(folder, "*.npz", MADE_WITH | {"fps": 30.0})
    (folder / "manifest.json").write_text("[]")
    with pytest.raises(InputError, match=r"manifest\.json: expected settings by name"):
        claim_folder(folder, "*.npz", MADE_WITH)
    (folder / "manifest.json").unlink()
    with pytest.raises(InputError, match=r"holds \*\.npz without a manifest\.json that says what .*; give another folder"):
        claim_folder(folder, "*.npz", MADE_WITH)
    assert not (folder / "manifest.json").exists()
