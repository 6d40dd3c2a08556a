"""The console script `kpopnet`: every program by name, from an installed wheel as from a checkout."""

import importlib
import sys
from importlib.metadata import version

from kpopnet.runtime.endings import begin_imports, end_imports, user_errors

PROGRAMS = {
    "generate": ("synth.__main__", "makes training samples and simulated sets (python -m synth)"),
    "train": ("kpopnet.programs.train", "trains a network or the random tree walk (python train.py)"),
    "evaluate": ("kpopnet.programs.evaluate", "evaluates estimators and dance scores (python evaluate.py)"),
    "predict": ("kpopnet.programs.predict", "estimates the joints of people in a recording of depth, and shows them"),
    "check": ("kpopnet.programs.check", "runs a scripted minute before a camera and prints the acceptance sheet"),
    "score": ("kpopnet.programs.score", "scores a learner's dance against a teacher's, from two files of joints"),
    "convert": ("kpopnet.programs.convert", "makes a set of dances from files of joints"),
    "describe": ("kpopnet.datasets.describe", "lists the ids of EVAL's joints or SMMC-10's markers"),
    "export": ("kpopnet.programs.export", "writes a network as an ONNX file"),
    "teach": ("kpopnet.programs.teach", "opens the dance teacher: a page that shows a dance and scores the learner"),
    "live": ("kpopnet.programs.live", "shows all people before a depth camera, live; streams joints, records"),
    "rate": ("kpopnet.programs.rate", "collects people's judgements of learners in a set of dances, and says how they agree"),
    "stages": ("kpopnet.programs.stages", "draws how the tracker follows one frame, stage after stage"),
}
"""The module of each program, whose `main()` runs it with sys.argv, and what it does."""


def usage() -> str:
    """What --help prints."""
    programs = "\n".join(f"  kpopnet {name.ljust(10)} {text}" for name, (_, text) in PROGRAMS.items())
    about = "3D joints of a person from depth images, and a dance score from the joints."
    hint = "Each answers --help with its settings. kpopnet --version prints the version."
    return f"usage: kpopnet PROGRAM ...\n\n{about}\n\n{programs}\n\n{hint}"


@user_errors
def main() -> None:
    """Runs the program that the first argument names; exits with code 2 where it names none."""
    name = sys.argv[1] if len(sys.argv) > 1 else "--help"
    if name in ("-h", "--help"):
        print(usage())
        return
    if name == "--version":
        print(version("kpopnet"))
        return
    if name not in PROGRAMS:
        print(f"kpopnet: there is no program {name}; there are {', '.join(PROGRAMS)}", file=sys.stderr)
        raise SystemExit(2)
    sys.argv = [f"kpopnet {name}", *sys.argv[2:]]
    run(name)


def run(name: str) -> None:
    """Runs a program of PROGRAMS with the words in sys.argv; one line and exit code 1 if a library is missing."""
    begin_imports()
    try:
        program = importlib.import_module(PROGRAMS[name][0])
        end_imports()
        program.main()
    except ModuleNotFoundError as error:
        if (error.name or "").split(".")[0] in ("", "kpopnet", "synth"):
            raise
        about = f"error: kpopnet {name} needs {error.name}, which is not installed; install kpopnet with its dependencies"
        print(about, file=sys.stderr)
        raise SystemExit(1) from None


if __name__ == "__main__":
    main()
