"""What entry points with Hydra share: closed configurations, one writer among several processes."""

import atexit
import contextlib
import dataclasses
import difflib
import functools
import inspect
import io
import os
import re
import shutil
import sys
import textwrap
import types
import typing
from collections import ChainMap
from collections.abc import Callable, Collection, Iterable, Mapping
from pathlib import Path
from typing import Any, TypeVar, cast

import hydra
from hydra.conf import HydraConf
from hydra.core.config_store import ConfigStore
from hydra.core.hydra_config import HydraConfig
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.errors import ConfigCompositionException, HydraException, MissingConfigException
from hydra.experimental.callback import Callback
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import ConfigAttributeError, ConfigKeyError, OmegaConfBaseException

import kpopnet
from kpopnet.errors import InputError
from kpopnet.runtime.compilation import announce_compilation
from kpopnet.runtime.endings import one_line, user_errors
from kpopnet.runtime.folder_lock import locked

OTHER_RANKS_OVERRIDES = ("hydra.run.dir=.", "hydra.output_subdir=null", "hydra/job_logging=disabled")
"""What keeps Hydra from making a folder and a log of its own for a process that is not the first of its group."""

Config = TypeVar("Config")


def configs_folder() -> Path:
    """The folder of configurations: inside the package where it was installed from a wheel, in a checkout beside it."""
    package = Path(kpopnet.__file__).parent
    packed = package / "configs"
    return packed if packed.is_dir() else package.parent / "configs"


def entry_point(
    schemas: dict[str, type[Config]], folder: str = ""
) -> Callable[[Callable[[Config], object]], Callable[[], None]]:
    """Makes a program of a function that takes a configuration, an object of its schema.

    A user's mistake ends as `user_errors` says. Of several processes started by torchrun only rank 0 gets a folder and a log.
    `schemas` are dataclasses by the names of their configurations in `folder` below `configs_folder()`, whose defaults lists
    start with `base_<name>`; the first name is the default, --config-name chooses another.
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
                print(as_text(_texts_of_help(schema, given)))
                return
            sys.argv[1:] = map(readable, given)
            announce_compilation()
            if int(os.environ.get("RANK", "0")) > 0:
                sys.argv += OTHER_RANKS_OVERRIDES
            if not {"--cfg", "-c"}.isdisjoint(given) and "job" in given:
                printed = io.StringIO()
                with contextlib.redirect_stdout(printed):
                    job()
                print(with_comments(printed.getvalue(), settings(schema) | _texts_of_groups(printed.getvalue())))
                return
            try:
                job()
            except MissingConfigException as error:
                raise _unknown_choice(error, configs_folder() / folder) from error
            except ConfigCompositionException as error:
                if (told := _unknown_setting(error, ChainMap(*_group_texts.values(), settings(schema)))) is None:
                    raise
                raise told from error

        return program

    return decorate


def readable(override: str) -> str:
    """An override, its value in quotes where Hydra's grammar cannot read it without: a path in Korean, or with brackets.

    A path of Windows' networks is in quotes too: Hydra reads its first two backslashes as one.
    """
    name, _, value = override.partition("=")
    # In quotes a backslash stands for itself, but before a quote.
    quoted = f"{name}='{re.sub(QUOTE_OR_END, lambda found: 2 * found[1] + (found[2] and QUOTE), value)}'"
    ways = (quoted,) if value.startswith("\\\\") else (override, quoted)
    for one in ways if value and value[0] not in "[{'\"" and not name.startswith("-") else ():
        with contextlib.suppress(HydraException):
            OverridesParser.create().parse_override(one)
            return one
    return override


QUOTE_OR_END, QUOTE = re.compile(r"(\\*)('|$)"), "\\'"


def _unknown_choice(error: MissingConfigException, folder: Path) -> Exception:
    """What can be chosen instead, in the place of Hydra's list of folders."""
    group, _, name = (error.missing_cfg_file or "").removesuffix(".yaml").rpartition("/")
    registered = map(Path, ConfigStore.instance().repo.get(group, ()))  # "NAME.yaml", as files are
    known = sorted({path.stem for path in [*(folder / group).glob("*.yaml"), *registered]} - {"schema"})
    return InputError(f"{group}={name}: expected one of {', '.join(known)}") if group and known else error


