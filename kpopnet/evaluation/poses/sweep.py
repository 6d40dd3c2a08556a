"""Evaluation of one estimator at every combination of the values of two settings (the paper's Table 1).

    python evaluate.py benchmark=eval_sim 'estimator=[paper_tracker_repaired]' sweep=table1

Each combination is a separate estimator in one run, so that the person is extracted once per frame.
"""

from dataclasses import asdict, dataclass
from typing import Any

from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException

from kpopnet.errors import InputError
from kpopnet.evaluation.values import Table, Value
from kpopnet.runtime.hydra_app import overridable
from kpopnet.runtime.input_files import first_line


@dataclass(frozen=True)
class Sweep:
    """The estimators of a sweep, as a table."""

    estimator: str  # whose settings are varied
    axes: dict[str, list[Any]]  # the values of the rows' setting and of the columns' setting, by the setting's name
    names: list[list[str]]  # of the estimator at each combination: rows of columns
    settings: dict[str, Any]  # of each additional estimator by its name; a combination that equals the configured one is none

    def table(self, metrics: dict[str, dict]) -> Table:
        """Table 1: fraction of the paper's fourteen joints within 10 cm and frames per second at every combination."""
        (rows, row_values), (columns, column_values) = self.axes.items()
        table = Table([f"{rows} / {columns}", *(f"{value}: {what}" for value in column_values for what in ("mAP", "fps"))], [])
        for value, names in zip(row_values, self.names, strict=True):
            found = [metrics[name] for name in names]
            cells = [cell for one in found for cell in (Value(one["map_14"], digits=3), Value(one["fps"]))]
            table.rows.append([str(value), *cells])
        return table

    def figures(self, metrics: dict[str, dict]) -> dict:
        """For metrics.json: the axes, and for each metric a list of rows of columns."""
        rows, columns = ({"setting": setting, "values": values} for setting, values in self.axes.items())
        return {"estimator": self.estimator, "rows": rows, "columns": columns} | {
            key: [[metrics[name][key] for name in names] for names in self.names]
            for key in ("map_14", "map_10cm", "mean_error_cm", "missing_joints", "fps")
        }


def sweep_of(axes: dict[str, list[Any]], estimators: dict[str, Any]) -> Sweep:
    """Makes the combinations for the first configured estimator.

    Raises InputError if no estimator is configured, it lacks one of the settings, or a value is invalid.
    """
    if not estimators:
        raise InputError("sweep: expected an estimator to vary, for instance 'estimator=[paper_tracker]'")
    if len(axes) != 2 or not all(axes.values()):
        raise InputError(f"sweep={axes}: expected two settings with at least one value each")
    estimator, base = next(iter(estimators.items()))
    rows, columns = axes
    names: list[list[str]] = []
    settings: dict[str, Any] = {}
    for row in axes[rows]:
        names.append([])
        for column in axes[columns]:
            changes = {rows: row, columns: column}
            changed, name = _with_settings(base, changes, f"sweep: estimator.{estimator}"), estimator
            if changed != base:
                name = " ".join([estimator, *(f"{setting}={value}" for setting, value in changes.items())])
                settings[name] = changed
            names[-1].append(name)
    return Sweep(estimator, axes, names, settings)


def _with_settings(settings: Any, changes: dict[str, Any], where: str) -> Any:
    """A copy of the settings with some values replaced, validated like values from the command line."""
    copy = OmegaConf.merge(overridable(type(settings)), asdict(settings))
    for name, value in changes.items():
        try:
            OmegaConf.update(copy, name, value)
        except OmegaConfBaseException as error:
            raise InputError(f"{where}.{name}={value}: {first_line(error)}") from error
    return OmegaConf.to_object(copy)
