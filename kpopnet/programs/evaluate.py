r"""Evaluates estimators on a benchmark and writes a report.

    python evaluate.py                                                 # the network that comes with the package
    python evaluate.py checkpoint=outputs/train/RUN/best
    python evaluate.py checkpoint=outputs/train/RUN/best benchmark.path=data/small/test sequences=10
    python evaluate.py checkpoint=outputs/train/RUN/best benchmark=utd_mhad benchmark.path=PATH/UTD-MHAD
    python evaluate.py checkpoint=outputs/train/RUN/best hydra.run.dir=outputs/my_evaluation
    python evaluate.py benchmark=eval_sim 'estimator=[tracker]' estimator.tracker.start=label

The run's folder (outputs/evaluate/BENCHMARK-DATE_TIME) gets metrics.json, report.html, report.md, figures and the
worst sequences in 3D. The training set's mean pose is always judged beside a network, to show what the network is worth, but
for dances, of which it knows nothing, and several people, whom it cannot find.
processes=0 evaluates on all cores; sequences=4 is a quick test.

Who finds the people in raw rooms:

    python evaluate.py benchmark=eval_sim extraction=paper                                          # Algorithm 1

The paper's figures and Table 1, on simulated EVAL:

    python evaluate.py benchmark=eval_sim 'estimator=[tracker,network,tree_walk]' checkpoint=outputs/train/RUN/best \
        estimator.tree_walk.path=outputs/tree_walk/RUN                                              # Fig. 8 and 11
    python evaluate.py benchmark=eval_sim 'estimator=[network,ridge_network]' checkpoint=outputs/train/RUN/best \
        estimator.ridge_network.checkpoint=outputs/train/OTHER_RUN/best                             # Fig. 9
    python evaluate.py benchmark=eval_sim 'estimator=[paper_tracker,paper_tracker_depth,paper_tracker_repaired]'    # Fig. 10
    python evaluate.py benchmark=eval_sim 'estimator=[paper_tracker_repaired]' sweep=table1         # Table 1

Its Table 2, dance scores against experts' order, on simulated dances (docs/learning_the_score.md):

    python evaluate.py benchmark=kpop_sim 'estimator=[]'                                            # true joints alone
    python evaluate.py benchmark=kpop_sim 'estimator=[tracker,network]' checkpoint=outputs/train/RUN/best
    python evaluate.py benchmark=kpop_sim 'estimator=[]' benchmark.dances=10 benchmark.dance=dance_007 'scorer=[raptis]'
    python evaluate.py benchmark=kpop benchmark.path=PATH 'estimator=[]'                            # docs/kpop_format.md

All people in films of two people, and in films and single images of any number of people in any room:

    python evaluate.py benchmark=two_people 'estimator=[tracker,realtime]'
    python evaluate.py benchmark=rooms 'estimator=[realtime,best]'

One kind of estimator may stand in a run under several names: configs/estimator/paper_tracker_depth.yaml is one; for another,
write such a file, or give a name on the command line to settings that start from the defaults of their kind (it comes after
those of `estimator=[...]`):

    python evaluate.py benchmark=eval_sim 'estimator=[paper_tracker]' +estimator/schema@estimator.straight=paper_tracker \
        estimator.straight.straightness=0.9
"""

from collections.abc import Callable
from functools import partial
from pathlib import Path

from hydra.core.hydra_config import HydraConfig

from kpopnet.dance.scoring import SCORERS
from kpopnet.errors import InputError
from kpopnet.evaluation.config import EvaluateConfig
from kpopnet.evaluation.dances.report import evaluate_dances
from kpopnet.evaluation.people.report import evaluate_people
from kpopnet.evaluation.poses.report import evaluate_poses
from kpopnet.evaluation.registry import BENCHMARKS, ESTIMATORS
from kpopnet.evaluation.report import Report, write
from kpopnet.pose.extraction import EXTRACTIONS
from kpopnet.programs.score import seen_teacher
from kpopnet.runtime.atomic_write import naming
from kpopnet.runtime.hydra_app import entry_point, register_schemas

register_schemas("benchmark", {name: schema(name=name) for name, (schema, _) in BENCHMARKS.items()})
register_schemas("estimator", {name: schema for name, (schema, _) in ESTIMATORS.items()}, by_name=True)
register_schemas("scorer", SCORERS, by_name=True)
register_schemas("extraction", {name: schema for name, (schema, _) in EXTRACTIONS.items()})

EVALUATIONS: dict[str, Callable[[EvaluateConfig, Path], Report]] = {
    "kpop": partial(evaluate_dances, see_teacher=seen_teacher),
    "kpop_sim": partial(evaluate_dances, see_teacher=seen_teacher),
    "two_people": evaluate_people,
    "rooms": evaluate_people,
}
"""What evaluates a benchmark, by its name, where it is not the joints of one person that are judged."""


@entry_point({"evaluate": EvaluateConfig})
def main(config: EvaluateConfig) -> None:
    folder, named = Path(HydraConfig.get().runtime.output_dir), config.benchmark.name
    if BENCHMARKS.get(named, (None,))[0] is not type(config.benchmark):
        raise InputError(f"benchmark.name={named}: not a setting; choose one by benchmark={'|'.join(BENCHMARKS)}")
    given = config.checkpoint
    if given is not None and all(getattr(one, "checkpoint", None) != given for one in config.estimator.values()):
        raise InputError("checkpoint: no estimator of this run takes it; leave it out, or add one, as in 'estimator=[network]'")
    if (folder / "metrics.json").exists():  # the last file of a report
        raise InputError(f"{folder}: holds a report; give another folder (hydra.run.dir=...), or delete it")
    with naming(folder):
        report = EVALUATIONS.get(named, evaluate_poses)(config, folder)
        write(report, config, folder)
    print(report.text())
    print(f"report: {folder / 'report.html'}")
