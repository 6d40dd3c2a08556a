"""The training loop learns, resumes bit for bit, stops before a non-finite update, and gives the same on several processes."""

import math
import shutil
import subprocess
import sys
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from capsule_people import CapsulePeople
from checkpoints import contents, flatten
from safetensors.torch import load_file
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from kpopnet.data.batches import AugmentConfig, CropBatches, ShuffledOrder, SmallCropsConfig
from kpopnet.errors import InputError
from kpopnet.networks import ModelConfig
from kpopnet.networks.checkpoint import load_network, read_meta
from kpopnet.networks.network import Encoder, build_network
from kpopnet.training import distributed, loop
from kpopnet.training.distributed import Processes, join_processes
from kpopnet.training.loop import Run, RunConfig, TrainingConfig, train, validation_batches
from kpopnet.training.validation import validate

MODEL = ModelConfig(crop_px=32, widths=[8, 8, 16, 16])
SHORT = TrainingConfig(steps=6, batch_size=8, validate_every=2, validation_samples=8)
ALONE = Processes(torch.device("cpu"))
PEOPLE, OTHERS = CapsulePeople(20, seed=1), CapsulePeople(8, seed=2)


def short_run(training=SHORT, model=MODEL, **settings):
    return RunConfig(model, training, **({"device": "cpu", "workers": 0, "threads": 1} | settings))


def run_short(out, *configs, **settings):
    return train(short_run(*configs, **settings), PEOPLE, OTHERS, out)


SMALL_FIRST = replace(SHORT, optimiser="muon", small_crops=SmallCropsConfig(share=0.5, crop_px=32))
LARGER = replace(MODEL, crop_px=48)


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """The folder of a finished run."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(loop, "LOG_EVERY", 2)
        return run_short(tmp_path_factory.mktemp("finished")).parent


@pytest.mark.parametrize(("kind", "config", "workers"), [("holistic", SHORT, 0), ("dense", SMALL_FIRST, 1)])
def test_a_resumed_run_equals_an_uninterrupted_run_with_other_workers(tmp_path, kind, config, workers):
    model = replace(LARGER if config is SMALL_FIRST else MODEL, kind=kind)
    whole = run_short(tmp_path / "whole", config, model, workers=workers)

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
        train(short_run(config, model), stopping, OTHERS, tmp_path / "parts")
    assert read_meta(tmp_path / "parts" / "last")["step"] == 4
    resumed = run_short(tmp_path / "parts", replace(config, resume=str(tmp_path / "parts" / "last")), model)

    (weights, state, meta), (other_weights, other_state, other_meta) = contents(whole), contents(resumed)
    assert weights == other_weights and state == other_state and state["step"] == 6
    assert meta["metrics"] == other_meta["metrics"] and meta["mean_pose_m"] == other_meta["mean_pose_m"]
    scalars = EventAccumulator(str(tmp_path / "parts")).Reload()
    assert [event.step for event in scalars.Scalars("validation/mean_error_cm")] == [2, 4, 6]


def test_small_crops_come_first_and_the_models_size_follows(tmp_path):
    """In the end always: a saved network says that it takes crops of the model's size."""
    plain, small = (CropBatches(PEOPLE, MODEL, ShuffledOrder(20, 4, 0), 0, None, small_crops=one) for one in ((0, 0), (2, 64)))
    assert [small[step].crop.shape[-1] for step in range(4)] == [64, 64, 32, 32]
    np.testing.assert_array_equal(small[1].target, plain[1].target)
    with pytest.raises(InputError, match=r"training\.small_crops: a holistic network takes crops of one size"):
        run_short(tmp_path, SMALL_FIRST, replace(MODEL, kind="holistic"))
    with pytest.raises(InputError, match=r"small_crops\.share=1\.0: all 6 steps would take smaller crops"):
        replace(SHORT, small_crops=SmallCropsConfig(1.0, 48))
    for crop_px in (32, 48):
        with pytest.raises(InputError, match=rf"small_crops\.crop_px={crop_px}: expected less than model\.crop_px=32"):
            run_short(tmp_path, replace(SHORT, small_crops=SmallCropsConfig(0.5, crop_px)))
    assert replace(SHORT, small_crops=SmallCropsConfig(0.95, 48)).small_steps == 5


