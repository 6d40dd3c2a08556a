"""Says that numba compiles its kernels for this machine, which it does once, when they are first used."""

import multiprocessing
import sys
import time

from numba.core import event

_listener: "CompilationNotice | None" = None


class CompilationNotice(event.Listener):
    """Counts kernels on the standard error stream while numba compiles them; silent where they come from its cache."""

    def __init__(self) -> None:
        self.depth = self.kernels = 0
        self.began = self.spoke = 0.0

    def on_start(self, event: event.Event) -> None:
        self.depth += 1
        if self.depth > 1:  # a kernel that another one calls
            return
        now = time.monotonic()
        self.began = self.began or now
        if not self.kernels:
            print("compiling kernels for this machine, once; up to a minute:", file=sys.stderr, flush=True)
        if now - self.spoke > 1.0 or not self.kernels:
            self.spoke = now
            kernel = (event.data or {})["dispatcher"].py_func.__qualname__
            print(f"  {now - self.began:4.0f} s, kernel {self.kernels + 1}: {kernel}", file=sys.stderr, flush=True)
        self.kernels += 1

    def on_end(self, event: event.Event) -> None:
        self.depth -= 1


def announce_compilation() -> None:
    """Has this process say so when numba compiles; worker processes stay silent, one voice is enough."""
    global _listener
    if _listener is None and multiprocessing.parent_process() is None:
        _listener = CompilationNotice()
        event.register("numba:compile", _listener)
