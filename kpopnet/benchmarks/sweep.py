"""One estimator at every combination of two of its settings: the paper's Table 1.

    python evaluate.py benchmark=eval_sim 'estimator=[tracker]' sweep=table1

Every combination is an estimator of its own in one run, so that the person is found but once in each frame.
"""

from dataclasses import asdict, dataclass
from typing import Any

from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException

from kpopnet.entry import overridable
from kpopnet.errors import InputError


@dataclass
class AxisConfig:
    """What is varied. Attributes: setting: its path below the estimator's name. values: to be tried."""

    setting: str
    values: list[Any]

    def __post_init__(self) -> None:
        if not self.values or len(set(self.values)) < len(self.values):
            raise InputError(f"sweep: {self.setting} has values {self.values}; expected some, each once")


@dataclass
class SweepConfig:
    """The two settings. Attributes: rows, columns: of the table."""

    rows: AxisConfig
    columns: AxisConfig


@dataclass(frozen=True)
class Sweep:
    """A table of estimators.

    Attributes:
        estimator: the name of the one that is varied.
        config: the two settings.
        names: rows of estimators' names.
        settings: of those that are not the varied one itself, by name.
    """

    estimator: str
    config: SweepConfig
    names: list[list[str]]
    settings: dict[str, Any]


def sweep_of(config: SweepConfig, estimators: dict[str, Any]) -> Sweep:
    """The combinations for the first of the configured estimators.

    Raises:
        InputError: there is none, it has no such settings, or refuses a value.
    """
    if not estimators:
        raise InputError("sweep: expected an estimator whose settings are varied, for instance 'estimator=[tracker]'")
    estimator, base = next(iter(estimators.items()))
    names: list[list[str]] = []
    settings: dict[str, Any] = {}
    for row in config.rows.values:
        names.append([])
        for column in config.columns.values:
            changes = {config.rows.setting: row, config.columns.setting: column}
            changed = base
            for setting, value in changes.items():
                changed = _changed(changed, setting, value, f"estimator.{estimator}.{setting}")
            name = estimator
            if changed != base:
                name = " ".join([estimator, *(f"{setting}={value}" for setting, value in changes.items())])
                settings[name] = changed
            names[-1].append(name)
    return Sweep(estimator, config, names, settings)


def _changed(settings: Any, path: str, value: Any, where: str) -> Any:
    """A copy of settings with another value at the path, checked like one from the command line."""
    copy = OmegaConf.merge(overridable(type(settings)), asdict(settings))
    try:
        OmegaConf.update(copy, path, value)
        return OmegaConf.to_object(copy)
    except OmegaConfBaseException as error:
        raise InputError(f"sweep: {where}={value}: {str(error).splitlines()[0]}") from error
