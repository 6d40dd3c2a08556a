"""How well the dance teacher keeps up with a camera of 30 images a second: two sizes of image, tracker and network; a webcam.

The camera is a recording of a simulated learner, made beforehand and played in real time, so that no rendering is measured.
With Chromium, chromedriver and selenium the page is open, and its own figures are told too: from the moment at which an image
is taken to the page's next drawing after its score has come. (The page's clock of the dance begins a few milliseconds before
the stage's, so its figures are at most that much too high. A browser without a graphics card draws the teacher on the
processor: the load is higher than in front of a user's screen.)
"""

import importlib.util
import itertools
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from teacher_page import BROWSER, DRIVER, chromium, served
from webcam_films import FilmedLearner, write_film

from kpopnet.camera import Camera
from kpopnet.dance.joint_files.mediapipe import WEBCAM
from kpopnet.programs.teach import CAMERA_FPS, RECORDING, open_source
from kpopnet.sources import DepthSource, open_depth
from kpopnet.teacher.library import Library, TeacherBody, taught_dance
from kpopnet.teacher.live.webcam import DESCRIPTION
from kpopnet.teacher.server import Teaching
from kpopnet.teacher.tries import Tries
from synth.body.teacher import teacher_arrays
from synth.dances.live import LiveLearner
from synth.dances.taught import Teacher
from tests.speed.common import Figures

SECONDS, PATIENCE_S = 20.0, 300.0
SIZES = ((320, 240), (640, 480))
ESTIMATORS = {"tracker": "tracker", "network": None}
FOV_DEG = 58.5
DANCE = "dance_001"

HOOK = """
window.seen = { frames_ms: [], verdicts_ms: [] };
let start = Infinity;
const since = (time_s) => performance.now() - start - 1000 * time_s;
const drawn = (list, time_s) => requestAnimationFrame(() => list.push(since(time_s)));
window.WebSocket = class extends WebSocket {
  constructor(...given) {
    super(...given);
    this.addEventListener("message", ({ data }) => {
      const text = typeof data === "string" ? data
        : new TextDecoder().decode(new Uint8Array(data, 4, new DataView(data).getUint32(0, true)));
      const { kind, time_s, end_s } = JSON.parse(text);
      if (kind === "frame" && time_s !== null) drawn(seen.frames_ms, time_s);
      if (kind === "verdict") drawn(seen.verdicts_ms, end_s);
    });
  }
  send(text) {
    const { do: what, in_s } = JSON.parse(text);
    if (what === "go") start = performance.now() + 1000 * in_s;
    super.send(text);
  }
};
"""
"""Notes how many milliseconds after its image each score is drawn, and after its move each verdict."""


def measure() -> Figures:
    """A lesson of a perfect learner for each size of image and each estimator."""
    if not (BROWSER and DRIVER and importlib.util.find_spec("selenium")):
        print("no Chromium with chromedriver and selenium: the teacher is not measured")
        return {}
    figures: Figures = {}
    with tempfile.TemporaryDirectory() as folder:
        library = _library(Path(folder))
        for size, (name, checkpoint) in itertools.product(SIZES, ESTIMATORS.items()):
            recording = _recording(library, size, Path(folder))
            notes, page = _lesson(library, {RECORDING: "a recording"}, partial(open_source, recording), checkpoint)
            figures |= _figures(f"{size[0]}x{size[1]}_{name}", notes, page)
        webcam = _lesson(library, {WEBCAM: DESCRIPTION}, partial(open_source, None), None, _film(library, Path(folder)))
    fps = [value for name, (value, *_) in figures.items() if name.endswith(".fps")]
    late = [value for name, (value, *_) in figures.items() if name.endswith(".latency_ms_p95")]
    figures["teacher.fps"] = (min(fps), "images scored/s", "the least of all sizes and estimators")
    figures["teacher.latency_ms_p95"] = (max(late), "ms, image to score on the page", "the most of all sizes and estimators")
    return figures | _figures(WEBCAM, *webcam)


