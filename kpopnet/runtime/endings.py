"""How a program ends: a user's mistake, a full disk or an interrupt is one line, also while the program still imports."""

import errno
import functools
import io
import logging
import os
import select
import signal
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import ParamSpec, TextIO, TypeGuard, TypeVar

from kpopnet.errors import InputError

P = ParamSpec("P")
R = TypeVar("R")

HYDRA, OMEGACONF = "hydra.errors.HydraException", "omegaconf.errors.OmegaConfBaseException"
"""What these libraries raise for a user's mistakes. By name: most programs import neither."""

OF_TERMINAL = tuple(filter(None, (signal.SIGINT, getattr(signal, "SIGHUP", None))))
"""The signals that every process of a terminal gets: Ctrl-C, and that the terminal was closed, which Windows lacks."""


def begin_imports() -> None:
    """Lets Ctrl-C end this process at once with exit code 130 and one line.

    As an exception it would go through the initialisation of numpy, torch or numba, which make tracebacks of it or swallow it.
    """
    signal.signal(signal.SIGINT, _stop)


def end_imports() -> None:
    """Lets Ctrl-C raise KeyboardInterrupt again."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


def _stop(_number: int, _frame: FrameType | None) -> None:
    os.write(2, b"stopped\n")
    os._exit(130)


def user_errors(function: Callable[P, R]) -> Callable[P, R]:
    """Decorates a program: a user's mistake ends it with one line and exit code 1, anything else with its traceback.

    Around `hydra.main` it catches unknown overrides and the like; what the function inside raises must be caught inside, by
    this decorator again, before Hydra comments on it.
    """

    @functools.wraps(function)
    def careful(*args: P.args, **kwargs: P.kwargs) -> R:
        # Lets Hydra's own errors through to here; what it makes of them itself takes many lines.
        os.environ["HYDRA_FULL_ERROR"] = "1"
        logging.raiseExceptions = False  # where no log can be written, no result can: that error is printed
        threading.excepthook = _thread_ended
        _open_output()
        try:
            try:
                result = function(*args, **kwargs)
            except SystemExit:
                sys.stdout.flush()
                raise
            sys.stdout.flush()  # here, where errors of it can still be caught
            return result
        except (KeyboardInterrupt, SystemError) as error:
            # Compiled code may make a SystemError of the interrupt.
            if not isinstance(error, KeyboardInterrupt) and not isinstance(error.__cause__, KeyboardInterrupt):
                raise
            print("stopped", file=sys.stderr)
            raise SystemExit(130) from None
        except Exception as error:
            if (isinstance(error, BrokenPipeError) and _is_unread(sys.stdout)) or is_windows_broken_pipe(error):
                silence_output()
                raise SystemExit(141) from None  # as a shell says of a program that `| head` ended
            if (message := _message(error)) is None:
                raise
            print(f"error: {message}", file=sys.stderr)
            try:
                sys.stdout.flush()
            except OSError:  # the disk to which this program's output goes is full: Python would say so once more
                silence_output()
            raise SystemExit(1) from None

    return careful


def _open_output() -> None:
    """Prints what a stream cannot show as backslash escapes from here on; what a program without a console prints is lost."""
    for name in ("stdout", "stderr"):
        if (stream := getattr(sys, name)) is None:
            setattr(sys, name, Path(os.devnull).open("w", errors="backslashreplace"))  # noqa: SIM115 until the program ends
        elif isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def silence_output() -> None:
    """What is left to print goes nowhere."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _is_unread(stream: TextIO | None) -> bool:
    """Whether this program's output goes into a pipe that no program reads any more; see `is_windows_broken_pipe`."""
    if stream is None or not hasattr(select, "poll"):
        return False
    pipe = select.poll()
    pipe.register(stream.fileno(), 0)
    return any(event & select.POLLERR for _, event in pipe.poll(0))


ON_WINDOWS = os.name == "nt"


def is_windows_broken_pipe(error: BaseException) -> bool:
    """Whether this is how Windows tells a program which prints that no program reads any more: an error of no file."""
    return ON_WINDOWS and isinstance(error, OSError) and error.errno == errno.EINVAL and error.filename is None