def test_the_best_checkpoint_is_one_of_the_models_crops_however_small_the_errors_in_smaller_ones(tmp_path, monkeypatch):
    measured, errors_cm = loop.validate, iter((1.0, 2.0, 3.0))

    def scripted(*given):
        metrics, estimates = measured(*given)
        return metrics | {"mean_error_cm": next(errors_cm)}, estimates

    monkeypatch.setattr(loop, "validate", scripted)
    run_short(tmp_path / "one", SMALL_FIRST, LARGER)  # validates after two steps, of smaller crops, four and six
    assert read_meta(tmp_path / "one/best")["step"] == 4
    errors_cm = iter((1.0, 2.0, 3.0))
    run_short(tmp_path / "two", replace(SMALL_FIRST, steps=7, validate_every=3, small_crops=SmallCropsConfig(0.5, 32)), LARGER)
    assert read_meta(tmp_path / "two/best")["step"] == 6  # the last one, of one step more, is no other phase


def test_the_time_that_is_left_is_that_of_the_pixels_to_come(tmp_path, monkeypatch, caplog):
    """Here 32 pixels take a second a step, and 64 four; a validation takes a minute, which is not of the steps' speed."""
    clock_s, step, measured = [0.0], Run.update, loop.validate
    monkeypatch.setattr(loop.time, "perf_counter", lambda: clock_s[0])

    def update(self, batch):
        clock_s[0] += (batch.crop.shape[-1] / 32) ** 2
        return step(self, batch)

    def minute(*given):
        clock_s[0] += 60
        return measured(*given)

    monkeypatch.setattr(Run, "update", update)
    monkeypatch.setattr(loop, "validate", minute)
    monkeypatch.setattr(loop, "LOG_EVERY", 2)
    caplog.set_level("INFO")
    out = run_short(tmp_path / "one", replace(SMALL_FIRST, small_crops=SmallCropsConfig(0.34, 32)), replace(MODEL, crop_px=64))
    told = [record.getMessage() for record in caplog.records if record.getMessage().endswith(" left")]
    assert [line.rpartition("; ")[2] for line in told] == [
        f"{speed} samples/s, about 00:{left_s:02d} left" for speed, left_s in ((8, 16), (2, 8), (2, 0))
    ]
    speeds = EventAccumulator(str(out.parent)).Reload().Scalars("train/samples_per_second")
    assert [event.value for event in speeds] == [8, 2, 2]


def test_a_checkpoint_describes_itself(finished):
    meta = read_meta(finished / "last")
    assert meta["step"] == meta["config"]["training"]["steps"] == 6 and meta["model"]["crop_px"] == 32
    assert set(meta["metrics"]) == {"mean_error_cm", "within_10cm", "mean_confidence"}
    assert meta["joint_names"][0] == "head" and meta["packages"]["torch"].split("+")[0] == torch.__version__.split("+")[0]
    # 48 samples of 20 people: the mean pose is close to that of all of them.
    plain = CropBatches(PEOPLE, MODEL, ShuffledOrder(20, 20, 0), 0, None)[0].offset_m.mean(axis=0)
    np.testing.assert_allclose(meta["mean_pose_m"], plain, atol=0.1)
    scalars = EventAccumulator(str(finished)).Reload()
    assert {"train/loss", "train/error_cm", "train/lr", "validation/mean_error_cm"} <= set(scalars.Tags()["scalars"])
    assert [event.step for event in scalars.Scalars("train/loss")] == [2, 4, 6]
    assert scalars.Tags()["images"] == ["validation/predictions"]


def test_training_learns(tmp_path):
    """A tiny network on people made of balls has three quarters of the error of the mean pose within 120 steps."""
    config = TrainingConfig(
        steps=120, batch_size=16, lr=6e-3, augment=AugmentConfig(rotation_deg=5, occluder=0), validate_every=120,
        validation_samples=32,
    )  # fmt: skip
    model = ModelConfig(crop_px=32, widths=[8, 16, 16, 32])
    people, others = CapsulePeople(500, seed=1), CapsulePeople(32, seed=2)
    folder = train(short_run(config, model), people, others, tmp_path)
    meta = read_meta(folder)
    mean_pose = np.array(meta["mean_pose_m"])
    truth = validation_batches(short_run(config, model), others, model.crop_px)
    baseline = np.concatenate([np.linalg.norm(batch.offset_m.numpy() - mean_pose, axis=-1) for batch in truth]).mean()
    assert meta["metrics"]["mean_error_cm"] < 75 * baseline


