"""Which code this is: its revision, and how its optional libraries are installed."""

import json
import shlex
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import date
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from kpopnet.errors import InputError

CHECKOUT = Path(__file__).parents[2]
"""Of this code, where it is not installed from a wheel."""


def git_revision() -> dict[str, str | bool] | None:
    """The revision of this code and whether it was changed since; None where it is no checkout, but installed."""
    if not (CHECKOUT / "pyproject.toml").is_file():  # a git repository around it is another's
        return None
    try:
        revision, changes = (
            subprocess.run(["git", *command], cwd=CHECKOUT, capture_output=True, text=True, check=True).stdout.strip()
            for command in (("rev-parse", "HEAD"), ("status", "--porcelain"))
        )
    except (OSError, subprocess.CalledProcessError):
        return None
    return {"revision": revision, "dirty": bool(changes)}


def measured_by() -> dict[str, object]:
    """What a file of figures says of the program that wrote it: its code, command and date."""
    return {"code": git_revision(), "command": shlex.join(["python", *sys.argv]), "date": date.today().isoformat()}


def install_command(extra: str) -> str:
    """The command that installs an extra from where this code came: its checkout, or the wheel. No package index has it.

    In double quotes, which the shells of Windows know too.
    """
    if (CHECKOUT / "pyproject.toml").is_file():
        return f'pip install -e "{CHECKOUT}[{extra}]"'
    try:
        installed = distribution("kpopnet")
    except PackageNotFoundError:
        return f'pip install "WHEEL[{extra}]" with the path of kpopnet\'s wheel'
    origin = json.loads(installed.read_text("direct_url.json") or "{}")  # PEP 610
    place = origin.get("url", f"file:///PATH/kpopnet-{installed.version}-py3-none-any.whl")
    return f'pip install "kpopnet[{extra}] @ {place}"'


@contextmanager
def optional_library(where: str, package: str, extra: str, note: str = "") -> Iterator[None]:
    """Around the import of a library of an extra: makes an InputError of the ImportError, which says what to install."""
    try:
        yield
    except ImportError as error:
        raise InputError(
            f"{where}: needs {package}, which does not load ({error}); install it: {install_command(extra)}{note}"
        ) from error
