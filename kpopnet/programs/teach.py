"""The dance teacher: a page on this machine that shows a dance, watches you through a depth camera and says how it goes.

    kpopnet teach                                 opens the page; without a camera a simulated learner dances
    kpopnet teach --live realsense                a RealSense camera watches you (the extra realsense)
    kpopnet teach --live oak                      an OAK camera (the extra oak)
    python feed.py | kpopnet teach --live -       any other camera, whose depth a program of yours sends
    kpopnet teach --depth recording --camera kinect_v1     a recording of depth instead of a camera
    kpopnet teach add mama.bvh --title Mama --bpm 128      adds a dance of one's own: .bvh, .npz, .glb ... of joints,
    kpopnet teach add dance.bag --from 4 --to 64           a recording of depth: the network of the package finds the joints,
    kpopnet teach add my_set/                              or the teachers of a folder in the K-Pop format
    kpopnet teach add ann.bvh bea.bvh --title Duet         a group that was recorded together, a file for each dancer
    kpopnet teach see                             shows dances to the network: scores of composed ones are surer; 20 minutes

The first start makes a hundred dances, in a quarter of a minute on two quiet cores. docs/teaching.md describes the page.
"""

import argparse
import math
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from tqdm import tqdm

from kpopnet.dance.joint_files.mediapipe import WEBCAM
from kpopnet.dance.joint_files.reader import read_strangers_group
from kpopnet.dance.performance import Performance, from_absolute_clocks
from kpopnet.errors import InputError
from kpopnet.languages import Said
from kpopnet.pose import PoseEstimator
from kpopnet.programs import arguments
from kpopnet.programs.predict import estimated
from kpopnet.programs.score import seeing_estimator
from kpopnet.runtime.cpu import available_cores
from kpopnet.runtime.endings import user_errors
from kpopnet.runtime.folder_lock import locked
from kpopnet.runtime.input_files import expect, named
from kpopnet.runtime.parallel import in_processes
from kpopnet.sources.live import LIVE_CAMERAS, check_live, open_live, shared_live
from kpopnet.sources.source import DepthSource, LiveCamera, TimedDepth
from kpopnet.teacher.adding import MIN_S, add_group, check_length, holds_depth, kpop_teachers, part_of
from kpopnet.teacher.library import SEEN_AS, TRIES, Library, TaughtDance, TeacherBody, checked_title, taught_dance
from kpopnet.teacher.live.lesson import DanceClock, Lesson
from kpopnet.teacher.live.loop import load_estimator
from kpopnet.teacher.live.webcam import DESCRIPTION
from kpopnet.teacher.posing import MAX_S

FOLDER = Path("outputs/teach")
PORT = 8471
SIMULATED, RECORDING = "simulated", "recording"
CAMERA_FPS = 30.0
TOO_SLOW_S = 5.0  # a recording that falls farther behind with each image, for this time, is given up
MOST_LETTERS = 60  # of a title


class SimulatedCamera(LiveCamera):
    """A simulated learner before a simulated camera."""

    def __init__(self, lesson: Lesson, dance: TaughtDance, clock: DanceClock) -> None:
        from synth.dances.live import ON_THE_BEAT, LiveLearner

        skill = ON_THE_BEAT if lesson.calibrate else lesson.skill
        dancer = dance.dancers[lesson.dancer]
        self._learner = LiveLearner(dancer.quats, dancer.hips_m, dance.fps, skill, lesson.fault, lesson.seed)
        self.camera, self._clock, self._next = self._learner.camera, clock, time.monotonic()

    def read(self) -> tuple[np.ndarray, float]:
        """See `LiveCamera.read`: the learner as they stand now."""
        self._next = wait_until(self._next)
        now = time.monotonic()
        return self._learner.frame(self._clock.dance_s(now)), now


