"""The loop: it learns, resumes bit for bit, stops before a bad update, and several processes agree with one."""

import json
import math
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from capsule_people import CapsulePeople
from checkpoint_contents import contents, flatten
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from kpopnet.checkpoint import read_meta
from kpopnet.crops import AugmentConfig, CropBatches, ShuffledOrder
from kpopnet.errors import InputError
from kpopnet.networks import ModelConfig, build_network
from kpopnet.networks.estimator import NetworkEstimator
from kpopnet.processes import Processes, join_processes
from kpopnet.training import Run, TrainingConfig, decay_at, lr_at, train, validation_batches, weight_groups
from kpopnet.validation import validate

ROOT = Path(__file__).parents[2]
MODEL = ModelConfig(crop_px=32, widths=[8, 8, 16, 16])
SHORT = TrainingConfig(steps=6, batch_size=8, validate_every=2, validation_samples=8, log_every=2)
PEOPLE, OTHERS = CapsulePeople(20, seed=1), CapsulePeople(8, seed=2)


@pytest.fixture(autouse=True)
def as_before():
    """Training sets torch's threads and determinism for the process."""
    yield
    torch.use_deterministic_algorithms(False)


def run_short(out, config=SHORT, model=MODEL, **settings):
    settings = {"device": "cpu", "workers": 0, "threads": 1, "described": {"seed": 0}} | settings
    return train(config, model, PEOPLE, OTHERS, out=out, **settings)


@pytest.mark.parametrize("kind", ["holistic", "dense"])
def test_a_resumed_run_is_the_run_that_was_not_stopped(tmp_path, kind):
    model = replace(MODEL, kind=kind)
    whole = run_short(tmp_path / "whole", model=model)

    class StoppedError(Exception):
        pass

    class Stopping(CapsulePeople):
        def observe(self, index, epoch):
            if epoch == 1 and self.left == 0:
                raise StoppedError
            self.left -= epoch
            return super().observe(index, epoch)

    stopping = Stopping(20, seed=1)
    stopping.left = 14  # in the middle of step 4, of the second epoch, after the checkpoint of step 4
    with pytest.raises(StoppedError):
        train(SHORT, model, stopping, OTHERS, out=tmp_path / "parts", device="cpu", workers=0, threads=1)
    assert read_meta(tmp_path / "parts" / "last")["step"] == 4
    resumed = run_short(tmp_path / "parts", replace(SHORT, resume=str(tmp_path / "parts" / "last")), model)

    (weights, state, meta), (other_weights, other_state, other_meta) = contents(whole), contents(resumed)
    assert weights == other_weights
    assert state == other_state
    assert state["step"] == 6
    assert meta["metrics"] == other_meta["metrics"]
    assert meta["mean_pose_m"] == other_meta["mean_pose_m"]


def test_workers_change_nothing(tmp_path):
    here = run_short(tmp_path / "here", replace(SHORT, steps=2))
    there = run_short(tmp_path / "there", replace(SHORT, steps=2), workers=1)
    assert contents(here)[:2] == contents(there)[:2]


def test_the_seed_changes_everything(tmp_path):
    first, second = (run_short(tmp_path / str(seed), replace(SHORT, steps=2), seed=seed) for seed in (0, 1))
    assert contents(first)[0] != contents(second)[0]


def test_a_checkpoint_says_what_it_is(tmp_path):
    meta = read_meta(run_short(tmp_path))
    assert meta["step"] == 6
    assert meta["config"] == {"seed": 0}
    assert meta["model"]["crop_px"] == 32
    assert set(meta["metrics"]) == {"mean_error_cm", "within_10cm", "mean_confidence"}
    assert meta["joint_names"][0] == "head"
    assert meta["packages"]["torch"] == torch.__version__
    # 48 samples of 20 people: the mean pose is nearly that of all of them.
    plain = CropBatches(PEOPLE, MODEL, ShuffledOrder(20, 20, 0), 0, None)[0].offset_m.mean(axis=0)
    np.testing.assert_allclose(meta["mean_pose_m"], plain, atol=0.1)
    scalars = EventAccumulator(str(tmp_path)).Reload()
    assert {"train/loss", "train/error_cm", "train/lr", "validation/mean_error_cm"} <= set(scalars.Tags()["scalars"])
    assert [event.step for event in scalars.Scalars("train/loss")] == [2, 4, 6]
    assert scalars.Tags()["images"] == ["validation/predictions"]


