"""The acceptance sheet: a scripted minute before a depth camera, and what a user of the joints would get from it.

    kpopnet check realsense                          tells you what to do, step by step, and watches (the extra realsense)
    kpopnet check realsense --empty 10               watches the empty room for ten minutes first
    kpopnet check minute.h5 --camera kinect_2        a recording of the script, fed image by image at its own times
    kpopnet check minute.h5 --as-fast                without waiting, and without delays: the same figures of the joints
    kpopnet check data/check_sim                     simulated films: python -m synth benchmark=check_sim
    kpopnet check realsense --out outputs/check      writes check.md, check.json and pictures of what went wrong

The script: 0 s the room is empty, 8 s come in, 14 s stand still, 21 s turn once around, 28 s raise both hands, 33 s sit down on
a chair, 42 s leave, 52 s come back, 60 s end. A recording begins with it. The camera stands still. One person takes part.
Joints come as in `kpopnet live`. docs/check.md says what each line means; exit code 0 whatever is missed.
"""

import argparse
import itertools
import time
from collections.abc import Iterator
from contextlib import closing, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from tqdm import tqdm

from kpopnet.camera import Camera
from kpopnet.datasets.check_script import END_S, SCRIPT, step_s
from kpopnet.datasets.protocol import BenchmarkConfig
from kpopnet.datasets.simulated import MANIFEST, SimulatedSet
from kpopnet.errors import InputError, check_between
from kpopnet.evaluation.acceptance.figures import figures, script_fault
from kpopnet.evaluation.acceptance.sheet import blocks, machine, moments, write
from kpopnet.evaluation.acceptance.watched import EMPTY_M2, IN_VIEW_M2, Kept, Truth, Watched, stored_truth, surfaces_m2
from kpopnet.evaluation.report import as_text
from kpopnet.pose import PersonPose, PoseEstimator
from kpopnet.programs.arguments import OF_RECORDINGS, add_depth, check_not_given, opener, program_parser, tell_assumed_rate
from kpopnet.runtime.compilation import announce_compilation
from kpopnet.runtime.endings import user_errors
from kpopnet.runtime.folder_lock import locked
from kpopnet.runtime.input_files import named
from kpopnet.runtime.untrusted import read_in_child
from kpopnet.skeleton import NUM_JOINTS
from kpopnet.sources import DepthSource
from kpopnet.sources.live import LIVE_CAMERAS, NewestImage, is_live, open_live, shared_live
from kpopnet.teacher.live.loop import (
    FRAME_PATIENCE_S,
    NOBODY_PATIENCE_S,
    STEADY_FRAMES,
    STEADY_S,
    CompiledKernels,
    Learners,
    load_estimator,
)
from kpopnet.tracker.refine import compile_refining

SIMULATED_SET, MEASURED = "check_sim", "measured"
READY_S = 8.0
"""Time to leave the camera's view before the script."""

MOST_WARM = 90
"""Images of a recording with which the estimator is made ready, at most."""

MOST_EMPTY_MIN = 120.0
TOLERANCE_S = 1.0
"""A recording may be so much shorter than the script."""


class PlayedCamera:
    """A recording whose images come at their own times; a `LiveCamera`.

    Attributes:
        times_s: by when an image was handed out, in seconds of `time.monotonic`, its time since the first one.
    """

    def __init__(self, source: DepthSource) -> None:
        self.camera, self.times_s = source.camera, {}
        self._images, self._ahead_s = source.timed(), None

    def read(self) -> tuple[np.ndarray, float] | None:
        """See `LiveCamera.read`. The image is unpacked before it is due."""
        image = next(self._images, None)
        if image is None:
            return None
        if self._ahead_s is None:
            self._first_s, self._ahead_s = image.time_s, time.monotonic() - image.time_s
        time.sleep(max(self._ahead_s + image.time_s - time.monotonic(), 0))
        taken = time.monotonic()
        self.times_s[taken] = image.time_s - self._first_s
        return image.depth_m, taken

    def close(self) -> None:
        self._images = iter(())  # the process that reads the file ends


class Answer(NamedTuple):
    """What the estimator answered to an image."""

    time_s: float  # when the image was taken
    delay_s: float  # from then until the answer; NaN where images did not come in real time
    processor_s: float  # processor time of this process for the answer
    depth_m: np.ndarray | None  # the image, (H, W) metres; None once it is collected
    people: list[PersonPose]  # all people who were found
    learner: PersonPose | None  # the main person, None if no person is


def answers(images: NewestImage, camera: Camera, estimator: PoseEstimator) -> Iterator[Answer]:
    """What a lesson would get of a camera: the answer to the newest image, again and again until there are no more images.

    Times are those of `time.monotonic`. Raises InputError if the camera fails.
    """
    learners, away = Learners(1), ""
    while True:
        image = images.fetch(FRAME_PATIENCE_S)
        if images.away != away:
            away = images.away
            print(away or "the camera is back", flush=True)
        if image is not None:
            before_s = time.process_time()
            people = estimator.update(image.depth_m, camera, image.taken)
            delay_s, processor_s = time.monotonic() - image.taken, time.process_time() - before_s
            yield Answer(
                image.taken, delay_s, processor_s, image.depth_m, people, *learners.choose(people, image.taken, begun=True)
            )
        elif images.ended:
            if images.error:
                raise InputError(images.error)
            return