class RecordedCamera(LiveCamera):
    """A recording that is played while the dance goes on.

    Before the dance it runs up to the image with which the excerpt begins; in a pause, and after its own end, it shows the last
    one. Images that are read too late for the dance are left out; `read` raises InputError where that would be all of them.
    """

    def __init__(self, source: DepthSource, clock: DanceClock) -> None:
        self.camera, self._source, self._clock, self._next = source.camera, source, clock, time.monotonic()
        self._rewind()

    def _rewind(self) -> None:
        self._images, self._danced = self._source.timed(), False
        self._coming: TimedDepth | None = next(self._images)
        self._shown, self._first_s = self._coming, self._coming.time_s

    def _early_s(self) -> float:
        """Seconds of the dance until the coming image is due; infinite after the last one."""
        if self._coming is None:
            return math.inf
        return self._coming.time_s - self._first_s - self._clock.dance_s(time.monotonic())

    def read(self) -> tuple[np.ndarray, float]:
        """See `LiveCamera.read`."""
        clock, late_s = self._clock, -1 / CAMERA_FPS
        if self._danced and clock.stopped:
            self._rewind()
        self._danced |= clock.running
        begun, gains = time.monotonic(), False
        while clock.running and (before_s := self._early_s()) < late_s:
            self._coming = next(self._images, None)
            gains |= self._early_s() > before_s
            if time.monotonic() > begun + TOO_SLOW_S and not gains:
                text = "this machine reads it more slowly than the dance goes on; slow the dance, or make the images smaller"
                raise InputError(Said("{name}: {what}", name=self._source.name, what=Said(text)))
        while clock.running and 0 < self._early_s() < math.inf:
            time.sleep(0.002)
        if self._coming is not None and self._early_s() <= (0 if clock.running else late_s):
            taken, self._shown, self._coming = time.monotonic(), self._coming, next(self._images, None)
        else:
            self._next = wait_until(self._next)
            taken = time.monotonic()
        return self._shown.depth_m, taken


def wait_until(moment: float) -> float:
    """Waits until a moment of `time.monotonic`; returns when the next image is due."""
    time.sleep(max(moment - time.monotonic(), 0))
    return max(moment + 1 / CAMERA_FPS, time.monotonic())


def open_source(
    open_recording: Callable[[], DepthSource] | None,
    lesson: Lesson,
    dance: TaughtDance,
    clock: DanceClock,
    live: dict[str, str] | None = None,
    rotate_deg: int = 0,
) -> LiveCamera:
    """Opens the source of depth that a lesson names; `live` says which live cameras it may be, whose images are turned."""
    if live and lesson.source in live:
        return open_live(live[lesson.source], rotate_deg)
    if lesson.source == SIMULATED or open_recording is None:
        return SimulatedCamera(lesson, dance, clock)
    return RecordedCamera(open_recording(), clock)


def made_library(folder: Path) -> Library:
    """The library of a folder; composed dances that are missing are made, with a progress bar."""
    from synth.body.teacher import teacher_arrays
    from synth.dances.taught import DANCES, Teacher

    library = Library(folder, TeacherBody(**teacher_arrays()))
    made = set(library.identities())
    missing = [index for index in range(DANCES) if f"dance_{index:03d}" not in made]
    if missing:
        teacher = Teacher()
        for index in tqdm(missing, "making dances, once", unit="dance", disable=None):
            one = teacher.dance(index)
            library.write(f"dance_{index:03d}", taught_dance(one.name, one.fps, one.bpm, one.joints_m, one.quats, one.hips_m))
    return library


