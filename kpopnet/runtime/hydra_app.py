"""What entry points share: closed configurations, users' mistakes in one line, one writer among several processes."""

import atexit
import contextlib
import dataclasses
import errno
import functools
import io
import logging
import os
import sys
import threading
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, ParamSpec, TypeVar, cast

import hydra
from hydra.conf import HydraConf
from hydra.core.config_store import ConfigStore
from hydra.core.hydra_config import HydraConfig
from hydra.errors import HydraException
from hydra.experimental.callback import Callback
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

import kpopnet
from kpopnet.errors import InputError
from kpopnet.runtime.compilation import announce_compilation
from kpopnet.runtime.folder_lock import locked
from kpopnet.runtime.settings_help import as_text, settings, with_comments

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
        logging.raiseExceptions = False  # where a log cannot be written, what matters cannot be either, and that is told
        threading.excepthook = _thread_ended
        try:
            return function(*args, **kwargs)
        except (InputError, HydraException, OmegaConfBaseException) as error:
            print(f"error: {_one_line(error)}", file=sys.stderr)
            raise SystemExit(1) from None
        except OSError as error:
            if not is_of_the_disk(error):
                raise
            print(f"error: {_of_the_disk(error)}", file=sys.stderr)
            raise SystemExit(1) from None
        except KeyboardInterrupt:
            print("stopped", file=sys.stderr)
            raise SystemExit(130) from None
        except Exception as error:
            if not type(error).__module__.startswith("submitit."):
                raise
            job = str(error).splitlines()[0]
            print(f"error: {job} did not finish; what is finished stays: run the same command again", file=sys.stderr)
            raise SystemExit(1) from None

    return careful


DISK_ERRORS = {
    errno.ENOSPC: "the disk is full; make room and run the same command again",
    errno.EDQUOT: "your quota of the disk is used up; make room and run the same command again",
    errno.EFBIG: "the file is larger than a file may be here (ulimit -f); raise the limit and run the same command again",
    errno.EROFS: "the disk is read-only; give another folder",
    errno.EACCES: "permission denied; give another path, or change the permissions",
    errno.EPERM: "permission denied; give another path, or change the permissions",
    errno.ENOENT: "there is no such file or folder",
    errno.ENOTDIR: "a part of this path is a file, expected a folder; give another path",
    errno.EISDIR: "is a folder, expected a file; give another path",
    errno.EEXIST: "is there already, and is no folder; give another path",
    errno.ENAMETOOLONG: "the name is too long; most file systems allow 255 bytes a name and 4096 a path",
    errno.ELOOP: "the links go round in a circle",
    errno.EMFILE: "too many files are open (ulimit -n); raise the limit",
    errno.EIO: "the disk reports an error (input/output error)",
    errno.ESTALE: "the network file system has lost this file; run the same command again",
}
"""What the user can do about a file that cannot be read or written, by the error's number."""


def is_of_the_disk(error: BaseException | None) -> bool:
    """Whether an error comes from the file system or its limits, and not from a mistake in the program."""
    return isinstance(error, OSError) and error.errno in DISK_ERRORS


def _of_the_disk(error: OSError) -> str:
    path = error.filename if error.filename is not None else "a file"
    path = os.fsdecode(path) if isinstance(path, bytes) else str(path)
    path = path if len(path) <= 300 else f"{path[:150]}...{path[-100:]}"
    return f"{path}: {DISK_ERRORS[error.errno or errno.EIO]}"


def _thread_ended(ended: threading.ExceptHookArgs) -> None:
    """Threads that write, such as TensorBoard's, hand errors of the disk to the main thread, which tells them once."""
    if not is_of_the_disk(ended.exc_value):
        threading.__excepthook__(ended)


def _one_line(error: Exception) -> str:
    """The message without OmegaConf's indented details and without the hint to override a closed schema with "+"."""
    left_out = (" ", "To append to your config")
    text = str(error)
    if text.startswith("Caught InputError in DataLoader worker"):
        # torch puts the worker's traceback into the message; its last line is ours.
        return text.rpartition("InputError: ")[2].removesuffix("\\n")
    lines = [line for line in text.splitlines() if line and not line.startswith(left_out)]
    cause = error.__cause__
    if isinstance(error, HydraException) and isinstance(cause, OmegaConfBaseException):
        lines.append(_one_line(cause))
    return " ".join(dict.fromkeys(lines))