def test_validation_measures_metres():
    """The error of a network that outputs (0, 0, 0) is each joint's distance from the centre of its cube."""
    batches = validation_batches(short_run(), OTHERS, MODEL.crop_px)
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


@pytest.mark.parametrize("share", [0.5, 2.0])
def test_a_gradient_above_the_limit_is_scaled_down_to_it_and_others_are_not(share):
    norm = float(Run(SHORT, MODEL, 0, ALONE).update(first_batch())["gradient_norm"])
    run = Run(replace(SHORT, clip_norm=share * norm), MODEL, 0, ALONE)
    assert float(run.update(first_batch())["gradient_norm"]) == pytest.approx(norm)
    used = torch.stack([weight.grad.norm() for weight in run.network.parameters()]).norm()
    assert float(used) == pytest.approx(min(share, 1) * norm, rel=1e-3)


def test_a_loss_that_is_not_finite_stops_before_the_update():
    run = Run(SHORT, MODEL, 0, ALONE)
    batch = first_batch()
    run.update(batch)

    def trained() -> tuple[dict, dict, dict]:
        optimisers = {name: optimiser.state_dict() for name, optimiser in run.optimisers.items()}
        weights = {name: weight.detach() for name, weight in run.network.head.named_parameters()}
        return flatten(weights), flatten(optimisers), flatten(run.average.state_dict())

    before = trained()
    bad = batch.crop.clone()
    bad.view(-1)[5] = math.nan
    with pytest.raises(InputError, match=r"step 1: loss nan.*before the update.*training\.lr"):
        run.update(batch._replace(crop=bad))
    assert trained() == before and run.step == 1


def test_a_damaged_state_is_refused_before_a_step_is_taken(finished, tmp_path):
    path = Path(shutil.copytree(finished / "last", tmp_path / "run")) / "state.pt"
    state = torch.load(path, weights_only=True)
    for damaged, message in ((state | {"step": "6"}, "step is '6', expected int"), (state | {"weights": {}}, "does not fit")):
        torch.save(damaged, path)
        with pytest.raises(InputError, match=message) as refusal:
            Run(replace(SHORT, resume=str(path.parent)), MODEL, 0, ALONE)
        assert "\n" not in str(refusal.value)


def test_a_folder_keeps_its_run_and_resuming_refuses_a_finished_one_and_another_model(finished):
    before = {path: path.read_bytes() for path in finished.rglob("*") if path.is_file()}
    resumed = replace(SHORT, resume=str(finished / "last"))
    for training, model, data, message in (
        (SHORT, MODEL, None, rf"holds a run; resume it \(training\.resume={finished}/last\)"),
        (resumed, MODEL, None, "finished already, 6 of 6 steps"),
        (resumed, replace(MODEL, widths=[8, 8, 16, 24]), None, "not the weights"),
        (resumed, MODEL, {"train": "b"}, r"was trained on other data \(None\) than the given data \(.*b.*\)"),
    ):
        with pytest.raises(InputError, match=message):
            train(short_run(training, model), PEOPLE, OTHERS, finished, data)
    assert {path: path.read_bytes() for path in finished.rglob("*") if path.is_file()} == before


def test_a_run_that_goes_on_in_another_folder_has_its_own_best_and_a_copy_of_its_links_is_refused(finished, tmp_path):
    shutil.copytree(finished, tmp_path / "first", symlinks=True)
    for path in (tmp_path / "first/last/meta.json", tmp_path / "first/best/meta.json"):
        path.write_text(path.read_text().replace('"steps": 6', '"steps": 8'))
    state_path = tmp_path / "first/last/state.pt"
    state = torch.load(state_path, weights_only=True)
    torch.save(state | {"best_cm": 0.1}, state_path)  # nothing after it is better
    resumed = replace(SHORT, steps=8, resume=str(tmp_path / "first/last"))
    run_short(tmp_path / "second", resumed)
    assert read_meta(tmp_path / "second/best")["step"] == read_meta(tmp_path / "second/last")["step"] == 8
    shutil.copytree(tmp_path / "first", tmp_path / "copied")  # with folders in the place of its links
    for resume, out in (("last", "third"), ("checkpoints/step_00000006", "copied")):
        with pytest.raises(InputError, match="copied/last: a folder where a run has a link"):
            run_short(tmp_path / out, replace(resumed, resume=str(tmp_path / "copied" / resume)))