def own_dances(given: argparse.Namespace) -> dict[str, list[Performance]]:
    """The dances in what `kpopnet teach add` is given: their dancers' joints, by title. Raises InputError if there is none."""
    path, *others = given.files
    teachers = {} if others else kpop_teachers(path)
    if teachers:
        arguments.check_not_given(given, (*arguments.OF_DEPTH, "joint_map"), f"for recordings; {path} is a folder of dances")
        expect(given.people == 1, "--people", f"a recording of depth; {path} is a folder of dances")
    if len(teachers) > 1:
        expect(given.title is None, "--title", f"one dance; {path} holds {len(teachers)}, which keep their names")
        return {name: [performance] for name, performance in teachers.items()}
    if teachers:
        ((name, performance),) = teachers.items()
        return {given.title or name: [performance]}
    if given.joint_map is None and holds_depth(path):
        expect(not others, str(path), "one recording of depth of all dancers, and --people")
        source = arguments.opener(path, given, in_child=True)()
        arguments.tell_assumed_rate(source)
        if source.frames is not None and given.to_s is None:  # at least so long: images may have been lost
            check_length(str(path), max(source.frames / source.fps - given.from_s, MIN_S))
        estimator = PoseEstimator.load(mode="best", people=given.people)
        people, times_s, fault = estimated(source, estimator, given.segmented)
        if fault is not None:
            print(f"{fault}; the {len(times_s):,} images before it are the dance", file=sys.stderr)
        if len(people) < given.people:
            text = f"{len(people)} of {given.people} people were found" if people else "no person was found"
            raise InputError(f"{path}: {text}; the camera must see each dancer from head to feet")
        return {given.title or named(path).stem: [Performance(one.joints_camera_m, times_s, one.confidence) for one in people]}
    arguments.check_not_given(
        given, tuple(name for name in arguments.OF_DEPTH if name != "fps"), f"for recordings of depth; {path} holds joints"
    )
    expect(given.people == 1, "--people", "a recording of depth; of joints, a file for each dancer")
    return {given.title or named(path).stem: read_strangers_group(given.files, given.fps, given.joint_map)}


def add_own(given: argparse.Namespace) -> None:
    """Adds them to the library, each in the part that was asked for."""
    if not 20 <= given.bpm <= 400:
        raise InputError(f"--bpm {given.bpm:g}: expected 20 to 400 beats per minute")
    expect(given.to_s is None or given.to_s > given.from_s, "--to", f"more than the {given.from_s:g} s of --from")
    arguments.check_grading(given)
    path = given.files[0]
    checked_title(given.title or named(path).stem)  # before a recording is looked at for minutes
    if given.to_s is not None:
        check_length(str(path), min(given.to_s - given.from_s, MAX_S))
    dances = own_dances(given)
    with locked(given.data):
        library = made_library(given.data)
        for title, recorded in dances.items():
            dancers = from_absolute_clocks(recorded)
            origin_s = max(float(one.times_s[0]) for one in dancers)  # of a group's common clock: from here on all are recorded
            parts = [part_of(one, given.from_s, given.to_s, origin_s, str(given.files[0])) for one in dancers]
            about = title[:MOST_LETTERS], given.bpm, given.free, dict(given.weights)
            identity = add_group(library, parts, str(given.files[0]), *about)
            print(f"added {about[0]} as {identity}; kpopnet teach shows it")


def see_dances(given: argparse.Namespace) -> None:
    """Shows the library's dances to the network, those that it has not seen."""
    from synth.dances.seen import PEOPLE

    with locked(given.data):
        library = made_library(given.data)
    missing = unseen(library)
    people = PEOPLE * sum(len(library.dance(identity).dancers) for identity in missing)
    with tqdm(total=people, desc="showing dances to the network, once", unit="person", disable=None) as bar:
        for _ in in_processes(partial(see_dance, given.data), missing, available_cores(), bar.update):
            pass
    print(f"{len(missing)} dances were shown to the network; lessons by depth camera go by what it saw")


def see_dance(folder: Path, identity: str, on_person: Callable[[], object]) -> None:
    """Writes what the estimator of lessons is off of a dance of a folder's library; calls `on_person` after each person."""
    from synth.body.teacher import teacher_arrays
    from synth.dances.seen import FPS, common_errors_m

    library, estimator = Library(folder, TeacherBody(**teacher_arrays())), seeing_estimator(SEEN_AS)
    dance = library.dance(identity)
    times_s = dance.performance.times_s
    frames = np.rint(np.arange(0, times_s[-1], 1 / FPS) * dance.fps).astype(int)
    moved = [[one[frames] for one in (dancer.joints_m, dancer.quats, dancer.hips_m)] for dancer in dance.dancers]
    library.write_seen(identity, dance, [common_errors_m(*one, estimator, times_s, on_person) for one in moved])


def unseen(library: Library) -> list[str]:
    """The dances that were not shown to the network."""
    return [identity for identity in library.identities() if library.dance(identity).seen is None]