def test_training_learns(tmp_path):
    """A minute network on balls, far better than the mean pose after a few hundred steps."""
    config = TrainingConfig(
        steps=200, batch_size=16, lr=6e-3, augment=AugmentConfig(rotation_deg=5, occluder=0), validate_every=200,
        validation_samples=64,
    )  # fmt: skip
    model = ModelConfig(crop_px=48, widths=[8, 16, 16, 32])
    people, others = CapsulePeople(500, seed=1), CapsulePeople(64, seed=2)
    folder = train(config, model, people, others, out=tmp_path, device="cpu", workers=0, threads=1)
    meta = read_meta(folder)
    mean_pose = np.array(meta["mean_pose_m"])
    truth = validation_batches(others, model, config, 0)
    baseline = np.concatenate([np.linalg.norm(batch.offset_m.numpy() - mean_pose, axis=-1) for batch in truth]).mean()
    assert meta["metrics"]["mean_error_cm"] < 100 * baseline / 2
    # And the estimator finds, in the picture itself, what validation found in the crops.
    estimator = NetworkEstimator(folder)
    errors = []
    for index in range(8):
        seen = others.observe(index, 0)
        estimate = estimator.estimate(seen.depth_m[None], seen.camera)
        errors.append(np.linalg.norm(estimate.joints_camera_m[0] - seen.joints_camera_m, axis=-1))
    assert abs(100 * np.mean(errors) - meta["metrics"]["mean_error_cm"]) < 3


def test_validation_measures_metres():
    """A network that says (0, 0, 0) is off by each joint's distance from the centre of its cube."""
    batches = validation_batches(OTHERS, MODEL, SHORT, 0)
    network = build_network(replace(MODEL, kind="holistic"))
    for weight in network.head.parameters():
        torch.nn.init.zeros_(weight)
    metrics, estimates = validate(network, batches, torch.device("cpu"))
    distances = np.concatenate([np.linalg.norm(batch.offset_m.numpy(), axis=-1) for batch in batches])
    np.testing.assert_allclose(metrics["mean_error_cm"], 100 * distances.mean(), rtol=1e-4)
    np.testing.assert_allclose(metrics["within_10cm"], (distances < 0.1).mean(), atol=1e-6)
    assert metrics["mean_confidence"] == 0.5
    assert estimates.shape == (8, 15, 3)


def first_batch(**augment):
    order = ShuffledOrder(len(PEOPLE), 8, 0)
    return torch.utils.data.default_convert(CropBatches(PEOPLE, MODEL, order, 0, AugmentConfig(**augment))[0])


@pytest.mark.parametrize("field", ["crop", "target"])
def test_what_is_not_finite_stops_before_the_update(field):
    run = Run(SHORT, MODEL, 0, Processes(torch.device("cpu")))
    batch = first_batch()
    run.update(batch)
    before = (
        flatten(run.network.head.state_dict()),
        flatten(run.optimiser.state_dict()),
        flatten(run.average.state_dict()),
    )
    bad = getattr(batch, field).clone()
    bad.view(-1)[5] = math.nan
    with pytest.raises(InputError, match=r"step 1: loss nan.*before the update.*training\.lr"):
        run.update(batch._replace(**{field: bad}))
    after = (
        flatten(run.network.head.state_dict()),
        flatten(run.optimiser.state_dict()),
        flatten(run.average.state_dict()),
    )
    assert [part == other for part, other in zip(before, after, strict=True)][1:] == [True, True]
    weights = {name for name, _ in run.network.head.named_parameters()}
    assert all(before[0][name] == after[0][name] for name in weights)
    assert run.step == 1


