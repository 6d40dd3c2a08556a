"""Estimates the joints of people in a recording of depth, and shows them.

    kpopnet predict depth/ --camera kinect_v1 --out outputs/ann           # a folder of 16-bit PNG or TIFF images
    kpopnet predict dance.npz --people 2 --format npz bvh csv             # the file states its camera
    kpopnet predict dance.h5 --key depth --fov 70.6 --fps 30
    kpopnet predict dance.mkv --camera intrinsics.json --mode realtime    # FFV1; needs the extra video
    kpopnet predict dance.bag --gif                                       # ROS or RealSense; needs the extra ros or realsense
    kpopnet predict 71de12f9/ --rotate 90                                 # Stray Scanner on an iPhone held upright

People are looked for in every single image, in any pose; the camera may move.
The folder then holds

    joints.npz, joints.json ...   the main person's joints, times and confidence; joints_2.npz ... of others (--people)
    overlay.png, overlay.mp4      skeletons over the depth; --gif adds overlay.gif
    view.html                     joints and depth in 3D, for any browser

What the files hold, and the other kinds of recordings: docs/predicting.md. `kpopnet score` reads the joints.
"""

import argparse
import contextlib
import itertools
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from tqdm import tqdm

from kpopnet.dance.joint_files.writing import SUFFIXES, write_performance
from kpopnet.dance.performance import MAX_DURATION_S, Performance
from kpopnet.errors import InputError
from kpopnet.pose import PersonPose, PoseEstimator
from kpopnet.pose.estimator import MAX_PEOPLE
from kpopnet.programs.arguments import add_depth, opener, program_parser, tell_assumed_rate
from kpopnet.runtime.atomic_write import remove_unfinished, write_whole
from kpopnet.runtime.compilation import announce_compilation
from kpopnet.runtime.endings import user_errors
from kpopnet.runtime.folder_lock import locked
from kpopnet.runtime.input_files import named
from kpopnet.sources import DepthSource
from kpopnet.sources.source import TimedDepth
from kpopnet.tracker.refine import compile_refining
from kpopnet.viz import overlay
from kpopnet.viz.drawing import save_png
from kpopnet.viz.view_page import Shown, cloud_frames, sampled_cloud, view_page

FORMATS = tuple(suffix[1:] for suffix in SUFFIXES)
SHEET_TILES = 12

SINCE_1970_S = 1e9
"""Later times are seconds since 1970, which have been more since 2001."""


def parsed() -> argparse.Namespace:
    parser = program_parser("kpopnet predict", __doc__)
    parser.add_argument("path", type=Path, help="folder of images, or file: .npz, .npy, .h5, .mkv, .bag, .mcap, .r3d, ...")
    parser.add_argument("--out", type=Path, default=Path("outputs/predict"), help="folder of the results: %(default)s")
    parser.add_argument("--format", nargs="+", choices=FORMATS, default=["npz", "json"], help="of the joints: %(default)s")
    add_depth(parser)
    parser.add_argument("--people", type=int, default=1, help="largest number of people: %(default)s")
    parser.add_argument("--mode", choices=("realtime", "best"), default="best", help="best is slower: %(default)s")
    parser.add_argument("--segmented", action="store_true", help="the depth shows one person, and 0 elsewhere")
    parser.add_argument("--checkpoint", type=Path, help="another network than the one that comes with the package")
    parser.add_argument("--gif", action="store_true", help="write overlay.gif too")
    return parser.parse_args()


def estimated(
    source: DepthSource, estimator: PoseEstimator, segmented: bool
) -> tuple[list[PersonPose], np.ndarray, InputError | None]:
    """The people of a recording, the main person first; the (T,) times of its images in seconds, from the first image on where
    they are since 1970; and why no more was read, where it is damaged after its first images or lasts too long.

    Raises InputError if the first image cannot be read or is no depth, the recording says that it is too long, or it is empty.
    """
    if source.frames is not None and source.frames / source.fps > MAX_DURATION_S:
        raise InputError(f"{source.name}: {source.frames:,} images last more than {MAX_DURATION_S:g} s; cut it into parts")
    times_s, start_s, fault = [], 0.0, None

    def images() -> Iterator[TimedDepth]:
        nonlocal start_s, fault
        try:
            for image in tqdm(source.timed(), "joints", source.frames, unit=" images", disable=None):
                if not times_s and image.time_s > SINCE_1970_S:
                    start_s = image.time_s
                image = image._replace(time_s=image.time_s - start_s)
                if abs(image.time_s) > SINCE_1970_S or (times_s and image.time_s - times_s[0] > MAX_DURATION_S):
                    raise InputError(
                        f"{source.name}: an image at {image.time_s:g} s; expected times in seconds from 0, of at most "
                        f"{MAX_DURATION_S:g} s in all; --fps overrides them"
                    )
                times_s.append(image.time_s)
                yield image
        except InputError as error:
            if not times_s:
                raise
            fault = error

    people = estimator.estimate(images(), source.camera, source.fps, segmented=segmented)
    return people, np.array(times_s), fault


