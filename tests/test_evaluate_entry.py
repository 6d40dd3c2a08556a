"""evaluate.py as a user runs it: the real configuration, a tiny set, an untrained network."""

import json
import re
import shlex
from dataclasses import replace
from functools import partial

import pytest
from checkpoints import save_untrained
from hydra import compose, initialize_config_dir
from omegaconf import OmegaConf
from programs import ROOT, run_program
from shard_sets import write_shard

import kpopnet.programs.evaluate  # noqa: F401  registers its settings
from kpopnet.dance.scoring import SCORERS
from kpopnet.errors import InputError
from kpopnet.evaluation.config import EvaluateConfig
from kpopnet.evaluation.poses.sweep import sweep_of
from kpopnet.evaluation.registry import MeanPoseConfig, NetworkEstimatorConfig, build_estimators
from kpopnet.networks.estimator import NetworkEstimator
from kpopnet.pose.extraction import extraction_name
from kpopnet.runtime.cpu import available_cores

evaluate = partial(run_program, "evaluate.py")


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with a frozen set in `set` and a checkpoint in `run/last`."""
    folder = tmp_path_factory.mktemp("evaluate")
    write_shard(folder / "set", [1, 1, 2, 2, 3], empty=(1,))
    save_untrained(folder / "run")
    return folder


def test_a_report_is_written_where_hydra_is_told_to_with_the_baseline_beside_the_network(place):
    settings = "estimator=[network,tracker]", "estimator.tracker.start=label", "checkpoint=run/last", "benchmark.path=set"
    done = evaluate(place, *settings, "hydra.run.dir=out", "processes=1")
    assert done.returncode == 0, done.stderr
    found = json.loads((place / "out" / "metrics.json").read_text())
    assert list(found["estimators"]) == ["network", "tracker", "mean_pose"] and found["estimator"] == "network"
    # The tracker needs no checkpoint. No person takes the Y pose or stands: without a label it would wait to the end.
    assert found["files"]["tracker"] == {} and found["benchmark"]["started_from_label"] == ["tracker"]
    assert found["estimators"]["tracker"]["missing_joints"] < 15 * found["images"]
    assert found["mean_pose_error_cm"] == found["estimators"]["mean_pose"]["mean_error_cm"] > 0
    assert found["images"] == 5 and found["missing"]["images_without_estimate"] == 1
    assert found["benchmark"]["name"] == "synthetic" and found["config"]["benchmark"]["path"] == "set"
    assert "SIMULATED" in done.stdout and "out/report.html" in done.stdout and "mean_pose" in done.stdout
    files = {path.name for path in (place / "out").iterdir()} - {".hydra"}
    plots = ("per_joint", "error_curve", "confidence", "per_sequence")
    assert {f"{name}.png" for name in (*plots, "examples")} == set(found["pictures"])
    views = {path.name for path in (place / "out").glob("worst_*.html")}
    pictures = {*found["pictures"], *(f"{name}.svg" for name in plots), *views}
    assert views and files == {"metrics.json", "report.md", "report.html", "tables", *pictures}
    headline = (place / "out" / "tables" / "summary.csv").read_text()
    assert headline.startswith(",unit,network,") and "mean error" in headline


def test_an_older_report_is_not_replaced(place):
    older = place / "older" / "metrics.json"
    older.parent.mkdir()
    older.write_text("{}")
    done = evaluate(place, "checkpoint=run/last", "benchmark.path=set", "hydra.run.dir=older")
    assert done.returncode == 1 and older.read_text() == "{}" and done.stderr.count("\n") == 1
    assert done.stderr.endswith("older: holds a report; give another folder (hydra.run.dir=...), or delete it\n")


def test_the_name_of_a_benchmark_is_not_a_setting(place):
    done = evaluate(place, "checkpoint=run/last", "benchmark.path=set", "benchmark.name=mine", "hydra.run.dir=named")
    assert done.returncode == 1 and "benchmark.name=mine: not a setting; choose one by benchmark=" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("given", ["benchmark.joints={hed: 1}", "benchmark.joints.hed=1"])
def test_a_joint_that_is_none_is_named_with_the_one_that_may_be_meant(place, given):
    done = evaluate(place, "benchmark=eval", "benchmark.path=set", given, "hydra.run.dir=joints")
    told = "error: benchmark.joints.hed: there is no such setting; did you mean benchmark.joints.head? --help lists them\n"
    assert (done.returncode, done.stderr) == (1, told)


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ("estimator.network.device=cpu", "is for another estimator than the given one, estimator=..."),
        ("benchmark.poses=out", "is for another benchmark than the given one, benchmark=..."),
        ("benchmark.pose=out", "there is no such setting; --help lists them"),
        ("estimator.tracker.strt=label", "there is no such setting; did you mean estimator.tracker.start?"),
    ],
)
def test_a_setting_that_is_not_there_is_not_said_to_be_meant(place, given, told):
    done = evaluate(place, "benchmark=eval_sim", "estimator=[tracker]", given, "hydra.run.dir=wrong")
    assert done.stderr.startswith(f"error: {given.partition('=')[0]}: {told}")


def test_a_checkpoint_that_no_estimator_takes_is_refused(place):
    done = evaluate(place, "estimator=[tracker]", "checkpoint=run/last", "benchmark.path=set", "hydra.run.dir=without")
    told = "error: checkpoint: no estimator of this run takes it; leave it out, or add one, as in 'estimator=[network]'\n"
    assert done.returncode == 1 and done.stderr == told


def composed(*settings: str) -> EvaluateConfig:
    with initialize_config_dir(str(ROOT / "configs"), version_base="1.3"):
        return OmegaConf.to_object(compose("evaluate", list(settings)))


def test_table_1_and_a_second_estimator_of_a_kind_can_be_given():
    table = composed("benchmark=eval_sim", "estimator=[paper_tracker_repaired]", "sweep=table1", "extraction=paper")
    assert extraction_name(table.extraction) == "paper" and extraction_name(composed().extraction) == "finder"
    # Table 1 of the paper, whose best, 110 mm and 50 mm, are the defaults.
    assert table.sweep == {"epsilon_m": [0.040, 0.045, 0.050, 0.055, 0.060], "r_m": [0.08, 0.10, 0.11, 0.12, 0.14]}
    assert len(sweep_of(table.sweep, table.estimator).settings) == 24
    straight = "+estimator/schema@estimator.straight=paper_tracker", "estimator.straight.straightness=0.9"
    named = composed("estimator=[paper_tracker]", *straight).estimator
    assert {name: one.straightness for name, one in named.items()} == {"paper_tracker": 0.7, "straight": 0.9}


def test_the_scorers_of_the_documentation_can_be_given():
    given = re.findall(r"`([^`\n]*scorer[.=][^`\n]*)`", (ROOT / "docs" / "learning_the_score.md").read_text())
    scorers = [composed("estimator=[]", *shlex.split(one)).scorer for one in given]
    expected = [{"paper": replace(SCORERS["paper"], beta=1)}, {"raptis": SCORERS["raptis"]}]
    assert scorers == [*expected, {"dance22": replace(SCORERS["dance22"], beta=2)}]


def test_the_number_of_processes_is_the_cores_but_one_for_a_gpu():
    networks = {device: {"network": NetworkEstimatorConfig(device=device)} for device in ("cpu", "cuda")}
    assert EvaluateConfig(None, networks["cuda"]).processes_at_work() == 1
    assert EvaluateConfig(None, networks["cpu"]).processes_at_work() == available_cores()
    assert EvaluateConfig(None, networks["cuda"], processes=3).processes_at_work() == 3


def test_a_missing_or_foreign_checkpoint_is_named(tmp_path):
    for configs in ({"second": NetworkEstimatorConfig(checkpoint="")}, {"second": MeanPoseConfig(checkpoint="")}):
        with pytest.raises(InputError, match=r"second needs.*: estimator\.second\.checkpoint=outputs"):
            build_estimators(configs)
    (tmp_path / "meta.json").write_text('{"format": "other"}')
    with pytest.raises(InputError, match=r"meta\.json: expected a kpopnet-checkpoint"):
        build_estimators({"network": NetworkEstimatorConfig(checkpoint=str(tmp_path))})
    with pytest.raises(InputError, match="at least one"):
        build_estimators({})


def test_without_a_checkpoint_the_network_of_the_package_is_evaluated():
    built = build_estimators(composed("estimator=[network,fitted_network]").estimator)
    assert list(built) == ["network", "fitted_network", "mean_pose"]
    assert built["network"].meta == NetworkEstimator().meta
