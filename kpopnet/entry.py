"""What entry points share: closed configurations, users' mistakes in one line, one writer among several processes."""

import functools
import os
import sys
from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar

import hydra
from hydra.core.config_store import ConfigStore
from hydra.core.hydra_config import HydraConfig
from hydra.errors import HydraException
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from kpopnet.errors import InputError

OTHER_RANKS_OVERRIDES = ("hydra.run.dir=.", "hydra.output_subdir=null", "hydra/job_logging=disabled")
"""What keeps Hydra from making a folder and a log of its own for a process that is not the first of its group."""

Config = TypeVar("Config")
P = ParamSpec("P")
R = TypeVar("R")


def user_errors(function: Callable[P, R]) -> Callable[P, R]:
    """Decorates a program: where a user's mistake would end it with a traceback, it ends with one line and exit code 1.

    What is not a user's mistake keeps its traceback. Around `hydra.main` it catches unknown overrides and the like;
    what the function inside raises must be caught inside, by this decorator again, before Hydra comments on it.
    """

    @functools.wraps(function)
    def careful(*args: P.args, **kwargs: P.kwargs) -> R:
        # Lets Hydra's own errors through to here; what it makes of them itself takes many lines.
        os.environ["HYDRA_FULL_ERROR"] = "1"
        try:
            return function(*args, **kwargs)
        except (InputError, HydraException, OmegaConfBaseException) as error:
            print(f"error: {_one_line(error)}", file=sys.stderr)
            raise SystemExit(1) from None
        except KeyboardInterrupt:
            print("stopped", file=sys.stderr)
            raise SystemExit(130) from None

    return careful


def _one_line(error: Exception) -> str:
    """The message without OmegaConf's indented details and without the hint to override a closed schema with "+"."""
    left_out = (" ", "To append to your config")
    lines = [line for line in str(error).splitlines() if line and not line.startswith(left_out)]
    if lines and lines[0].startswith("Caught InputError in DataLoader worker"):
        # torch puts the worker's traceback into the message; its last line is ours.
        lines = [lines[-1].partition("InputError: ")[2]]
    cause = error.__cause__
    if isinstance(error, HydraException) and isinstance(cause, OmegaConfBaseException):
        lines.append(_one_line(cause))
    return " ".join(dict.fromkeys(lines))


def entry_point(
    schema: type[Config], config_name: str, config_path: str = "configs"
) -> Callable[[Callable[[Config], object]], Callable[[], None]]:
    """Makes a program of a function that takes a configuration.

    The configuration is `config_name`.yaml in `config_path` (relative to the function's file), whose defaults list
    starts with `base_<config_name>`, the schema; then come Hydra's overrides from the command line. The function gets
    a real `schema`; names that it does not know, wrong types, and what a `__post_init__` refuses end as `user_errors`
    says. Of several processes started by torchrun only rank 0 gets a folder and a log from Hydra.

    Args:
        schema: a dataclass of dataclasses; frozen ones may be overridden like the others.
        config_name: without ".yaml".
        config_path: the folder of configurations.
    """
    ConfigStore.instance().store(f"base_{config_name}", overridable(schema))

    def decorate(function: Callable[[Config], object]) -> Callable[[], None]:
        @hydra.main(version_base="1.3", config_path=config_path, config_name=config_name)
        @user_errors
        @functools.wraps(function)
        def job(cfg: DictConfig) -> None:
            function(OmegaConf.to_object(cfg))

        @user_errors
        @functools.wraps(function)
        def program() -> None:
            if not {"-h", "--help"}.isdisjoint(sys.argv[1:]):
                print(sys.modules[function.__module__].__doc__)
                print("Every setting and its value, with what you give: --cfg job. Hydra's own options: --hydra-help.")
                return
            if int(os.environ.get("RANK", "0")) > 0:
                sys.argv += OTHER_RANKS_OVERRIDES
            job()

        return program

    return decorate


def overridable(schema: Any) -> DictConfig:
    """The schema, a dataclass with or without values, as a configuration.

    OmegaConf takes frozen dataclasses for configurations never to be changed.
    """

    def unlock(node: DictConfig) -> None:
        OmegaConf.set_readonly(node, None)
        for name in node:
            child = node._get_node(name)
            if isinstance(child, DictConfig) and not child._is_none():
                unlock(child)

    config = OmegaConf.structured(schema)
    unlock(config)
    return config


def resumed_config(config: Config, saved: dict, *, may_change: tuple[str, ...]) -> Config:
    """The configuration of a run that is taken up again: the saved one, and what the command line changes of it.

    Args:
        config: as composed now.
        saved: as saved then, a dataclass made a dict.
        may_change: what the command line may change: names, and groups of names with a final dot.

    Raises:
        InputError: the command line changes something else, or the saved configuration is of another version.
    """
    given = [override.split("=")[0] for override in HydraConfig.get().overrides.task]
    if foreign := [name for name in given if not name.startswith(may_change)]:
        raise InputError(
            f"training.resume goes on with the run as it was configured and cannot change {', '.join(foreign)}; "
            f"beside it you may give {', '.join(may_change)}"
        )
    now = OmegaConf.structured(config)
    try:
        merged = OmegaConf.merge(overridable(type(config)), saved)
    except OmegaConfBaseException as error:
        raise InputError(f"the checkpoint's configuration is of another version: {_one_line(error)}") from error
    for name in given:
        OmegaConf.update(merged, name, OmegaConf.select(now, name))
    return OmegaConf.to_object(merged)