def draw(source: DepthSource, people: Sequence[PersonPose], times_s: np.ndarray, out: Path, gif: bool) -> list[Path]:
    """Writes overlays and page in a second pass over the recording, which may have grown since, and returns their paths."""
    frames = len(times_s)
    tiled = set(np.linspace(0, frames - 1, min(SHEET_TILES, frames)).round().astype(int).tolist())
    in_page, in_gif = cloud_frames(frames), range(0, frames, -(-frames // overlay.MOST_GIF_FRAMES))
    tiles, pictures, clouds = [], [], []

    def overlays() -> Iterator[np.ndarray]:
        images = itertools.islice(source, frames)
        for number, depth_m in enumerate(tqdm(images, "pictures", frames, unit=" images", disable=None)):
            joints_m = [person.joints_camera_m[number] for person in people]
            image = overlay.overlay_image(depth_m, source.camera, joints_m, overlay.VIDEO_WIDTH_PX)
            if number in tiled:
                tiles.append((f"image {number}, {times_s[number]:.2f} s", image))
            if gif and number in in_gif:
                pictures.append(overlay.resized(image, overlay.GIF_WIDTH_PX))
            if number in in_page:
                clouds.append(sampled_cloud(number, depth_m, source.camera, joints_m, len(in_page)))
            yield image

    overlay.write_video(out / "overlay.mp4", overlays(), source.fps)
    counted = f"{len(people)} {'person' if len(people) == 1 else 'people'}, {frames} {'image' if frames == 1 else 'images'}"
    title = f"{named(Path(source.name)).name}: {counted}"
    save_png(out / "overlay.png", overlay.overlay_sheet(tiles, title))
    labels = [f"{number}" if len(people) > 1 else "" for number in range(1, len(people) + 1)]
    shown = [Shown(one.joints_camera_m, one.confidence, label) for one, label in zip(people, labels, strict=True)]
    page = view_page(title, source.camera, times_s, shown, clouds)
    write_whole(out / "view.html", page)
    written = [out / "overlay.png", out / "overlay.mp4", out / "view.html"]
    if gif:
        overlay.save_gif(out / "overlay.gif", pictures, in_gif.step / source.fps)
        written.append(out / "overlay.gif")
    return written


def joints_path(out: Path, number: int, name: str) -> Path:
    """Where the joints of a person, from 1, are written in a format."""
    return out / f"joints{'' if number == 1 else f'_{number}'}.{name}"


def write_joints(people: Sequence[PersonPose], times_s: np.ndarray, out: Path, formats: Sequence[str]) -> list[Path]:
    """Writes the joints of each person in each format, and returns the paths."""
    written = []
    for number, person in enumerate(people, 1):
        performance = Performance(person.joints_camera_m, times_s, person.confidence)
        for name in formats:
            path = joints_path(out, number, name)
            try:
                write_performance(path, performance)
            except InputError as error:
                print(f"{path} is not written: {error}", file=sys.stderr)
            else:
                written.append(path)
    return written


@user_errors
def main() -> None:
    given = parsed()
    if given.segmented and given.people > 1:
        raise InputError(f"--people {given.people}: --segmented is for depth that shows one person")
    source = opener(given.path, given, in_child=True)()
    estimator = PoseEstimator.load(given.checkpoint, given.mode, given.people)
    announce_compilation(compile_refining)
    with locked(given.out):
        for name in ("joints", "overlay", "view"):  # of a run that was killed
            remove_unfinished(given.out, f".{name}*.tmp")
        people, times_s, fault = estimated(source, estimator, given.segmented)
        for number, name in itertools.product(range(1, MAX_PEOPLE + 1), FORMATS):  # of another recording
            joints_path(given.out, number, name).unlink(missing_ok=True)
        for name in ("overlay.png", "overlay.mp4", "overlay.gif", "view.html"):
            with contextlib.suppress(OSError):  # told where it is to be written, after the joints
                (given.out / name).unlink()
        written = write_joints(people, times_s, given.out, given.format)  # before the pictures, which may be interrupted
        pictures = draw(source, people, times_s, given.out, given.gif)
        if not people:
            raise InputError(f"{given.path}: no person was found; look at {given.out / 'overlay.png'}")
    tell_assumed_rate(source)
    for number, person in enumerate(people, 1):
        known = (person.confidence > 0).any(axis=1)
        mean = person.confidence[known].mean()
        print(f"person {number}: in {known.sum()} of {len(known)} images, mean confidence {mean:.2f}")
    print("wrote", ", ".join(map(str, [*written, *pictures])))
    print(f"look at {given.out / 'overlay.png'}, and open {given.out / 'view.html'} in a browser")
    if fault is not None:
        raise InputError(f"{fault}; written is what the {len(times_s):,} images before it show")
