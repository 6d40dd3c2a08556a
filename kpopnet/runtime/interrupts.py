"""Programs that are stopped while they still import: one line, as later on."""

import os
import signal
from types import FrameType


def begin_imports() -> None:
    """Lets Ctrl-C end this process at once with exit code 130 and one line.

    As an exception it would go through the initialisation of numpy, torch or numba, which make tracebacks of it or swallow it.
    Nothing has been written that would have to be tidied up.
    """
    signal.signal(signal.SIGINT, _stop)


def end_imports() -> None:
    """Lets Ctrl-C raise KeyboardInterrupt again."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


def _stop(_number: int, _frame: FrameType | None) -> None:
    os.write(2, b"stopped\n")
    os._exit(130)