def answers_as_fast(source: DepthSource, estimator: PoseEstimator) -> Iterator[Answer]:
    """The answers to every image of a recording, without waiting; times are since the first one."""
    learners, first_s = Learners(1), None
    for time_s, depth_m in source.timed():
        first_s, before_s = time_s if first_s is None else first_s, time.process_time()
        people = estimator.update(depth_m, source.camera, time_s)
        processor_s = time.process_time() - before_s
        yield Answer(time_s - first_s, np.nan, processor_s, depth_m, people, *learners.choose(people, time_s, begun=True))


class Collected:
    """The answers to the images of the script."""

    def __init__(self, camera: Camera) -> None:
        self._camera, self._answers, self._images = camera, [], {}

    def add(self, answer: Answer, script_s: float) -> None:
        """Adds the answer to an image that was taken at a time of the script."""
        if script_s >= 0 or answer.people:
            self._images[len(self._answers)] = Kept.of(answer.depth_m, self._camera)
        self._answers.append(answer._replace(time_s=script_s, depth_m=None))

    def watched(self, name: str, dropped: int, truth: Truth | None = None, fps: float = 0.0) -> Watched:
        """The run, once the script is over, with the truth, if it is known, of its images at `fps` a second.

        Raises InputError where the images end before the script, or none shows the empty room.
        """
        count, times_s = len(self._answers), np.array([one.time_s for one in self._answers])
        if count < 2 or times_s[-1] < END_S - TOLERANCE_S:
            found = f"{count} images of {times_s.max(initial=0):.1f} s"
            raise InputError(f"{name}: {found}; the script takes {END_S:g} s (kpopnet check --help)")
        if truth is None:
            numbers, empty_s = np.flatnonzero(times_s >= 0).tolist(), step_s("come in")[0]
            shows_room = times_s[numbers] < empty_s
            if not shows_room.any():
                raise InputError(f"{name}: no image came in the first {empty_s:g} s, which show the empty room; check again")
            surface_m2 = np.zeros(count)
            surface_m2[numbers] = surfaces_m2([self._images[one] for one in numbers], shows_room)
            in_view, empty, truth_m = surface_m2 >= IN_VIEW_M2, surface_m2 < EMPTY_M2, None
        else:
            rows = np.rint(times_s * fps).astype(int).clip(max=len(truth.in_view) - 1)
            in_view, empty, truth_m = truth.in_view[rows], truth.empty[rows], truth.joints_m[rows]
        missing_m = np.full((NUM_JOINTS, 3), np.nan, np.float32)
        run = Watched(
            name=name,
            kind=MEASURED if truth is None else truth.kind,
            times_s=times_s,
            delays_s=np.array([one.delay_s for one in self._answers]),
            processor_s=np.array([one.processor_s for one in self._answers]),
            received=count + dropped,
            joints_m=np.array([missing_m if one.learner is None else one.learner.joints_camera_m for one in self._answers]),
            people_m=[[person.joints_camera_m for person in one.people] for one in self._answers],
            in_view=in_view,
            empty=empty,
            images=self._images,
            truth_m=truth_m,
        )
        return replace(run, images={number: self._images[number] for number, _ in moments(run) if number in self._images})


def warm_up(source: DepthSource, estimator: PoseEstimator) -> None:
    """Compiles what the estimator needs, with images of a person who stands still, and has it forget them."""
    steady, warm, first_s, begin_s = 0, 0, None, step_s("stand still")[0]
    for time_s, depth_m in source.timed():
        first_s = time_s if first_s is None else first_s  # of any clock
        if time_s - first_s < begin_s:
            continue
        warm += 1
        before = time.monotonic()
        people = estimator.update(depth_m, source.camera, time_s)
        steady = steady + 1 if people and time.monotonic() - before < STEADY_S else 0
        if steady == STEADY_FRAMES or warm == MOST_WARM:
            break
    estimator.reset()


def check_recording(path: Path, given: argparse.Namespace, estimator: PoseEstimator) -> Watched:
    """Feeds a recording of the script to the estimator. Raises InputError where it is damaged or too short."""
    truth = read_in_child(stored_truth, path)
    if truth is not None:
        check_not_given(given, (*OF_RECORDINGS, "rotate"), "a simulated film states its own, in which its true joints are")
    source = opener(path, given, in_child=True)()
    tell_assumed_rate(source)
    warm_up(source, estimator)
    collected, dropped = Collected(source.camera), 0
    with tqdm(total=round(END_S), desc=named(path).name, unit="s", disable=None) as bar:
        if given.as_fast:
            for answer in itertools.takewhile(lambda one: one.time_s < END_S, answers_as_fast(source, estimator)):
                collected.add(answer, answer.time_s)
                bar.update(int(answer.time_s) - bar.n)
        else:
            camera = PlayedCamera(source)
            with closing(NewestImage(camera)) as images:
                for answer in answers(images, source.camera, estimator):
                    if (script_s := camera.times_s[answer.time_s]) >= END_S:
                        break
                    collected.add(answer, script_s)
                    bar.update(int(script_s) - bar.n)
                dropped = images.dropped
    return collected.watched(named(path).name, dropped, None if truth is None else Truth(*truth), source.fps)


