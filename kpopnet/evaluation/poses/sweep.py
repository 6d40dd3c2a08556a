"""Evaluation of one estimator at every combination of the values of two settings (the paper's Table 1).

    python evaluate.py benchmark=eval_sim 'estimator=[paper_tracker_repaired]' sweep=table1

Each combination is a separate estimator in one run, so that the person is extracted once per frame.
"""

from dataclasses import asdict, dataclass
from typing import Any

from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException

from kpopnet.errors import InputError
from kpopnet.evaluation.config import SweepConfig
from kpopnet.runtime.hydra_app import overridable


@dataclass(frozen=True)
class Sweep:
    """The estimators of a sweep, as a table.

    Attributes:
        estimator: name of the estimator whose settings are varied.
        config: the two varied settings.
        names: name of the estimator at each combination: rows of columns.
        settings: settings of each additional estimator by its name. The combination that equals the configured estimator
            is not among them.
    """

    estimator: str
    config: SweepConfig
    names: list[list[str]]
    settings: dict[str, Any]


def sweep_of(config: SweepConfig, estimators: dict[str, Any]) -> Sweep:
    """Makes the combinations for the first configured estimator.

    Raises:
        InputError: no estimator is configured, it lacks one of the settings, or a value is invalid.
    """
    if not estimators:
        raise InputError("sweep: expected an estimator to vary, for instance 'estimator=[paper_tracker]'")
    estimator, base = next(iter(estimators.items()))
    names: list[list[str]] = []
    settings: dict[str, Any] = {}
    for row in config.rows.values:
        names.append([])
        for column in config.columns.values:
            changes = {config.rows.setting: row, config.columns.setting: column}
            changed = base
            for setting, value in changes.items():
                changed = _with_setting(changed, setting, value, f"estimator.{estimator}.{setting}")
            name = estimator
            if changed != base:
                name = " ".join([estimator, *(f"{setting}={value}" for setting, value in changes.items())])
                settings[name] = changed
            names[-1].append(name)
    return Sweep(estimator, config, names, settings)


def _with_setting(settings: Any, path: str, value: Any, where: str) -> Any:
    """A copy of the settings with one value replaced, validated like a value from the command line."""
    copy = OmegaConf.merge(overridable(type(settings)), asdict(settings))
    try:
        OmegaConf.update(copy, path, value)
        return OmegaConf.to_object(copy)
    except OmegaConfBaseException as error:
        raise InputError(f"sweep: {where}={value}: {str(error).splitlines()[0]}") from error