AGAIN = "and run the same command again"
REMEDIES = {
    errno.ENOSPC: f"the disk is full; make room {AGAIN}",
    errno.EDQUOT: f"your quota of the disk is used up; make room {AGAIN}",
    errno.EFBIG: f"the file is larger than a file may be here (ulimit -f); raise the limit {AGAIN}",
    errno.EROFS: "the disk is read-only; give another folder",
    errno.EACCES: "permission denied; give another path, or change the permissions",
    errno.ENOTDIR: "a part of this path is a file, expected a folder; give another path",
    errno.EEXIST: "is there already, and is no folder; give another path",
    errno.ENAMETOOLONG: "the name is too long; most file systems allow 255 bytes a name and 4096 a path",
    errno.EINVAL: "this disk takes no such name, of letters like : or ?, or does not do what is asked; give another path",
    errno.EILSEQ: "this disk takes no such name; give another path",
    errno.EMFILE: "too many files are open (ulimit -n); raise the limit",
}
"""What the user can do about a file that cannot be read or written, by the error's number."""

DISK_ERRORS = {*REMEDIES, errno.EPERM, errno.ENOENT, errno.EISDIR, errno.ELOOP, errno.EIO, errno.ESTALE}


def is_of_the_disk(error: BaseException | None) -> TypeGuard[OSError]:
    """Whether an error comes from the file system or its limits, and not from a mistake in the program."""
    if not isinstance(error, OSError) or (error.errno == errno.EINVAL and error.filename is None):  # of anything
        return False
    return error.errno in DISK_ERRORS


def _message(error: Exception) -> str | None:
    """The line about a user's mistake, or what the user's disk or cluster did; None for other errors."""
    if isinstance(error, InputError) or _is_a(error, HYDRA, OMEGACONF):  # first: some of Hydra's are OSErrors too
        return one_line(error)
    if is_of_the_disk(error):
        return of_the_disk(error)
    if isinstance(error, RuntimeError) and str(error).startswith("cannot cache function"):  # numba's
        return "compiled kernels can be kept in no folder; set NUMBA_CACHE_DIR to one that can be written"
    if type(error).__module__.startswith("submitit."):
        job = str(error).splitlines()[0]
        return f"{job} did not finish; what is finished stays: run the same command again"
    return None


def of_the_disk(error: Exception) -> str:
    """What happened to a file, and what the user can do about it; of any other error its text."""
    if not isinstance(error, OSError):
        return str(error)
    path = "a file" if error.filename is None else os.fsdecode(error.filename)
    path = path if len(path) <= 300 else f"{path[:150]}...{path[-100:]}"
    number = error.errno or errno.EIO
    or_close = ", or close the program that has it open" if ON_WINDOWS and number == errno.EACCES else ""
    return f"{path}: {REMEDIES.get(number, os.strerror(number).lower())}{or_close}"


def _thread_ended(ended: threading.ExceptHookArgs) -> None:
    """Threads that write, such as TensorBoard's, hand errors of the disk to the main thread, which prints them once."""
    if not is_of_the_disk(ended.exc_value):
        threading.__excepthook__(ended)


def _is_a(error: Exception, *names: str) -> bool:
    """Whether an error is of one of these classes, whose modules need not be imported to ask."""
    return any(f"{kind.__module__}.{kind.__name__}" in names for kind in type(error).__mro__)


def one_line(error: Exception) -> str:
    """The message without OmegaConf's indented details and without the hint to override a closed schema with "+"."""
    left_out = (" ", "To append to your config")
    text = str(error)
    if text.startswith("Caught InputError in DataLoader worker"):
        # torch puts the worker's traceback into the message; its last line is ours.
        return text.rpartition("InputError: ")[2].removesuffix("\\n")
    lines = [line for line in text.splitlines() if line and not line.startswith(left_out)]
    cause = error.__cause__
    if _is_a(error, HYDRA) and isinstance(cause, Exception) and _is_a(cause, OMEGACONF):
        lines.append(one_line(cause))
    return " ".join(dict.fromkeys(lines))
