"""The tool that averages two networks: through its main function."""

import sys

import numpy as np
import pytest
import torch
from checkpoints import SMALL, save_untrained
from programs import tool

from kpopnet.networks import ModelConfig
from kpopnet.networks.checkpoint import load_network
from kpopnet.networks.network import build_network

average_networks = tool("average_networks")


@pytest.fixture
def run(monkeypatch):
    def main(*words):
        monkeypatch.setattr(sys, "argv", ["average_networks.py", *map(str, words)])
        average_networks.main()

    return main


def test_every_weight_lies_between_those_of_both_networks(run, tmp_path):
    folders = []
    for seed in range(2):
        torch.manual_seed(seed)
        folders.append(save_untrained(tmp_path / f"run_{seed}", SMALL, build_network(SMALL), step=seed + 5))
    run(*folders, "--share", 0.25, "--out", tmp_path / "average")
    (mixed, meta), *both = (load_network(one) for one in (tmp_path / "average", *folders))
    assert meta["step"] == 6 and meta["averaged"] == {"share": 0.25}
    for name, value in mixed.state_dict().items():
        before, after = (one.state_dict()[name].double() for one, _ in both)
        np.testing.assert_allclose(value.double(), 0.75 * before + 0.25 * after, atol=1e-6)


def test_networks_of_two_models_and_a_folder_that_exists_are_refused(run, tmp_path, capsys):
    one, other = (
        save_untrained(tmp_path / name, model)
        for name, model in (("a", SMALL), ("b", ModelConfig(crop_px=32, widths=[8, 8, 8, 16])))
    )
    for words, message in (
        ((one, other, "--out", tmp_path / "c"), "two models"),
        ((one, one, "--out", tmp_path), "exists already"),
    ):
        with pytest.raises(SystemExit):
            run(*words)
        assert message in capsys.readouterr().err
