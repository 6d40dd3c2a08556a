"""Checkpoints are data: no file makes reading run code, take more memory than the budget, or end in a traceback."""

import json
import math
import zipfile

import numpy as np
import pytest
import torch
from checkpoint_contents import flatten
from damaged_files import survives_damage, survives_hostile_json
from safetensors.torch import save_file

from kpopnet.errors import InputError
from kpopnet.networks import ModelConfig
from kpopnet.networks.checkpoint import load_network, load_state, read_meta, save_checkpoint
from kpopnet.networks.estimator import NetworkEstimator
from kpopnet.networks.network import build_network

MODEL = ModelConfig(crop_px=32, widths=[8, 8, 8, 8])


def save(run, model=MODEL, config=None):
    network = build_network(model, 1)
    meta = {"step": 5, "config": config or {}, "metrics": {}, "mean_pose_m": np.zeros((15, 3)).tolist()}
    return save_checkpoint(run, network, {"step": 5, "moments": torch.arange(3.0)}, meta, best=True), network


def rewrite_pickle(path, change, compression=zipfile.ZIP_STORED):
    """Rewrites an archive of torch.save with another pickle."""
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(path, "w", compression) as archive:
        for name, content in members.items():
            archive.writestr(name, change(content) if name.endswith("data.pkl") else content)


HUGE = 10**9


@pytest.mark.parametrize(
    ("pickled", "message"),
    [
        (b"\x80\x02cbuiltins\nbytearray\nJ" + HUGE.to_bytes(4, "little") + b"\x85R.", "GLOBAL builtins bytearray"),
        (b"\x80\x02ctorch\nTensor\nJ" + HUGE.to_bytes(4, "little") + b"\x85R.", "GLOBAL torch Tensor"),
        (b"\x80\x02cos\nsystem\nX\x04\x00\x00\x00true\x85R.", "GLOBAL os system"),
        (b"\x80\x02}r" + HUGE.to_bytes(4, "little") + b".", "LONG_BINPUT 1000000000"),
        (b"\x80\x02" + b"(" * 100 + b"X\xff\xff\xff\xff", "damaged"),
        (b"\x80\x02" + b"]" * 100 + b"a" * 99 + b".", "nested more than"),
        (b"\x80\x02K\x01.", "expected an object"),
        (b"\x80\x02}X\x04\x00\x00\x00stepN s.", "damaged"),
        (b"\x80\x02}X\x04\x00\x00\x00stepNs.", "step is None, expected int"),
    ],
)
def test_a_state_that_asks_for_more_than_it_holds_is_refused(tmp_path, pickled, message):
    folder, _ = save(tmp_path)
    rewrite_pickle(folder / "state.pt", lambda _: pickled)
    with pytest.raises(InputError, match=rf"state\.pt.*{message}.*cannot be resumed"):
        load_state(folder)


def test_a_compressed_state_is_refused(tmp_path):
    folder, _ = save(tmp_path)
    rewrite_pickle(folder / "state.pt", bytes, zipfile.ZIP_DEFLATED)
    with pytest.raises(InputError, match="compressed or encrypted"):
        load_state(folder)


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (torch.zeros(1).expand(HUGE), "larger than what is stored"),
        (torch.tensor([1.0, torch.nan]), "not finite"),
        (math.nan, "holds 'nan'"),
        (torch.zeros(2).to_sparse(), "expected tensors"),
        (bytearray(3), "expected tensors"),
    ],
)
def test_a_state_of_other_values_is_refused(tmp_path, value, message):
    folder, _ = save(tmp_path)
    torch.save({"weights": {"a": value}}, folder / "state.pt")
    with pytest.raises(InputError, match=message):
        load_state(folder)


def test_what_a_training_stores_is_read_as_it_was(tmp_path):
    network = build_network(MODEL)
    optimiser = torch.optim.AdamW(network.parameters(), fused=True)
    network(torch.zeros(2, 1, 32, 32)).joints.sum().backward()
    optimiser.step()
    state = {"step": 1, "weights": network.state_dict(), "optimiser": optimiser.state_dict(), "best_cm": math.inf}
    folder, _ = save(tmp_path)
    torch.save(state, folder / "state.pt")
    assert flatten(load_state(folder)) == flatten(state)


def test_weights_that_are_not_finite_or_of_another_type_are_refused(tmp_path):
    folder, network = save(tmp_path)
    weights = {name: value.contiguous() for name, value in network.state_dict().items()}
    name, count = next(iter(weights)), next(name for name in weights if name.endswith("num_batches_tracked"))
    for key, value, message in (
        (name, torch.full_like(weights[name], torch.nan), "not finite"),
        (name, torch.full_like(weights[name], torch.inf).half(), "not finite"),
        (name, weights[name].double(), "float64"),
        (name, weights[name].bfloat16(), "bfloat16"),
        (name, weights[name].to(torch.int8), "int8"),
        (count, weights[count].half(), "float16"),
    ):
        save_file({**weights, key: value}, folder / "model.safetensors")
        with pytest.raises(InputError, match=message):
            load_network(folder)


def test_weights_in_float16_become_float32(tmp_path):
    folder, network = save(tmp_path)
    weights = {name: value.contiguous() for name, value in network.state_dict().items()}
    halves = {name: value.half() if value.is_floating_point() else value for name, value in weights.items()}
    save_file(halves, folder / "model.safetensors")
    loaded = load_network(folder)[0].state_dict()
    assert all(loaded[name].dtype == weights[name].dtype for name in weights)
    assert all(torch.equal(loaded[name], halves[name].to(loaded[name].dtype)) for name in weights)


def test_memory_of_a_checkpoint_is_bounded(tmp_path, monkeypatch):
    folder, _ = save(tmp_path)
    meta = read_meta(folder)
    for model in ({"widths": [100_000] * 4}, {"crop_px": 100_000}, {"widths": [8] * 1000}):
        (folder / "meta.json").write_text(json.dumps(meta | {"model": meta["model"] | model}))
        with pytest.raises(InputError, match=next(iter(model))):
            read_meta(folder)
    (folder / "meta.json").write_text(json.dumps(meta))
    monkeypatch.setenv("KPOPNET_FILE_BUDGET_GB", "1e-6")
    for read in (load_network, load_state):
        with pytest.raises(InputError, match="would take"):
            read(folder)


def test_damaged_and_hostile_checkpoints_are_refused_in_one_line(tmp_path):
    folder, _ = save(
        tmp_path, model=ModelConfig(input="depth_ridge", crop_px=32, widths=[8] * 4), config={"ridge": {"sharpness": 3.0}}
    )
    survives_hostile_json(folder / "meta.json", lambda: NetworkEstimator(folder))
    assert survives_damage(folder / "meta.json", lambda: read_meta(folder)) > 100
    assert survives_damage(folder / "model.safetensors", lambda: load_network(folder)) > 100
    assert survives_damage(folder / "state.pt", lambda: load_state(folder)) > 100
