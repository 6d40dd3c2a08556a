"""Parts of command lines that several programs share."""

import argparse
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

from kpopnet.camera import CAMERAS
from kpopnet.errors import InputError
from kpopnet.runtime.provenance import optional_library
from kpopnet.sources import DepthSource, chosen_camera, open_depth


def program_parser(name: str, description: str | None) -> argparse.ArgumentParser:
    """A parser that shows a program's docstring as it stands."""
    return argparse.ArgumentParser(name, description=description, formatter_class=argparse.RawDescriptionHelpFormatter)


def add_address(parser: argparse.ArgumentParser, port: int) -> None:
    """Where a local server listens; see `kpopnet.teacher.hosting.host`."""
    parser.add_argument("--host", default="127.0.0.1", help="address to listen on; any but this machine's own asks for a token")
    parser.add_argument("--port", type=int, default=port, help="%(default)s; 0: one that is free")
    parser.add_argument("--no-browser", action="store_true", help="only print the address")


def check_server(program: str, port: int) -> None:
    """Raises InputError where the library of local servers is missing, or for a port that cannot be."""
    if not 0 <= port <= 65535:
        raise InputError(f"--port {port}: expected 1 to 65535, or 0 for one that is free")
    with optional_library(program, "aiohttp", "app"):
        import aiohttp  # noqa: F401


def add_depth(parser: argparse.ArgumentParser) -> None:
    """What a recording of depth may not state."""
    parser.add_argument("--camera", help=f"preset ({', '.join(CAMERAS)}) or JSON file of intrinsics; default: the recording's")
    parser.add_argument("--fov", type=float, help="instead: horizontal field of view in degrees")
    parser.add_argument("--focal", type=float, help="instead: focal length in pixels, of a centred camera")
    parser.add_argument("--fps", type=float, help="true images per second of a recording that states none or wrong ones")
    parser.add_argument("--rotate", type=int, choices=(0, 90, 180, 270), default=0, help="turns images clockwise: %(default)s")
    parser.add_argument(
        "--depth-scale", type=float, help="stored units per metre: 5000 for TUM's images; default: 1000 for integers"
    )
    parser.add_argument("--key", help="the array or topic, in a file that has several; of a folder, a pattern: 'depth_*.png'")


OF_RECORDINGS = ("camera", "fov", "focal", "fps", "depth_scale", "key")
OF_DEPTH = (*OF_RECORDINGS, "rotate", "segmented")
LEFT_OUT = {"rotate": 0, "segmented": False, "loop": False}
"""What argparse puts for a word that is left out, where that is not None."""


def tell_assumed_rate(source: DepthSource) -> None:
    """Says on standard error that a recording's frame rate is a guess."""
    if not source.fps_is_known and source.frames != 1:
        text = f"the recording states no frame rate: {source.fps:g} images a second assumed; give the true one with --fps"
        print(text, file=sys.stderr)


def check_not_given(given: argparse.Namespace, names: tuple[str, ...], why: str) -> None:
    """Raises InputError where one of these words was given, which would change nothing: `why` says why."""
    for name in names:
        if getattr(given, name, None) not in (None, LEFT_OUT.get(name)):  # a 0 or an empty text was given too
            raise InputError(f"--{name.replace('_', '-')}: {why}")


def add_grading(parser: argparse.ArgumentParser, tempo: str) -> None:
    """What a teacher leaves free, and what the total consists of; `tempo` says when there is a rhythm."""
    from kpopnet.dance.scoring import FIGURES  # takes a second to import

    free = "part of the dance, from and to a second, in which all may dance what they like: not compared; may be repeated"
    parser.add_argument("--free", type=float, nargs=2, action="append", default=[], metavar=("FROM", "TO"), help=free)
    weights = f"what the total consists of, as in similarity=3 place=1: any of {', '.join(FIGURES)} ({tempo})"
    parser.add_argument("--weights", nargs="+", type=weight, default=[], metavar="NAME=WEIGHT", help=weights)


def check_grading(given: argparse.Namespace) -> None:
    """Raises InputError for words of `add_grading` that cannot be."""
    from kpopnet.dance.scoring import check_free, check_weights

    check_free(given.free)
    check_weights(dict(given.weights))


def png(word: str) -> Path:
    """The path of a picture; raises ArgumentTypeError for another kind of file."""
    if not word.lower().endswith(".png"):
        raise argparse.ArgumentTypeError(f"{word}: expected a name that ends in .png")
    return Path(word)


def weight(word: str) -> tuple[str, float]:
    """A name and a number, of name=number."""
    name, _, number = word.partition("=")
    try:
        return name, float(number)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{word!r} is no NAME=WEIGHT; files come before --weights") from None


def opener(path: Path, given: argparse.Namespace, in_child: bool) -> Callable[[], DepthSource]:
    """Opens the recording at a path, with the words of `add_depth`; for other processes too. `in_child`: see `open_depth`."""
    camera = chosen_camera(given.camera, given.fov, given.focal)
    return partial(open_depth, path, camera, given.fps, given.key, in_child, given.rotate, given.depth_scale)