def test_the_learning_rate_cycles_once():
    config = TrainingConfig(steps=1000, lr=1e-3, warmup=0.1)
    rates = [lr_at(step, config) for step in range(1001)]
    assert rates[0] == pytest.approx(1e-3 / 25)
    assert max(rates) == rates[100] == pytest.approx(1e-3)
    assert rates[550] == pytest.approx((1e-3 + 1e-7) / 2)
    assert rates[1000] == pytest.approx(1e-7)
    assert rates[:101] == sorted(rates[:101])
    assert rates[100:] == sorted(rates[100:], reverse=True)
    assert lr_at(0, replace(config, warmup=0)) == pytest.approx(1e-3)


def test_the_average_forgets_its_beginning():
    config = TrainingConfig()
    assert decay_at(0, config) == 0.1
    assert decay_at(10**6, config) == config.average
    run = Run(SHORT, MODEL, 0, Processes(torch.device("cpu")))
    fresh = {name: value.clone() for name, value in run.network.state_dict().items()}
    run.update(first_batch())
    for name, value in run.network.state_dict().items():
        averaged = run.average.state_dict()[name]
        expected = 0.1 * fresh[name] + 0.9 * value if value.is_floating_point() else value
        torch.testing.assert_close(averaged, expected)


def test_only_weights_decay():
    network = build_network(MODEL)
    decaying, others = weight_groups(network, 0.01)
    names = {id(weight): name for name, weight in network.named_parameters()}
    assert len(decaying["params"]) + len(others["params"]) == len(names)
    assert others["weight_decay"] == 0
    assert all(names[id(weight)].endswith("weight") for weight in decaying["params"])
    norms = {name for name, module in network.named_modules() if isinstance(module, torch.nn.BatchNorm2d)}
    assert not any(names[id(weight)].rpartition(".")[0] in norms for weight in decaying["params"])
    assert all(names[id(w)].endswith("bias") or names[id(w)].rpartition(".")[0] in norms for w in others["params"])


def test_resuming_refuses_what_it_cannot_continue(tmp_path):
    last = str(run_short(tmp_path))
    with pytest.raises(InputError, match="finished already, 6 of 6 steps"):
        run_short(tmp_path, replace(SHORT, resume=last))
    with pytest.raises(InputError, match="not the weights"):
        run_short(tmp_path, replace(SHORT, steps=8, resume=last), replace(MODEL, widths=[8, 8, 16, 24]))
    with pytest.raises(InputError, match="no checkpoint there"):
        run_short(tmp_path, replace(SHORT, resume=str(tmp_path / "nowhere")))


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        ({"steps": 0}, "training.steps=0"),
        ({"lr": -1.0}, "training.lr"),
        ({"warmup": 1.0}, "training.warmup=1.0"),
        ({"validate_every": 0}, "training.validate_every=0"),
    ],
)
def test_a_wrong_setting_is_named(wrong, named):
    with pytest.raises(InputError, match=named):
        TrainingConfig(**wrong)


def test_an_unknown_device_is_named():
    with pytest.raises(InputError, match="device=tpu"), join_processes("tpu"):
        pass


