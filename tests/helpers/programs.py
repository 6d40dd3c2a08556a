"""The programs as a user runs them."""

import atexit
import importlib.util
import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from functools import cache
from pathlib import Path
from types import ModuleType

ROOT = Path(__file__).parents[2]

STARTER = """
import atexit, sys

preloaded = {}

@atexit.register  # first, and so it runs last
def spare_preloaded():
    for name in preloaded:
        sys.modules.pop(name, None)

import ctypes, gc, json, numba, os, resource, runpy
import kpopnet.programs.evaluate, kpopnet.programs.train, synth.__main__, torch.utils.tensorboard
import torch._inductor  # which torch imports when it is made deterministic

numba.njit("void()")(lambda: None)  # numba imports a part of itself for the first kernel
del sys.modules["synth.__main__"]  # which runpy runs
gc.collect()
gc.freeze()  # a child that looks for garbage would copy all of it
own = ("kpopnet", "synth", "__main__", "sys", "builtins")
preloaded.update((name, module) for name, module in sys.modules.items() if name.partition(".")[0] not in own)
ctypes.pythonapi.Py_IncRef(ctypes.py_object(preloaded))  # for ever
libc = ctypes.CDLL(None)
if hasattr(libc, "on_exit"):
    libc.on_exit(libc._exit, None)  # after all else that a child does at its end, and before what libraries do that it forked

while line := sys.stdin.readline():
    words, folder, most_bytes, environments, *files = json.loads(line)
    children = []
    for environment in environments:
        if not (child := os.fork()):
            break
        children.append(child)
    else:
        print(max((os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) for child in children), key=abs), flush=True)
        continue
    for number, file in enumerate((os.devnull, *files)):
        os.dup2(os.open(file, os.O_RDWR | os.O_APPEND), number)
    os.chdir(folder)
    resource.setrlimit(resource.RLIMIT_FSIZE, (most_bytes, most_bytes))
    os.environ.clear()
    os.environ.update(environment)
    sys.argv = words[words[0] == "-m" :]
    if words[0] == "-m":
        sys.path[0] = folder
        runpy.run_module(words[1], run_name="__main__", alter_sys=True)
    else:
        sys.path[0] = os.path.dirname(words[0])
        runpy.run_path(words[0], run_name="__main__")
    break
"""
"""Runs programs, each in a process of its own in which what the largest import is loaded already: that takes most of the time
of a short program, as would taking all of it down at the end, which is done for our modules and for what the program itself
made or imported. A line of JSON on the standard input for each, with the largest size of a file and the environments of its
processes; an exit code on the standard output."""


@cache
def starter() -> subprocess.Popen:
    process = subprocess.Popen(
        [sys.executable, "-c", STARTER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment()
    )
    atexit.register(process.communicate)
    return process


def environment() -> dict[str, str]:
    """One thread, and the tests' helpers can be imported, as can what could be before."""
    path = os.pathsep.join((str(ROOT), str(ROOT / "tests" / "helpers"), os.environ.get("PYTHONPATH", ""))).rstrip(os.pathsep)
    return os.environ | {"OMP_NUM_THREADS": "1", "PYTHONPATH": path}


def ranks(processes: int) -> list[dict[str, str]]:
    """The environments that torchrun would give to a number of processes."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = str(free.getsockname()[1])
    own = {"MASTER_ADDR": "127.0.0.1", "MASTER_PORT": port, "WORLD_SIZE": str(processes), "LOCAL_WORLD_SIZE": str(processes)}
    return [environment() | own | {"RANK": str(rank), "LOCAL_RANK": str(rank)} for rank in range(processes)]


def run_program(
    script: str | Path, place: Path, *words: object, processes: int = 0, most_bytes: int = -1
) -> subprocess.CompletedProcess:
    """Runs a script, by default of the repository, or with "-m" a module, in `place`; in a number of processes, as torchrun; if
    wanted with a limit on the size of every file, which stands for a full disk."""
    command = [script if script == "-m" else str(ROOT / script), *map(str, words)]
    environments = ranks(processes) if processes else [environment()]
    with tempfile.NamedTemporaryFile("r") as output, tempfile.NamedTemporaryFile("r") as errors:
        process = starter()
        wanted = command, str(place), most_bytes, environments, output.name, errors.name
        print(json.dumps(wanted), file=process.stdin, flush=True)
        return subprocess.CompletedProcess(command, int(process.stdout.readline()), output.read(), errors.read())


def ended(process: int) -> bool:
    """Whether a process ends within half a minute; one that does not is killed."""
    for _ in range(600):
        try:
            os.kill(process, 0)
            if Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] == "Z":  # no process waits for it
                return True
        except (ProcessLookupError, FileNotFoundError):
            return True
        time.sleep(0.05)
    os.kill(process, signal.SIGKILL)
    return False


def tool(name: str) -> ModuleType:
    """A program of tools/ as a module."""
    spec = importlib.util.spec_from_file_location(name, ROOT / "tools" / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
