"""Says that numba compiles its kernels for this machine, which it does once, when they are first used."""

import multiprocessing
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress

from numba.core import event

from kpopnet.runtime.cpu import available_cores, own_python

_listener: "CompilationNotice | None" = None
_beside: subprocess.Popen | None = None  # kept: Python warns of one that is forgotten while it runs


class CompilationNotice(event.Listener):
    """Counts kernels on the standard error stream while numba compiles them; silent where they come from its cache."""

    def __init__(self, beside: Callable[[], None] | None) -> None:
        self.depth = self.kernels = 0
        self.began = self.spoke = 0.0
        self.beside = beside

    def on_start(self, event: event.Event) -> None:
        self.depth += 1
        if self.depth > 1:  # a kernel that another one calls
            return
        now = time.monotonic()
        self.began = self.began or now
        if not self.kernels:
            print("compiling kernels for this machine, once; up to a minute:", file=sys.stderr, flush=True)
            if self.beside is not None and available_cores() > 1:
                _run_beside(self.beside)
        if now - self.spoke > 1.0 or not self.kernels:
            self.spoke = now
            kernel = (event.data or {})["dispatcher"].py_func.__qualname__
            print(f"  {now - self.began:4.0f} s, kernel {self.kernels + 1}: {kernel}", file=sys.stderr, flush=True)
        self.kernels += 1

    def on_end(self, event: event.Event) -> None:
        self.depth -= 1


def announce_compilation(beside: Callable[[], None] | None = None) -> None:
    """Has this process say so when numba compiles; worker processes stay silent, one voice is enough.

    `beside` is a function of a module that compiles kernels which this process uses last: another process calls it meanwhile,
    and what that has done by then comes from numba's cache. On one core that would take longer: it compiles all by itself.
    """
    global _listener
    if _listener is None and multiprocessing.parent_process() is None:
        _listener = CompilationNotice(beside)
        event.register("numba:compile", _listener)


def _run_beside(compile_kernels: Callable[[], None]) -> None:
    """Calls a function in a process of its own, which ends by itself: killed, it might leave a cache of two halves."""
    name, quiet = compile_kernels.__name__, subprocess.DEVNULL
    words, environment = own_python(f"from {compile_kernels.__module__} import {name}; {name}()")
    with suppress(OSError):  # then this process compiles all of it
        global _beside
        _beside = subprocess.Popen(words, stdin=quiet, stdout=quiet, stderr=quiet, env=environment)