def test_devices_and_batches_that_do_not_fit_are_refused(tmp_path, monkeypatch):
    with pytest.raises(InputError, match="device=tpu"), join_processes("tpu"):
        pass
    with monkeypatch.context() as patch:
        patch.setattr(loop, "join_processes", lambda _: nullcontext(Processes(torch.device("cpu"), 0, 3)))
        with pytest.raises(InputError, match=r"training\.batch_size=8 cannot be divided evenly among 3 processes"):
            run_short(tmp_path)
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 1)
    for name, value in (("WORLD_SIZE", "2"), ("LOCAL_RANK", "1")):
        monkeypatch.setenv(name, value)
    with pytest.raises(InputError, match=r"more processes than GPUs: .*--nproc-per-node=1"), join_processes("auto"):
        pass


@pytest.mark.parametrize("kind", ["dense", "holistic"])
def test_a_wider_network_begins_as_the_narrower_one_and_learns_with_all_its_channels(tmp_path, kind):
    run_short(tmp_path, replace(SHORT, steps=1), replace(MODEL, kind=kind), seed=5)
    start = replace(SHORT, start=str(tmp_path / "best"))
    larger = replace(MODEL, kind=kind, crop_px=48)
    if kind == "dense":
        same = Run(start, larger, 0, ALONE).network.state_dict()
        assert all(torch.equal(same[name], weight) for name, weight in load_file(start.start + "/model.safetensors").items())
    else:
        with pytest.raises(InputError, match=r"another model; give it: model\.crop_px=32"):
            Run(start, larger, 0, ALONE)
    wide = Run(start, replace(MODEL, kind=kind, widths=[8, 16, 16, 32]), 0, ALONE)
    narrow, _ = load_network(tmp_path / "best")
    batch = first_batch()
    with torch.inference_mode():
        # The batch statistics of new channels are those of an untrained network, of which nothing is heard.
        said, expected = wide.network.eval()(batch.crop), narrow(batch.crop)
    torch.testing.assert_close(said.joints, expected.joints, atol=1e-5, rtol=1e-5)
    torch.testing.assert_close(said.confidence, expected.confidence, atol=1e-5, rtol=1e-5)
    wide.update(batch)
    unheard = wide.network.encoder.coarse[1].first[0].weight[:16, 16:]
    assert (unheard != 0).float().mean() > 0.5
    with pytest.raises(InputError, match=r"another model; give it: model\.widths=\[8,8,16,16\]"):
        Run(start, replace(MODEL, kind=kind, widths=[8, 8, 8, 32]), 0, ALONE)


def test_a_cpu_trains_in_bfloat16_where_it_is_asked_to(tmp_path, monkeypatch, caplog):
    half_types, encode = [], Encoder.forward

    def watched(self, crop):
        maps = encode(self, crop)
        half_types.append((self.training, maps[0].dtype))
        return maps

    monkeypatch.setattr(Encoder, "forward", watched)
    monkeypatch.setattr(distributed, "TRIAL", "print(0.5)")
    out = run_short(tmp_path / "half", replace(SHORT, bfloat16=True))
    assert set(half_types) == {(True, torch.bfloat16), (False, torch.float32)}
    assert "at 0.5 times the speed of float32" in caplog.text
    weights = load_file(out / "model.safetensors")
    assert all(one.dtype == torch.float32 for name, one in weights.items() if "num_batches" not in name)
    plain = load_file(run_short(tmp_path / "plain") / "model.safetensors")
    assert any(not torch.equal(one, plain[name]) for name, one in weights.items())
    monkeypatch.setattr(distributed, "TRIAL", "import os; os.kill(os.getpid(), 4)")  # as an illegal instruction does
    with pytest.raises(InputError, match=r"training\.bfloat16: it ended a process that tried it \(exit status -4\)"):
        run_short(tmp_path / "illegal", replace(SHORT, bfloat16=True))
    monkeypatch.setattr(distributed, "TRIAL", "raise MemoryError('no memory')")
    with pytest.raises(InputError, match=r"training\.bfloat16: could not be tried: MemoryError: no memory"):
        run_short(tmp_path / "failed", replace(SHORT, bfloat16=True))


def test_bfloat16_is_tried_as_the_encoder_is_trained():
    tried = subprocess.run([sys.executable, "-c", distributed.TRIAL], capture_output=True, text=True, check=False)
    assert tried.returncode < 0 or 0.05 < float(tried.stdout) < 20  # below 0: a processor that claims AMX
