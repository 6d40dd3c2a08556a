"""What a parser may do on hostile bytes, to the process that reads for us."""

import json
import os
import signal
import sys
import time
from pathlib import Path

import numpy as np

from kpopnet.errors import InputError

DEED_BYTES = 2_000_000_000
"""The memory that the reader may take."""


def perform(path: Path) -> str:
    """Does what a file says."""
    match deed := json.loads(path.read_text())["do"]:
        case "hang":
            while True:
                pass
        case "sleep":
            time.sleep(60)
        case "swell":
            np.empty(DEED_BYTES, np.uint8)
        case "crash":
            os.kill(os.getpid(), signal.SIGSEGV)
        case "exit" | "leave":
            (os._exit if deed == "exit" else sys.exit)(0)
        case "raise":
            raise KeyError("first line\nsecond \x1b[31mline")
        case "refuse":
            raise InputError(f"{path}: \x1b[31mline\nbreak \ud800")
        case "print":
            os.write(1, b"a library that prints\n" * 1000)
    return deed
