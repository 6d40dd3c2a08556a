"""Measures what a webcam's joints are worth to the score: MediaPipe's pose in the page, on colour films of SIMULATED learners.

    PYTHONPATH=. python tools/measure_webcam.py fit --write      # the noise of the table `kpopnet.dance.noise.table.NOISE`
    PYTHONPATH=. python tools/measure_webcam.py judge --figures results/webcam.json  # other dances and people

The pictures are given to the page's own module one by one with their times, so that a busy machine loses none. Every learner's
points are kept in a file: what was interrupted goes on, and other joints of these points need no new films. The dances are none
of the teacher's collection nor of the benchmarks; those who are judged are near the people of the benchmarks.
"""

import argparse
import base64
import functools
import hashlib
import http.server
import json
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
from tqdm import tqdm

from tools.graded_learners import FAULTS, on_body
from tools.measure_lessons import LEVELS
from tools.measure_noise import (
    Seen,
    against_truth,
    area,
    enter,
    lesson_score,
    measured,
    own_errors,
    scored_by_others,
    spread,
    spread_by_others,
    summary,
)

ROOT = Path(__file__).resolve().parents[1]
POSE = ROOT / "kpopnet/teacher/page/vendor/mediapipe/pose_landmark_lite.tflite"
sys.path.append(str(ROOT / "tests" / "helpers"))

from teacher_page import chromium  # noqa: E402
from webcam_films import FilmedLearner  # noqa: E402

from kpopnet.dance.joint_files.mediapipe import CAMERA, WEBCAM  # noqa: E402
from kpopnet.dance.performance import Performance  # noqa: E402
from kpopnet.data.made_sets import claim_folder  # noqa: E402
from kpopnet.networks import PASSES  # noqa: E402
from kpopnet.pose import PoseEstimator  # noqa: E402
from kpopnet.runtime.atomic_write import write_json, write_npz  # noqa: E402
from kpopnet.runtime.provenance import measured_by  # noqa: E402
from kpopnet.skeleton import NUM_JOINTS, Joint  # noqa: E402
from kpopnet.teacher.library import taught_dance  # noqa: E402
from kpopnet.teacher.live.loop import noise_of  # noqa: E402
from kpopnet.teacher.live.webcam import WebcamEstimator, read_seen  # noqa: E402
from kpopnet.weights import SHA256  # noqa: E402
from synth.dances.live import LATE_S  # noqa: E402
from synth.dances.taught import DANCES, Teacher, composed  # noqa: E402

SECONDS, STRIDE = 8.0, 2
"""Length of a learner's film, and of how many frames of the dance, 30 a second, one is filmed."""

FIT_DANCES, JUDGED_DANCES = range(DANCES, DANCES + 6), range(DANCES + 52, DANCES + 58)
NO_POINTS = np.full((33, 6), np.nan)
JUDGED = (("perfect", ""), ("perfect", "left arm"), *((level, "") for level in LEVELS))
FITTED = (*JUDGED, ("good", ""))
GRADED = (("arm", "15"), ("arms", "10"), ("forward", "15"), ("smaller", "15"))
"""One fault of known size each, of tools/graded_learners.py: degrees, or percent of the amplitude."""

FIND = """
const [picture, first, step_ms, done] = arguments;
import("/page/webcam.js").then(async ({ loadPose, pointsOf }) => {
  const pose = await loadPose(), image = new Image();
  if (first) await pose.anew();
  window.clock_ms = (window.clock_ms || 0) + step_ms;
  image.src = "data:image/jpeg;base64," + picture;
  await image.decode();
  const canvas = Object.assign(document.createElement("canvas"), { width: 640, height: 480 });
  canvas.getContext("2d").drawImage(image, 0, 0, 640, 480);
  done(pointsOf(await pose.find(canvas, window.clock_ms)));
}).catch((error) => done(String(error)));
"""
"""Finds the points of one picture as the page does of a webcam's."""


class Filmed(NamedTuple):
    """A learner of a dance: the teacher's dance, and the learner's true joints, those by webcam and those by depth."""

    dance: int
    teacher: Performance
    true: Performance
    webcam: Performance
    depth: Performance


class _Page(http.server.SimpleHTTPRequestHandler):
    """The files of the package's page and of its languages, at the addresses that the teacher's server gives them."""

    def translate_path(self, path: str) -> str:
        return super().translate_path(path if path.startswith("/languages/") else f"/teacher{path}")

    def log_message(self, *_: object) -> None:
        pass


@contextmanager
def webcam_page() -> Iterator:
    """A browser that shows a page from which `FIND` can be run."""
    handler = functools.partial(_Page, directory=str(ROOT / "kpopnet"))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server, chromium() as browser:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        browser.set_script_timeout(300)
        browser.get(f"http://127.0.0.1:{server.server_port}/page/vendor/")
        yield browser
        server.shutdown()