def checked_sources(given: argparse.Namespace) -> tuple[dict[str, str | Said], Callable[[], DepthSource] | None]:
    """What may watch a learner, by what it is called on the page, and what opens the recording of --depth, if there is one.

    Raises InputError here, in the terminal, for what would fail in the page.
    """
    arguments.check_server("kpopnet teach", given.port)
    if given.depth is None:
        names = arguments.OF_RECORDINGS if given.live is not None else (*arguments.OF_RECORDINGS, "rotate")
        arguments.check_not_given(given, names, "for the recording of --depth")
    sources, open_recording = {SIMULATED: "a simulated learner", WEBCAM: DESCRIPTION}, None
    if given.depth is not None:
        open_recording = arguments.opener(given.depth, given, in_child=False)  # it must begin at once
        arguments.tell_assumed_rate(open_recording())
        sources = {RECORDING: Said("the recording {name}", name=named(given.depth).name)} | sources
    if given.live is not None:
        sources = {given.live: check_live(given.live, "--live")} | sources
    if given.checkpoint is not None:
        load_estimator(given.checkpoint)
    return sources, open_recording


def serve(given: argparse.Namespace) -> None:
    """Serves the page until the program is interrupted."""
    sources, open_recording = checked_sources(given)  # which also tells of a missing server library
    from kpopnet.teacher.hosting import host
    from kpopnet.teacher.server import Teaching, make_app
    from kpopnet.teacher.tries import Tries
    from synth.dances.live import FAULTS, SKILLS

    with locked(given.data):
        library = made_library(given.data)
    with shared_live(given.live) as opened:
        live = {given.live: opened} if opened else None
        open_camera = partial(open_source, open_recording, live=live, rotate_deg=given.rotate)
        teaching = Teaching(library, Tries(given.data / TRIES), open_camera, given.checkpoint, sources, SKILLS, FAULTS)
        host(partial(make_app, teaching, ready=True), given, "dance at")


def parsed() -> argparse.Namespace:
    parser = arguments.program_parser("kpopnet teach", __doc__)
    parser.add_argument("--data", type=Path, default=FOLDER, help="folder of dances and tries: %(default)s")
    parser.set_defaults(add=None, see=None)
    command = next((word for word in sys.argv[1:] if word in ("add", "see")), None)  # options may stand before it
    if command == "see":
        parser.add_argument("see", choices=["see"])
        return parser.parse_args()
    arguments.add_depth(parser)
    if command == "add":
        parser.add_argument("add", choices=["add"])
        files = "joints, depth, or a folder in the K-Pop format (docs/teaching.md); of a group, joints of each dancer"
        parser.add_argument("files", type=Path, nargs="+", metavar="file", help=files)
        parser.add_argument("--people", type=int, default=1, help="dancers in a recording of depth: %(default)s")
        parser.add_argument("--title", help="its name in the menu; by default the file's")
        parser.add_argument("--bpm", type=float, default=120.0, help="beats per minute, the first at the start: %(default)s")
        parser.add_argument("--from", type=float, default=0.0, dest="from_s", help="second at which it begins: %(default)s")
        parser.add_argument("--to", type=float, dest="to_s", help="second at which it ends; by default the end")
        arguments.add_grading(parser, "where the teacher's own dance has one")
        parser.add_argument("--joint-map", type=Path, metavar="FILE", help="JSON that names the points of each joint")
        parser.add_argument("--segmented", action="store_true", help="the depth shows one person, and 0 elsewhere")
        return parser.parse_args()
    arguments.add_address(parser, PORT)
    cameras = "; ".join(f"{name}: {told}" for name, told in LIVE_CAMERAS.items())
    parser.add_argument("--live", metavar="CAMERA", help=f"a camera that watches you. {cameras}")
    parser.add_argument("--depth", type=Path, help="a recording of depth that stands in for a camera")
    parser.add_argument("--checkpoint", help="network that estimates the pose; tracker for the tracker without a network")
    parser.add_argument("others", nargs="*", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.others:
        raise InputError(f"{given.others[0]}: kpopnet teach takes no file; kpopnet teach add FILE adds a dance")
    return given


@user_errors
def main() -> None:
    given = parsed()
    if given.see:
        see_dances(given)
    elif given.add:
        add_own(given)
    else:
        serve(given)


if __name__ == "__main__":
    main()