def _library(folder: Path) -> Library:
    """The first SECONDS of one dance."""
    library, one = Library(folder, TeacherBody(**teacher_arrays())), Teacher().dance(1)
    part = slice(round(SECONDS * one.fps))
    library.write(DANCE, taught_dance(one.name, one.fps, one.bpm, one.joints_m[part], one.quats[part], one.hips_m[part]))
    return library


def _recording(library: Library, size: tuple[int, int], folder: Path) -> Callable[[], DepthSource]:
    """What a camera of this size sees of a person who dances perfectly; made once."""
    path, camera = folder / f"{size[0]}.npy", Camera.from_fov(FOV_DEG, *size)
    if not path.exists():
        dance = library.dance(DANCE)
        learner = LiveLearner(dance.quats, dance.hips_m, dance.fps, "perfect", camera=camera)
        frames = round((SECONDS + 1) * CAMERA_FPS)
        stored = np.lib.format.open_memmap(path, "w+", np.uint16, (frames, size[1], size[0]))
        for number in range(frames):
            stored[number] = np.round(1000 * learner.frame(number / CAMERA_FPS))
        stored.flush()
    return partial(open_depth, path, camera, CAMERA_FPS)


def _film(library: Library, folder: Path) -> Path:
    """What a webcam sees of a person who dances perfectly, when it begins with the dance."""
    dance = library.dance(DANCE)
    learner = FilmedLearner(dance.quats, dance.hips_m, dance.fps, "perfect", seed=61)
    frames = range(0, min(round((SECONDS + 1) * dance.fps), len(learner)), round(dance.fps / CAMERA_FPS))
    write_film(folder / "film.mjpeg", learner, frames)
    return folder / "film.mjpeg"


def _lesson(
    library: Library,
    sources: dict[str, str],
    open_camera: Callable,
    checkpoint: str | None,
    webcam: Path | None = None,
) -> tuple[dict, dict]:
    """Holds a lesson with the page open; the notes of its result, and what the page noted. `webcam` is the browser's film."""
    with tempfile.TemporaryDirectory() as folder:
        teaching = Teaching(library, Tries(Path(folder)), open_camera, checkpoint, sources, ("perfect",), ("",))
        with served(teaching) as address, chromium(webcam=webcam) as driver:
            driver.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": HOOK})
            driver.get(f"{address}#/dance/{DANCE}?go&speed=100")
            until = time.monotonic() + PATIENCE_S
            while "/try/" not in driver.current_url:
                if time.monotonic() > until:
                    raise RuntimeError(f"the lesson did not end: {driver.find_element('id', 'error').text}")
                time.sleep(0.5)
            page = driver.execute_script("return seen")
            return teaching.tries.result(DANCE, driver.current_url.rpartition("/")[2])["notes"], page


def _figures(case: str, notes: dict, page: dict) -> Figures:
    ages_ms, verdicts_ms = (np.array(page[name], float) for name in ("frames_ms", "verdicts_ms"))
    against = f"{notes['dropped']} images of 30 a second dropped"
    stage, shown = "at the stage", f"at the stage {notes['age_ms_median']:.0f} and {notes['age_ms_p95']:.0f}"
    told = f"{len(verdicts_ms)} moves, {stage} {notes['verdict_ms_median']:.0f} and {notes['verdict_ms_p95']:.0f}"
    return {
        f"teacher.{case}.fps": (notes["fps"], "images scored/s", against),
        f"teacher.{case}.dropped": (notes["dropped"], "images", f"of {notes['frames'] + notes['dropped']}"),
        f"teacher.{case}.latency_ms": (float(np.median(ages_ms)), "ms, image to page", shown),
        f"teacher.{case}.latency_ms_p95": (float(np.percentile(ages_ms, 95)), "ms, image to page", shown),
        f"teacher.{case}.verdict_ms": (float(np.median(verdicts_ms)), "ms, move to page", told),
        f"teacher.{case}.verdict_ms_p95": (float(np.percentile(verdicts_ms, 95)), "ms, move to page", told),
    }