def points_in(browser, bgr: np.ndarray, first: bool, step_ms: float) -> list[list[float]]:
    """What the page says of a picture, as of `pointsOf` in page/webcam.js, `step_ms` milliseconds after the one before."""
    jpeg = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, 90])[1]
    points = browser.execute_async_script(FIND, base64.b64encode(jpeg.tobytes()).decode(), first, step_ms)
    if isinstance(points, str):
        raise RuntimeError(points)
    return points


def filmed(path: Path, dance: int, skill: str, fault: str, people_of: str, browser, depth: PoseEstimator) -> Filmed:
    """The learner of a file, which is made if it does not exist."""
    if not path.exists():
        made = Teacher().dance(dance)
        taught = taught_dance(made.name, made.fps, made.bpm, made.joints_m, made.quats, made.hips_m)
        # In a dance best and good are one person, all others differ but for graded ones; no person is in another dance.
        seed, quats, hips_m = 1000 * dance + len(skill + fault), made.quats, made.hips_m
        if (skill, fault) in GRADED:
            quats, hips_m = on_body(FAULTS[skill](composed(dance)[0], float(fault)))
            skill, fault = "perfect", ""
        learner = FilmedLearner(quats, hips_m, made.fps, skill, fault, seed=seed, people_of=people_of)
        frames = range(0, min(round(SECONDS * made.fps), len(learner)), STRIDE)
        depth.reset()
        found: dict[str, list] = {"true": [], "points": [], "depth": [], "depth_seen": []}
        for number in frames:
            time_s = number / made.fps
            bgr, true_m = learner.picture(number)
            found["true"].append(true_m)
            found["points"].append(points_in(browser, bgr, not number, 1000 * STRIDE / made.fps) or NO_POINTS)
            by_depth = depth.update(learner.frame(time_s), learner.camera, time_s)
            found["depth"].append(by_depth[0].joints_camera_m if by_depth else np.full((15, 3), np.nan))
            found["depth_seen"].append(by_depth[0].confidence if by_depth else np.zeros(15))
        arrays = {name: np.array(one, np.float32) for name, one in found.items()}
        write_npz(path, teacher=taught.joints_m[: frames.stop], times=np.array(frames) / made.fps, **arrays)
    with np.load(path) as stored:
        teacher = Performance(stored["teacher"], np.arange(len(stored["teacher"])) / 30)
        true, by_depth = (Performance(stored[name], stored["times"], stored.get(f"{name}_seen")) for name in ("true", "depth"))
        return Filmed(dance, teacher, true, by_webcam(stored["points"], stored["times"]), by_depth)


def by_webcam(points: np.ndarray, times_s: np.ndarray) -> Performance:
    """The dance that (T, 33, 6) points show, NaN where no person was found."""
    estimator, joints_m = WebcamEstimator(), np.full((len(points), NUM_JOINTS, 3), np.nan)
    confidence = np.zeros((len(points), NUM_JOINTS))
    for frame, (found, time_s) in enumerate(zip(points, times_s, strict=True)):
        seen = read_seen({"points": [] if np.isnan(found).any() else found.tolist(), "age_ms": 0.0})
        for person in estimator.update(seen.person, CAMERA, float(time_s)):
            joints_m[frame], confidence[frame] = person.joints_camera_m, person.confidence
    return Performance(joints_m, times_s, confidence, WEBCAM)


def all_filmed(
    folder: Path, dances: range, kinds: Sequence[tuple[str, str]], people_of: str, depth: PoseEstimator
) -> dict[str, list[Filmed]]:
    """The learners of each kind, one for each dance, near people of a split."""
    folder = folder / people_of
    weights = {name: digest for files in SHA256.values() for name, digest in files.items()}
    weights[POSE.name] = hashlib.sha256(POSE.read_bytes()).hexdigest()
    folder.mkdir(parents=True, exist_ok=True)
    claim_folder(folder, "*.npz", {"seconds": SECONDS, "stride": STRIDE, "passes": PASSES, **weights})
    found: dict[str, list[Filmed]] = {}
    with webcam_page() as browser, tqdm(total=len(dances) * len(kinds), unit="learner") as bar:
        for dance in dances:
            for kind in kinds:
                name = "_".join(kind).strip("_").replace(" ", "_")
                path = folder / f"{dance}_{name}.npz"
                found.setdefault(name, []).append(filmed(path, dance, *kind, people_of, browser, depth))
                bar.update()
    return found