def check_live(given: argparse.Namespace, address: str, estimator: PoseEstimator) -> Watched:
    """Tells a person what to do before a live camera, and watches. Raises InputError if the camera fails."""
    camera = open_live(address, given.rotate)
    collected, untold = Collected(camera.camera), list(SCRIPT)
    with closing(NewestImage(camera)) as images:
        stream = answers(images, camera.camera, estimator)
        print("put a chair about 3 m before the camera, and stand before it until you are found", flush=True)
        steady, is_found, began, kernels = 0, False, time.monotonic(), CompiledKernels()
        for answer in stream:
            is_found = bool(answer.people)
            steady = steady + 1 if is_found and answer.delay_s < STEADY_S else 0
            if steady == STEADY_FRAMES or time.monotonic() - began > NOBODY_PATIENCE_S + kernels.count:
                break
        print(
            f"{'you are found' if is_found else 'no person was found'}; leave the camera's view within {READY_S:g} s",
            flush=True,
        )
        longer_s = max(60 * given.empty - step_s("come in")[0], 0.0)
        start, dropped = time.monotonic() + READY_S + longer_s, images.dropped
        for answer in stream:
            script_s = answer.time_s - start
            if script_s < -longer_s:
                dropped = images.dropped
                continue
            while untold and script_s >= untold[0].start_s - (longer_s if untold[0] is SCRIPT[0] else 0):
                print(f"{untold[0].start_s:3.0f} s  {untold[0].name}: {untold[0].told}", flush=True)
                untold.pop(0)
            if script_s >= END_S:
                break
            collected.add(answer, script_s)
        dropped = images.dropped - dropped
    return collected.watched(given.source, dropped)


def checked(given: argparse.Namespace, address: str, estimator: PoseEstimator) -> tuple[list[Watched], bool]:
    """The runs of a live camera at this address, a recording or a simulated set, and whether they are simulated."""
    if is_live(given.source):
        return [check_live(given, address, estimator)], False
    path = Path(given.source)
    if not (path / MANIFEST).exists():
        run = check_recording(path, given, estimator)
        return [run], run.truth_m is not None
    films, runs = SimulatedSet(BenchmarkConfig(SIMULATED_SET, str(path))), []
    for number, name in enumerate(films.names, 1):
        print(f"film {number} of {len(films.names)}: {name}", flush=True)
        runs.append(check_recording(films.path(name), given, estimator))
    return runs, True


def parsed() -> argparse.Namespace:
    parser = program_parser("kpopnet check", __doc__)
    cameras = ", ".join(LIVE_CAMERAS)
    parser.add_argument("source", help=f"a live camera ({cameras}), a recording of depth, or a folder of simulated films")
    parser.add_argument("--out", type=Path, help="folder for check.md, check.json and check.png")
    parser.add_argument("--as-fast", action="store_true", help="feed a recording without waiting: no delays are measured")
    parser.add_argument("--empty", type=float, default=0.0, help="minutes for which a live camera watches the empty room first")
    add_depth(parser)
    return parser.parse_args()


@user_errors
def main() -> None:
    given = parsed()
    check_between("--empty", given.empty, 0, MOST_EMPTY_MIN)
    live = is_live(given.source)
    if live:
        check_not_given(given, OF_RECORDINGS, "a live camera states its own; it is for recordings")
    if (given.as_fast and live) or (given.empty and not live):
        raise InputError("--as-fast is for recordings, --empty for live cameras")
    estimator, machine_before = load_estimator(None), machine()
    announce_compilation(compile_refining)
    with locked(given.out) if given.out else nullcontext():
        with shared_live(given.source) as address:
            runs, is_simulated = checked(given, address, estimator)
        kinds = list(dict.fromkeys(run.kind for run in runs))
        found = {kind: figures([run for run in runs if run.kind == kind]) for kind in kinds}
        fed = "as fast as they are read: no delays" if given.as_fast else "in real time"
        before = "{processor}, {usable_cores} of {cores} cores, load {load:.1f}".format(**machine_before)
        about = {"source": given.source, "simulated": is_simulated, "as_fast": given.as_fast, "runs": len(runs)}
        faults = [f"{run.name}: {fault}" for run in runs if (fault := script_fault(run))]
        shown = blocks(named(Path(given.source)).name, is_simulated, found, [f"Images came {fed}; {before}.", *faults])
        print(as_text(shown))
        if given.out:
            written = write(given.out, shown, found, runs, about | {"machine": machine_before})
            print("wrote", ", ".join(map(str, written)))
