"""Tests that need a GPU: bfloat16 in the encoder, NCCL, batch normalisation over the whole batch."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from capsule_people import CapsulePeople
from programs import run_program
from room_image_files import write_room_images

from kpopnet.data.batches import AugmentConfig, CropBatches, ShuffledOrder
from kpopnet.networks import ModelConfig
from kpopnet.networks.checkpoint import read_meta
from kpopnet.networks.estimator import NetworkEstimator
from kpopnet.runtime.input_files import read_json
from kpopnet.training.distributed import Processes
from kpopnet.training.finder import META, FinderRun, FinderTraining, train_finder
from kpopnet.training.loop import Run, RunConfig, TrainingConfig, train

pytestmark = [
    pytest.mark.skipif(not torch.cuda.is_available(), reason="torch finds no GPU"),
    # On GPUs determinism is requested with warn_only: torch warns of operations without a deterministic version.
    pytest.mark.filterwarnings("ignore:.*determinis.*:UserWarning"),
]

MODEL = ModelConfig(crop_px=32, widths=[8, 8, 16, 16])
SHORT = TrainingConfig(steps=6, batch_size=8, validate_every=2, validation_samples=8)


def gradient(device: str) -> tuple[torch.Tensor, list[torch.dtype]]:
    """The gradient of one batch in training, moved to the CPU, and the data types of the encoder's maps."""
    order, patches = ShuffledOrder(20, 16, 0), device == "cuda"
    batches = CropBatches(CapsulePeople(20, seed=1), MODEL, order, 0, AugmentConfig(), patches=patches)
    batch = torch.utils.data.default_convert(batches[0])
    run = Run(SHORT, MODEL, 0, Processes(torch.device(device)))
    types = []
    run.network.encoder.register_forward_hook(lambda module, inputs, maps: types.extend(x.dtype for x in maps))
    run.network.train()
    crop = batch.crop.crops(torch.device(device)) if patches else batch.crop
    losses = run.network.loss(run.data_parallel(crop), batch.target.to(device))
    sum(losses.values()).backward()
    return torch.cat([weight.grad.flatten() for weight in run.network.parameters()]).cpu(), types


def test_the_gradient_in_bfloat16_has_the_direction_of_that_in_float32():
    """So few channels and so small a batch show rounding most: on an H200 the cosine was 0.974."""
    (half, half_types), (full, full_types) = gradient("cuda"), gradient("cpu")
    assert half_types == [torch.bfloat16] * 3
    assert full_types == [torch.float32] * 3
    assert torch.cosine_similarity(half, full, dim=0) > 0.95
    assert half.norm() / full.norm() == pytest.approx(1, abs=0.1)


def test_a_training_on_a_gpu_resumes_and_its_network_estimates_equally_on_gpu_and_cpu(tmp_path):
    people, others = CapsulePeople(20, seed=1), CapsulePeople(8, seed=2)

    def run(training: TrainingConfig) -> Path:
        config = RunConfig(MODEL, training, device="cuda", threads=1)
        return train(config, people, others, tmp_path)

    last = run(SHORT)
    last = run(replace(SHORT, steps=8, resume=str(last)))
    assert read_meta(last)["step"] == 8
    seen = others.observe(0, 0)
    here, there = (NetworkEstimator(last, device).estimate(seen.depth_m[None], seen.camera) for device in ("cpu", "cuda"))
    assert np.isfinite(here.joints_camera_m).all()
    np.testing.assert_allclose(there.joints_camera_m, here.joints_camera_m, atol=0.005)
    np.testing.assert_allclose(there.confidence, here.confidence, atol=0.02)


def test_a_gpu_goes_on_with_a_finder_whose_training_a_cpu_began(tmp_path):
    data = {name: str(write_room_images(tmp_path / name)) for name in ("train", "validation")}

    def stopped(run: FinderRun, described: dict, save: Callable[[FinderRun, dict], None] = FinderRun.save) -> None:
        save(run, described)
        raise KeyboardInterrupt

    def trained(device: str, resume: bool) -> None:
        settings = FinderTraining(steps=40, batch_size=4, lr=5e-3, validate_every=4, resume=resume)
        train_finder(settings, 0, data, tmp_path / "run", 1, device)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(FinderRun, "save", stopped)
        with pytest.raises(KeyboardInterrupt):
            trained("cpu", resume=False)
    first = read_json(tmp_path / "run" / META)
    trained("cuda", resume=True)
    last = read_json(tmp_path / "run" / META)
    assert (first["step"], last["step"]) == (4, 40)
    assert last["metrics"]["loss"] < 0.5 * first["metrics"]["loss"]


STEP = """
import os, sys
import torch
from torch import distributed
from capsule_people import CapsulePeople
from kpopnet.data.batches import CropBatches, ShuffledOrder, AugmentConfig
from kpopnet.networks import ModelConfig
from kpopnet.training.distributed import Processes, join_processes, set_up_torch
from kpopnet.training.loop import Run, TrainingConfig

model = ModelConfig(crop_px=32, widths=[8, 8, 16, 16])
wrapped = sys.argv[2] == "wrapped"
with join_processes("cuda") as processes:
    set_up_torch(1)
    rank, count = processes.rank, processes.count
    if wrapped and count == 1:
        # NCCL refuses two processes on one GPU; a single process runs the same code.
        processes = Processes(torch.device("cuda", 0), 0, 2)
        distributed.init_process_group("nccl")
    run = Run(TrainingConfig(steps=3, batch_size=16), model, 0, processes)
    batch = CropBatches(CapsulePeople(20, seed=1), model, ShuffledOrder(20, 16, 0, rank, count), 0, AugmentConfig())[0]
    run.update(torch.utils.data.default_convert(batch))
    gradient = torch.cat([weight.grad.flatten() for weight in run.network.parameters()]).cpu()
    statistics = torch.cat([value.flatten() for name, value in run.network.state_dict().items() if "running" in name]).cpu()
    kinds = {type(module).__name__ for module in run.network.modules()}
    if rank == 0:
        torch.save((gradient, statistics, sorted(kinds), distributed.is_initialized()), sys.argv[1])
    if wrapped and count == 1:
        distributed.destroy_process_group()
"""


def a_step(folder: Path, processes: int, how: str) -> tuple[torch.Tensor, torch.Tensor, list[str], bool]:
    """The gradient and the running statistics after one step with this number of processes."""
    script, out = folder / "step.py", folder / f"{processes}_{how}.pt"
    script.write_text(STEP)
    done = run_program(script, folder, out, how, processes=processes)
    assert done.returncode == 0, done.stderr
    return torch.load(out, weights_only=True)


@pytest.mark.parametrize("processes", [1, 2])
def test_processes_joined_by_nccl_take_the_step_of_one_process(tmp_path, processes):
    """This includes batch normalisation over the whole batch, as the running statistics show."""
    if torch.cuda.device_count() < processes:
        pytest.skip(f"needs {processes} GPUs, there are {torch.cuda.device_count()}")
    gradient, statistics, _, joined = a_step(tmp_path, 1, "plain")
    assert not joined
    other_gradient, other_statistics, kinds, joined = a_step(tmp_path, processes, "wrapped")
    assert joined
    assert "SyncBatchNorm" in kinds and "BatchNorm2d" not in kinds
    assert torch.cosine_similarity(gradient, other_gradient, dim=0) > 0.98
    assert (other_statistics - statistics).norm() < 0.01 * statistics.norm()