GRADIENTS = """
import sys
import torch
from capsule_people import CapsulePeople
from kpopnet.crops import CropBatches, ShuffledOrder, AugmentConfig
from kpopnet.networks import ModelConfig
from kpopnet.processes import join_processes, set_up_torch
from kpopnet.training import Run, TrainingConfig

model = ModelConfig(crop_px=32, widths=[8, 8, 16, 16])


def share(rank, count):
    batches = CropBatches(CapsulePeople(20, seed=1), model, ShuffledOrder(20, 8, 0, rank, count), 0, AugmentConfig())
    return torch.utils.data.default_convert(batches[0])


def gradient(shares, training):
    run.network.train(training)
    run.optimiser.zero_grad()
    for batch in shares:
        (sum(run.network.head.loss(run.callable(batch.crop), batch.target).values()) / len(shares)).backward()
    return torch.cat([weight.grad.flatten() for weight in run.network.parameters()])


with join_processes("cpu") as processes:
    set_up_torch(1)
    run = Run(TrainingConfig(steps=3, batch_size=8), model, 0, processes)
    if processes.count == 1:
        gradients = gradient([share(0, 1)], False), gradient([share(0, 2), share(1, 2)], True), gradient([share(0, 1)], True)
    else:
        own = [share(processes.rank, processes.count)]
        gradients = gradient(own, False), gradient(own, True)
    if processes.rank == 0:
        torch.save(gradients, sys.argv[1])
"""


def torchrun(processes, script, *arguments, cwd):
    command = [sys.executable, "-m", "torch.distributed.run", "--standalone", f"--nproc-per-node={processes}"]
    environment = {
        **os.environ, "PYTHONPATH": os.pathsep.join((str(ROOT), str(ROOT / "tests"))), "OMP_NUM_THREADS": "1",
        "PYTHONWARNINGS": "default", "PYTHONFAULTHANDLER": "1",
    }  # fmt: skip
    done = subprocess.run(
        [*command, str(script), *map(str, arguments)], cwd=cwd, env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr


def test_the_gradient_of_two_processes_is_that_of_one(tmp_path):
    """With normalisation on its running statistics it is the whole batch's gradient. In training each process on a CPU
    normalises by the statistics of its own share (`Processes.spread`), so there it is the mean of the gradients that
    one process finds on each share by itself, and not the whole batch's. GPUs share the statistics: `test_cuda`.
    """
    script = tmp_path / "gradients.py"
    script.write_text(GRADIENTS)
    found = []
    for processes in (1, 2):
        torchrun(processes, script, tmp_path / f"{processes}.pt", cwd=tmp_path)
        found.append(torch.load(tmp_path / f"{processes}.pt", weights_only=True))
    (alone, of_shares, of_the_batch), (together, together_training) = found
    assert min(alone.norm(), of_shares.norm()) > 0.01
    torch.testing.assert_close(alone, together, rtol=1e-4, atol=1e-6)
    torch.testing.assert_close(of_shares, together_training, rtol=1e-4, atol=1e-6)
    assert (of_the_batch - together_training).norm() > 0.01 * of_the_batch.norm()


def test_only_rank_0_writes(tmp_path):
    script = tmp_path / "short.py"
    script.write_text(
        "import os\n"
        "from pathlib import Path\n"
        "from capsule_people import CapsulePeople\n"
        "from kpopnet.networks import ModelConfig\n"
        "from kpopnet.training import TrainingConfig, train\n"
        "model = ModelConfig(crop_px=32, widths=[8, 8, 16, 16])\n"
        "config = TrainingConfig(steps=4, batch_size=8, validate_every=2, validation_samples=8)\n"
        "out = Path('rank' + os.environ['RANK'])\n"
        "train(config, model, CapsulePeople(20), CapsulePeople(8), out=out, device='cpu', workers=0, threads=1)\n"
    )
    torchrun(2, script, cwd=tmp_path)
    assert not (tmp_path / "rank1").exists()
    assert json.loads((tmp_path / "rank0" / "last" / "meta.json").read_text())["step"] == 4


def test_a_batch_that_cannot_be_dealt_out_is_refused(tmp_path, monkeypatch):
    from kpopnet import training

    class Two:
        def __enter__(self):
            return Processes(torch.device("cpu"), 0, 3)

        def __exit__(self, *_):
            return False

    monkeypatch.setattr(training, "join_processes", lambda _: Two())
    with pytest.raises(InputError, match=r"training\.batch_size=8 cannot be dealt out evenly to 3 processes"):
        run_short(tmp_path)