def _unknown_setting(error: ConfigCompositionException, known: Collection[str]) -> InputError | None:
    """What may have been meant, in the place of the class that lacks a setting; None for another mistake."""
    found, cause = re.match(r"Could not override '([\w.]+)'", str(error)), error.__cause__
    if not found:
        return None
    name = found[1]
    if isinstance(cause, ConfigKeyError | ConfigAttributeError):
        name = max(name, cause.full_key or "", key=len)  # a value in braces has names of its own
        if name in known:
            group = name.partition(".")[0]
            return InputError(f"{name}: is for another {group} than the given one, {group}=...; --help lists them")
        place, _, last = name.rpartition(".")
        if place and name == cause.full_key:  # its place exists: what stands elsewhere was not meant
            known = [f"{place}.{one}" for one in difflib.get_close_matches(last, cause.parent_node or (), 1)]
    elif "No match in the defaults list" not in str(error):  # Hydra's advice to append a group ends in another refusal
        return None
    near = difflib.get_close_matches(name, known, 1)
    hint = f"did you mean {near[0]}? " if near else ""
    return InputError(f"{name}: there is no such setting; {hint}--help lists them")


def _config_name(given: list[str], schemas: Mapping[str, Any]) -> str:
    """The schema that --config-name chooses, else the first."""
    chosen = re.search(r"(?:^| )(?:--config-name|-cn)[ =](\S*)", " ".join(given))
    if chosen and chosen[1] not in schemas:
        raise InputError(f"--config-name {chosen[1]}: expected one of {', '.join(schemas)}")
    return chosen[1] if chosen else next(iter(schemas))


def refuse_unknown(config: DictConfig, place: str = "") -> None:
    """Raises InputError for a setting that an override with "+" added to a closed schema."""
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
    return [override.split("=")[0].lstrip("+~") for override in HydraConfig.get().overrides.task]


_group_texts: dict[tuple[str, str], dict[str, str]] = {}
"""What the settings of each registered schema mean, by their dotted names in the whole configuration, of which a prefix and the
schema's own name are the key."""

_group_help: dict[type, dict[str, str]] = {}
"""The same for --help, where a schema that several names share stands once."""


def register_schemas(group: str, schemas: Mapping[str, Any], *, place: str | None = None, by_name: bool = False) -> None:
    """Makes dataclasses, or objects of them, known to `schema/NAME` in the defaults lists of a configuration group.

    Their settings stand at `place` (the group's name by default) in the whole configuration; `by_name` at PLACE.NAME.
    """
    for name, schema in schemas.items():
        ConfigStore.instance().store(group=f"{group}/schema", name=name, node=overridable(schema))
        prefix = f"{place or group}.{name}." if by_name else f"{place or group}."
        kind = schema if isinstance(schema, type) else type(schema)
        texts = settings(kind, prefix)
        _group_texts[prefix, name] = texts
        _group_help.setdefault(kind, texts)


def _texts_of_help(schema: type, given: Iterable[str]) -> dict[str, str]:
    """Those of a schema and of every group; of a group of which the command line chooses one schema, of that one alone."""
    texts = dict(ChainMap(*reversed(_group_help.values()), settings(schema)))
    for (prefix, name), chosen in _group_texts.items():
        if f"{prefix.removesuffix('.')}={name}" in given:
            texts = {key: one for key, one in texts.items() if not key.startswith(prefix)} | chosen
    return texts


def _texts_of_groups(yaml: str) -> dict[str, str]:
    """Those of a configuration: of schemas with a `name` in one place, only of the one that is there."""
    config = OmegaConf.create(yaml)
    texts = {key: one for key, one in _group_texts.items() if OmegaConf.select(config, f"{key[0]}name") in (None, key[1])}
    return dict(ChainMap(*reversed(texts.values())))


def register_choices(group: str, names: Iterable[str]) -> None:
    """Makes a configuration group whose choices differ in nothing but their name."""
    for name in names:
        ConfigStore.instance().store(group=group, name=name, node={"name": name})