def configs_folder() -> Path:
    """The folder of configurations: inside the package where it was installed from a wheel, in a checkout beside it."""
    package = Path(kpopnet.__file__).parent
    packed = package / "configs"
    return packed if packed.is_dir() else package.parent / "configs"


def entry_point(
    schemas: dict[str, type[Config]], folder: str = ""
) -> Callable[[Callable[[Config], object]], Callable[[], None]]:
    """Makes a program of a function that takes a configuration.

    The configuration is the first name of `schemas` with ".yaml" (another one of them after --config-name), whose
    defaults list starts with `base_<name>`, the schema; then come Hydra's overrides from the command line. The function
    gets a real object of the schema; names that it does not know, wrong types, and what a `__post_init__` refuses end as
    `user_errors` says. Of several processes started by torchrun only rank 0 gets a folder and a log from Hydra.

    Args:
        schemas: dataclasses of dataclasses by the names of their configurations; frozen ones may be overridden like others.
        folder: the configurations' folder below `configs_folder()`.
    """
    for name, schema in schemas.items():
        ConfigStore.instance().store(f"base_{name}", overridable(schema))

    def decorate(function: Callable[[Config], object]) -> Callable[[], None]:
        @hydra.main(version_base="1.3", config_path=str(configs_folder() / folder), config_name=next(iter(schemas)))
        @user_errors
        @functools.wraps(function)
        def job(cfg: DictConfig) -> None:
            refuse_unknown(cfg)
            function(cast(Config, OmegaConf.to_object(cfg)))

        @user_errors
        @functools.wraps(function)
        def program() -> None:
            given = sys.argv[1:]
            schema = schemas[_config_name(given, schemas)]
            if not {"-h", "--help"}.isdisjoint(given):
                print(sys.modules[function.__module__].__doc__)
                print("Settings (NAME=VALUE; --cfg job prints every value, --hydra-help Hydra's own options):\n")
                print(
                    as_text({name: text for texts in (settings(schema), *_group_help.values()) for name, text in texts.items()})
                )
                return
            announce_compilation()
            if int(os.environ.get("RANK", "0")) > 0:
                sys.argv += OTHER_RANKS_OVERRIDES
            if not {"--cfg", "-c"}.isdisjoint(given) and "job" in given:
                printed = io.StringIO()
                with contextlib.redirect_stdout(printed):
                    job()
                print(with_comments(printed.getvalue(), settings(schema) | _group_texts))
                return
            job()

        return program

    return decorate


def _config_name(given: list[str], schemas: Mapping[str, Any]) -> str:
    """The schema that --config-name chooses, else the first."""
    for place, word in enumerate(given):
        option, equals, name = word.partition("=")
        if option in ("--config-name", "-cn"):
            name = name if equals else next(iter(given[place + 1 :]), "")
            if name not in schemas:
                raise InputError(f"--config-name {name}: expected one of {', '.join(schemas)}")
            return name
    return next(iter(schemas))


def refuse_unknown(config: DictConfig, place: str = "") -> None:
    """Refuses settings that an override with "+" added to a closed schema.

    Raises:
        InputError: there is one.
    """
    schema = OmegaConf.get_type(config)
    known = {one.name for one in dataclasses.fields(schema)} if dataclasses.is_dataclass(schema) else None
    for name in config:
        if known is not None and name not in known:
            raise InputError(f"+{place}{name}: there is no such setting; --help lists them")
        child = config._get_node(name)
        if isinstance(child, DictConfig) and not (child._is_none() or child._is_interpolation() or child._is_missing()):
            refuse_unknown(child, f"{place}{name}.")


