"""Settings of `kpopnet evaluate` (evaluate.py)."""

from dataclasses import dataclass, field
from typing import Any

from kpopnet.errors import InputError, check_between, check_seed
from kpopnet.pose.extraction import DEFAULT_EXTRACTION
from kpopnet.runtime.cpu import available_cores, bounded_processes


@dataclass
class EvaluateConfig:
    """Which estimators and scorers are evaluated, and on which benchmark.

    Attributes:
        benchmark: settings of the data set, with its name.
        estimator: settings of each estimator by its name, in the order of the report. The first one is the main estimator:
            its figures stand at the top of metrics.json.
        checkpoint: folder of the trained network, for the estimators that need one; by default the network that comes with the
            package.
        sequences: evaluate this number of sequences, evenly spaced over the set, for a quick test; all by default. The report
            states it.
        seed: of the bootstrap and of the random example frames.
        processes: number of sequences that are evaluated at the same time. 0 means all cores, or one process where an
            estimator uses a GPU.
        extraction: settings of what finds people in depth images of whole scenes: extraction=paper is Algorithm 1.
        sweep: evaluate the first estimator also at every combination of the values of two of its settings, the rows and the
            columns of a table: sweep=table1, or +sweep.epsilon_m=[0.05,0.06] +sweep.r_m=[0.1,0.11].
        scorer: settings of each dance scorer by its name, for the benchmarks of dances.
    """

    benchmark: Any
    estimator: dict[str, Any] = field(default_factory=dict)
    checkpoint: str | None = None
    sequences: int | None = None
    seed: int = 0
    processes: int = 0
    extraction: Any = None
    sweep: dict[str, list[Any]] = field(default_factory=dict)
    scorer: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.extraction = self.extraction or DEFAULT_EXTRACTION
        check_between("processes", self.processes, 0, 1e6)
        check_seed("seed", self.seed)

    def refuse(self, *names: str, instead: str = "leave it out") -> None:
        """Raises InputError if one of the settings is given: it is for other benchmarks."""
        for name in names:
            if getattr(self, name) not in (None, {}):
                raise InputError(f"{name}: is for other benchmarks than {self.benchmark.name}; {instead}")

    def processes_at_work(self) -> int:
        """The number of processes, with 0 replaced by the number that it stands for."""
        on_gpu = any(getattr(settings, "device", "cpu") != "cpu" for settings in self.estimator.values())
        return bounded_processes(self.processes) or (1 if on_gpu else available_cores())

    def files(self) -> dict[str, dict[str, str]]:
        """The files and folders that each estimator reads: estimator name -> setting name -> path."""
        path_settings = ("checkpoint", "network", "path", "model")
        return {
            name: {setting: file for setting in path_settings if (file := getattr(settings, setting, None)) is not None}
            for name, settings in self.estimator.items()
        }
