"""Pictures and a film of everybody: depth with a skeleton in a colour for each identity, and the true ones thin and white."""

from collections.abc import Iterator

import numpy as np

from kpopnet.camera import MM_PER_METRE
from kpopnet.datasets.simulated import PeopleSequence
from kpopnet.evaluation.people.matching import MatchedSequence
from kpopnet.viz.drawing import Style, depth_rgb, draw_skeleton, enlarged, sheet, with_captions

COLUMNS = 6
TILE_WIDTH_PX = 280
VIDEO_WIDTH_PX = 640

TRUTH = Style("true joints", *[(255, 255, 255)] * 3, width_px=1, filled=False)
_COLOURS = ((235, 60, 60), (70, 130, 255), (60, 190, 80), (240, 170, 30), (190, 90, 230), (40, 200, 210))


def style(identity: int) -> Style:
    """The style of an identity; colours repeat after six."""
    return Style(f"identity {identity}", *[_COLOURS[identity % len(_COLOURS)]] * 3, width_px=2, filled=True)


def frame_image(sequence: PeopleSequence, matched: MatchedSequence, frame: int, width_px: int) -> np.ndarray:
    """RGB image of one frame with a line that says who is judged and how far off."""
    image = enlarged(depth_rgb(sequence.depth_mm[frame] / np.float32(MM_PER_METRE)), width_px)
    for identity, joints_m in zip(matched.identities, matched.estimates_m[:, frame], strict=True):
        draw_skeleton(image, joints_m, sequence.camera, style(int(identity)))
    for person_m in sequence.joints_camera_m[frame]:
        draw_skeleton(image, person_m, sequence.camera, TRUTH)
    states = []
    for person in range(matched.seen.shape[1]):
        errors_m = matched.errors_m[frame, person]
        found = errors_m[np.isfinite(errors_m)]
        error = f"{100 * found.mean():.0f} cm" if len(found) else "not found"
        sight = "hidden, " if matched.hidden[frame, person] else ""
        states.append(sight + error if matched.seen[frame, person] or matched.hidden[frame, person] else "not in view")
    return with_captions(image, (f"{sequence.name} frame {frame}: {'; '.join(states)}",))


def row(sequence: PeopleSequence, matched: MatchedSequence) -> tuple[str, list[np.ndarray]]:
    """Evenly spaced frames of a sequence, for a sheet."""
    frames = np.linspace(0, len(matched.seen) - 1, COLUMNS + 1).round().astype(int)[1:].tolist()
    tiles = [frame_image(sequence, matched, frame, TILE_WIDTH_PX) for frame in frames]
    return f"{sequence.name}: {sequence.kind}", tiles


def people_sheet(rows: list[tuple[str, list[np.ndarray]]], title: str) -> np.ndarray:
    """RGB sheet of `row`s with a legend."""
    return sheet(rows, (), title + "; white: true joints, a colour for each identity")


def film(sequence: PeopleSequence, matched: MatchedSequence, step: int) -> Iterator[np.ndarray]:
    """Every `step`-th frame as an RGB image of even width and height."""
    for frame in range(0, len(matched.seen), step):
        image = frame_image(sequence, matched, frame, VIDEO_WIDTH_PX)
        yield image[: len(image) // 2 * 2]