class OutputFolder(Callback):
    """Locks the folder that a run writes to, before Hydra itself writes there: for `hydra.callbacks` of a configuration."""

    def __init__(self) -> None:
        self.held = contextlib.ExitStack()

    def check(self, config: DictConfig, folder: Path) -> None:
        """Refuses a folder that this run must not write to, by an InputError."""

    # Hydra makes a warning of an exception here, but lets SystemExit through.
    @user_errors
    def on_run_start(self, config: DictConfig, **_: Any) -> None:
        if int(os.environ.get("RANK", "0")) == 0:
            known = HydraConfig.instance()
            before, known.cfg = known.cfg, cast(HydraConf, config)  # for names such as ${hydra:runtime.choices.model}
            try:
                folder = Path(config.hydra.run.dir)
            finally:
                known.cfg = before
            self._claim(config, folder)

    @user_errors
    def on_job_start(self, config: DictConfig, **_: Any) -> None:
        if int(os.environ.get("RANK", "0")) == 0:
            self._claim(config, Path(config.hydra.runtime.output_dir))

    def on_job_end(self, **_: Any) -> None:
        self.held.close()

    def _claim(self, config: DictConfig, folder: Path) -> None:
        self.check(config, folder)
        self.held.enter_context(locked(folder))
        atexit.register(self.held.close)


def command_line_settings() -> list[str]:
    """The names that the command line sets, in a running program."""
    return [override.split("=")[0] for override in HydraConfig.get().overrides.task]


_group_texts: dict[str, str] = {}
"""What the settings of registered schemas mean, by their dotted names in the whole configuration."""

_group_help: dict[type, dict[str, str]] = {}
"""The same for --help, where a schema that several names share stands once."""


def register_schemas(group: str, schemas: Mapping[str, Any], *, place: str | None = None, by_name: bool = False) -> None:
    """Makes dataclasses, or objects of them, known to `schema/NAME` in the defaults lists of a configuration group.

    Args:
        group: of the configurations.
        schemas: by name.
        place: of the settings in the whole configuration, by default the group's name.
        by_name: whether each has a place of its own, PLACE.NAME; else one of them is chosen and stands at PLACE.
    """
    for name, schema in schemas.items():
        ConfigStore.instance().store(group=f"{group}/schema", name=name, node=overridable(schema))
        prefix = f"{place or group}.{name}." if by_name else f"{place or group}."
        kind = schema if isinstance(schema, type) else type(schema)
        texts = settings(kind, prefix)
        _group_texts.update(texts)
        _group_help.setdefault(kind, texts)


def register_choices(group: str, names: Iterable[str]) -> None:
    """Makes a configuration group whose choices differ in nothing but their name."""
    for name in names:
        ConfigStore.instance().store(group=group, name=name, node={"name": name})


def overridable(schema: Any) -> DictConfig:
    """Converts a schema, a dataclass or an object of one, to a configuration that overrides can change.

    OmegaConf makes configurations of frozen dataclasses read-only; this undoes it.
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
        saved: as saved then, a dataclass made a dict. It is data: an interpolation in it, which could fetch a variable of the
            environment, is refused.
        may_change: what the command line may change: names, and groups of names with a final dot.

    Raises:
        InputError: the command line changes something else, or the saved configuration is of another version or holds an
            interpolation.
    """
    given = command_line_settings()
    if foreign := [name for name in given if not name.startswith(may_change)]:
        raise InputError(
            f"training.resume goes on with the run as it was configured and cannot change {', '.join(foreign)}; "
            f"beside it you may give {', '.join(may_change)}"
        )
    if not isinstance(saved, dict):  # OmegaConf would parse a text as YAML
        raise InputError(f"the checkpoint's configuration is a {type(saved).__name__}; expected settings by name")
    if found := _interpolation(saved):
        raise InputError(
            f"the checkpoint's configuration holds {found[:60]!r}; values are expected, and nothing is interpolated"
        )
    now = OmegaConf.structured(config)
    try:
        merged = OmegaConf.merge(overridable(type(config)), saved)
        for name in given:
            OmegaConf.update(merged, name, OmegaConf.select(now, name))
        return cast(Config, OmegaConf.to_object(merged))
    except InputError:
        raise
    except (OmegaConfBaseException, AttributeError, TypeError, ValueError) as error:
        raise InputError(f"the checkpoint's configuration is of another version: {_one_line(error)}") from error


def _interpolation(value: Any) -> str | None:
    """The first text in nested dicts and lists that OmegaConf would not take literally."""
    if isinstance(value, dict | list):
        inner = [*value, *value.values()] if isinstance(value, dict) else value
        return next((found for one in inner if (found := _interpolation(one))), None)
    return value if isinstance(value, str) and ("${" in value or value == "???") else None