def fit(learners: dict[str, list[Filmed]], write: bool) -> None:
    """Prints the noise of the joints by webcam, and enters it in the table."""
    faults = {"perfect": "perfect_0", "perfect_left_arm": "hanging_arm"}
    seen = [
        Seen(str(one.dance), faults.get(kind, kind), one.teacher, one.true, one.webcam)
        for kind, group in learners.items()
        for one in group
    ]
    scores = scored_by_others(seen, sees_depth=False)
    noise = measured([own_errors(one, sees_depth=False) for one in seen], sees_depth=False)
    noise = noise._replace(spread=round(spread(scores), 3))
    print(summary(seen, spread_by_others(seen, scores)))
    print(json.dumps({WEBCAM: noise._asdict()}, indent=1))
    if write:
        enter(WEBCAM, noise)


def judge(learners: dict[str, list[Filmed]], graded: dict[str, list[Filmed]], depth_noise: str) -> dict[str, Any]:
    """Prints joints and scores of other dances and people than were fitted."""
    everybody, figures = [one for group in learners.values() for one in group], {}
    for eye in ("webcam", "depth"):
        errors_m = np.concatenate([_about_torso(getattr(one, eye)) - _about_torso(one.true) for one in everybody])
        errors_m = np.linalg.norm(errors_m, axis=-1)
        seen = np.isfinite(errors_m)
        cm, near, shown = 100 * errors_m[seen].mean(), 100 * np.mean(errors_m[seen] < 0.1), 100 * seen.mean()
        figures[eye] = {"cm": float(cm), "within": float(near), "seen": float(shown)}
        print(f"{eye}: {cm:.1f} cm, {near:.0f} % within 10 cm, {shown:.0f} % seen")
    eyes = {
        "true": ("true", "none"),
        "webcam_unknown": ("webcam", "none"),
        "webcam": ("webcam", WEBCAM),
        "depth": ("depth", depth_noise),
    }
    truth = np.array([lesson_score(one.teacher, one.true, "none").similarity for one in everybody])
    for name, (eye, noise) in eyes.items():
        danced = {kind: [(one, getattr(one, eye)) for one in group] for kind, group in learners.items()}
        perfect = danced["perfect"]
        late = [(one, Performance(seen.joints_m, seen.times_s + LATE_S, seen.confidence)) for one, seen in perfect]
        danced |= {kind: [(one, getattr(one, eye)) for one in group] for kind, group in graded.items()}
        another = [(one, seen) for one, _ in perfect for other, seen in perfect if other is not one]
        danced |= {"another dance": another, "late": late}
        scored = {kind: [lesson_score(one.teacher, seen, noise) for one, seen in pairs] for kind, pairs in danced.items()}
        points = {kind: [one.similarity for one in group] for kind, group in scored.items()}
        levels = np.array([points[level] for level in LEVELS])
        pairs = [levels[i] > levels[j] for i in range(len(LEVELS)) for j in range(i + 1, len(LEVELS))]
        figures.setdefault(name, {}).update(against_truth([one for kind in learners for one in scored[kind]], truth))
        figures[name] |= {
            "pairs_in_order": int(np.sum(pairs)),
            "pairs": int(np.size(pairs)),
            "auc": {kind: area(points["perfect"], points[kind]) for kind in (*graded, "perfect_left_arm")},
            "scores": {kind: [float(f(one)) for f in (np.mean, min, max)] for kind, one in points.items()},
        }
        told = {key: value for key, value in figures[name].items() if key not in ("scores", "auc")}
        print(name, ", ".join(f"{key} {value:.2f}" for key, value in told.items()))
        for kind, (mean, least, greatest) in figures[name]["scores"].items():
            auc = figures[name]["auc"].get(kind)
            print(f"  {kind:18s} {mean:5.1f} ({least:.0f} to {greatest:.0f})" + ("" if auc is None else f", AUC {auc:.2f}"))
    return figures


def _about_torso(dance: Performance) -> np.ndarray:
    """(T, 14, 3) where the other joints are from the torso, metres."""
    return np.delete(dance.joints_m - dance.joints_m[:, [Joint.TORSO]], Joint.TORSO, axis=1)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("do", choices=("fit", "judge"))
    parser.add_argument("--folder", type=Path, default=Path("outputs/webcam"), help="of the learners' joints: %(default)s")
    parser.add_argument("--dances", type=int, default=6, help="how many: %(default)s")
    parser.add_argument("--write", action="store_true", help="enter the noise in the table")
    parser.add_argument("--figures", type=Path, help="a JSON file for the figures of judge, as those of results/")
    given = parser.parse_args()
    depth = PoseEstimator.load()
    if given.do == "fit":
        fit(all_filmed(given.folder, FIT_DANCES[: given.dances], FITTED, "train", depth), given.write)
    else:
        learners, graded = (
            all_filmed(given.folder, JUDGED_DANCES[: given.dances], kinds, "benchmark", depth) for kinds in (JUDGED, GRADED)
        )
        figures = judge(learners, graded, noise_of(depth))
        if given.figures:
            about = {"what": "SIMULATED learners in colour", "learners": sum(map(len, learners.values()))}
            write_json(given.figures, about | measured_by() | figures)


if __name__ == "__main__":
    main()