def overridable(schema: Any) -> DictConfig:
    """The configuration of a dataclass or an object of one; of frozen ones too, which OmegaConf makes read-only."""

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
    """The configuration of a run that is resumed: the saved one, a dataclass made a dict, with what the command line changes.

    `config` is as composed now. What was saved is data: an interpolation in it, which could fetch a variable of the
    environment, is refused. The command line `may_change` names, and groups of names with a final dot.
    """
    given = command_line_settings()
    groups = tuple(name for name in may_change if name.endswith("."))
    if foreign := [name for name in given if name not in may_change and not name.startswith(groups)]:
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
    now, schema = OmegaConf.structured(config), overridable(type(config))
    if gone := _take_unknown(saved, schema):
        print(f"ignores settings of the checkpoint that this version does not have: {', '.join(gone)}", file=sys.stderr)
    try:
        merged = OmegaConf.merge(schema, saved)
        for name in given:
            OmegaConf.update(merged, name, OmegaConf.select(now, name))
        return cast(Config, OmegaConf.to_object(merged))
    except InputError:
        raise
    except (OmegaConfBaseException, AttributeError, TypeError, ValueError) as error:
        raise InputError(f"the checkpoint's configuration is of another version: {one_line(error)}") from error


def _take_unknown(saved: dict, schema: DictConfig, place: str = "") -> list[str]:
    """Removes the settings that a schema lacks from nested dicts; returns them, each with its value."""
    found = []
    for name in list(saved):
        if name not in schema:
            found.append(f"{place}{name}={str(saved.pop(name))[:40]}")
        elif isinstance(saved[name], dict) and isinstance(inner := schema._get_node(name), DictConfig):
            found += _take_unknown(saved[name], inner, f"{place}{name}.")
    return found


def _interpolation(value: Any) -> str | None:
    """The first text in nested dicts and lists that OmegaConf would not take literally."""
    if isinstance(value, dict | list):
        inner = [*value, *value.values()] if isinstance(value, dict) else value
        return next((found for one in inner if (found := _interpolation(one))), None)
    return value if isinstance(value, str) and ("${" in value or value == "???") else None


# --- what each setting means, from the docstrings of the dataclasses that hold it ------------------------------------------

_ATTRIBUTE = re.compile(r"^(\w+(?:, \w+)*): (.+(?:\n +.+)*)", re.MULTILINE)


def described_fields(schema: type) -> dict[str, str]:
    """The text of each name in the "Attributes:" section of a class and its bases, on one line each.

    The section's form is Google's: "name: text" or "name, name: text", continued on deeper lines, up to a blank line.
    """
    found: dict[str, str] = {}
    for one in reversed(schema.__mro__):
        section = inspect.cleandoc(one.__dict__.get("__doc__") or "").partition("Attributes:")[2].split("\n\n")[0]
        for names, text in _ATTRIBUTE.findall(inspect.cleandoc("\n" + section)):
            found |= dict.fromkeys(names.split(", "), " ".join(text.split()))
    return found


def settings(schema: type, prefix: str = "") -> dict[str, str]:
    """Every setting of a nested dataclass, by its dotted name, with what its docstring says; "" where it says nothing."""
    texts, hints = described_fields(schema), typing.get_type_hints(schema)
    found: dict[str, str] = {}
    for one in dataclasses.fields(schema):
        name, hint = f"{prefix}{one.name}", hints[one.name]
        found[name] = texts.get(one.name, "")
        for option in typing.get_args(hint) if isinstance(hint, types.UnionType) else (hint,):
            if isinstance(option, type) and dataclasses.is_dataclass(option):
                found |= settings(option, f"{name}.")
    return found


def as_text(texts: dict[str, str]) -> str:
    """A paragraph for each setting: its name and its meaning, wrapped to the terminal."""
    width = min(max(map(len, texts)), 36) + 4
    columns = max(shutil.get_terminal_size((120, 24)).columns, width + 40)
    wrapper = textwrap.TextWrapper(columns, subsequent_indent=" " * width)
    return "\n".join(wrapper.fill(f"  {name}".ljust(width) + text).rstrip() for name, text in texts.items())


def with_comments(yaml: str, texts: dict[str, str]) -> str:
    """YAML of two-space indentation, each setting with its text as a comment behind it."""
    place: list[str] = []
    lines = []
    for line in yaml.splitlines():
        if matched := re.match(r"^( *)([\w]+):", line):
            depth = len(matched[1]) // 2
            place[depth:] = [matched[2]]
            if text := texts.get(".".join(place)):
                line = f"{line}  # {text}"
        lines.append(line)
    return "\n".join(lines)
