"""Shows all people before a depth camera, live: depth and skeletons in the browser, joints for other programs, recordings.

    kpopnet live realsense                                opens the page; the keys R, J and space record and pause
    python feed.py | kpopnet live -                       depth that another program sends, of any other camera
    kpopnet live dance.mkv --camera kinect_v1 --loop      a recording instead of a camera, played in its own time
    kpopnet live realsense --stream json | my_program     and a line of JSON for each image, or csv, on standard output
    kpopnet live realsense --stream vmc --no-page         no page: bone rotations for an avatar by UDP; osc: joints

R writes every depth image of the camera to DATA/depth-TIME.h5, which `kpopnet predict` opens; J writes the joints of each
person to DATA/joints-personN-TIME.npz, which `kpopnet score` reads. docs/live.md describes page and streams.
"""

import argparse
import sys
from functools import partial
from pathlib import Path

from kpopnet.errors import InputError, check_between
from kpopnet.live.loop import Watcher, Watching
from kpopnet.live.streams import PORTS, STREAMS, TO_STDOUT, ReaderGoneError
from kpopnet.pose.estimator import MAX_PEOPLE
from kpopnet.programs import arguments
from kpopnet.runtime.compilation import announce_compilation
from kpopnet.runtime.endings import silence_output, user_errors
from kpopnet.runtime.input_files import named
from kpopnet.sources.live import LIVE_CAMERAS, PlayedRecording, check_live, is_live, open_live, shared_live
from kpopnet.tracker.refine import compile_refining

PORT = 8473
FOLDER = Path("outputs/live")
OF_PAGE = ("host", "port", "no_browser", "data")


def parsed() -> argparse.Namespace:
    parser = arguments.program_parser("kpopnet live", __doc__)
    cameras = "; ".join(f"{name}: {about}" for name, about in LIVE_CAMERAS.items())
    parser.add_argument("source", nargs="?", help=f"a recording of depth, or a camera: {cameras}")
    parser.add_argument("--loop", action="store_true", help="play a recording again and again")
    parser.add_argument("--data", type=Path, default=FOLDER, help="folder of what is recorded and saved: %(default)s")
    parser.add_argument("--people", type=int, default=MAX_PEOPLE, help="largest number of people: %(default)s")
    parser.add_argument("--checkpoint", help="network that estimates the pose; tracker for the tracker without a network")
    parser.add_argument("--stream", choices=STREAMS, help="send the joints of each image: json and csv to standard output")
    ports = ", ".join(f"{kind} {port}" for kind, port in PORTS.items())
    parser.add_argument("--port-out", type=int, help=f"UDP port of this machine that osc or vmc goes to: {ports}")
    parser.add_argument("--no-page", action="store_true", help="stream without a page; ends with the recording")
    arguments.add_depth(parser)
    arguments.add_address(parser, PORT)
    given = parser.parse_args()
    for name in OF_PAGE if given.no_page else ():
        if getattr(given, name) != parser.get_default(name):
            raise InputError(f"--{name.replace('_', '-')}: is of the page, which --no-page leaves out; drop one of the two")
    return given


def watching(given: argparse.Namespace) -> Watching:
    """What the command line asks to watch; raises InputError for mistakes in it."""
    if given.source is None:
        raise InputError(f"no source; give a recording of depth, or a camera: {', '.join(LIVE_CAMERAS)}")
    check_between("--people", given.people, 1, MAX_PEOPLE)
    if given.no_page and given.stream is None:
        raise InputError("--no-page: nothing would be seen; add --stream json, csv, osc or vmc")
    last = 65536 - given.people if given.stream == "vmc" else 65535  # each person has a port
    if given.port_out is not None and (given.stream not in PORTS or not 1 <= given.port_out <= last):
        raise InputError(f"--port-out {given.port_out}: expected 1 to {last}, with --stream {' or '.join(PORTS)}")
    if is_live(given.source):
        name = check_live(given.source, "kpopnet live")
        arguments.check_not_given(
            given, (*arguments.OF_RECORDINGS, "loop"), "a live camera states its own; it is for recordings"
        )
        open_camera = partial(open_live, given.source, given.rotate)
    else:
        path = Path(given.source)
        if not path.exists():
            raise InputError(f"{path}: no such recording, and no camera; there are {', '.join(LIVE_CAMERAS)}")
        open_source, name = arguments.opener(path, given, in_child=True), named(path).name
        arguments.tell_assumed_rate(open_source())
        open_camera = partial(PlayedRecording, open_source, given.loop)
    return Watching(name, open_camera, given.data, given.checkpoint, given.people, given.stream, given.port_out)


def watch_alone(asked: Watching) -> None:
    """Streams without a page until the source ends or the program is interrupted."""
    announce_compilation(compile_refining)

    def tell(kind: str, content: dict, _picture: bytes | None = None) -> None:
        if text := content.get("text"):
            print(text, file=sys.stderr)

    try:
        Watcher(asked, tell, lambda: iter(())).run()
    except ReaderGoneError:
        silence_output()  # the last lines have nowhere to go


@user_errors
def main() -> None:
    given = parsed()
    if not given.no_page:
        arguments.check_server("kpopnet live", given.port)
    with shared_live(given.source) as given.source:
        asked = watching(given)
        if given.stream in PORTS:
            to = given.port_out or PORTS[given.stream]
            print(f"{given.stream} goes to UDP port {to} of this machine   (Ctrl+C ends)", flush=True)
        if given.no_page:
            watch_alone(asked)
            return
        from kpopnet.live.server import SAVE_S, make_watch_app
        from kpopnet.teacher.hosting import END_S, host

        out = sys.stderr if given.stream in TO_STDOUT else sys.stdout
        host(partial(make_watch_app, asked), given, "live at", out=out, end_s=SAVE_S + END_S)
