"""Pictures of depth and skeletons, for reports, training logs and contact sheets. Images are (H, W, 3) uint8 RGB."""

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from kpopnet.camera import Camera
from kpopnet.errors import InputError
from kpopnet.replacing import replacing
from kpopnet.skeleton import BONES, JOINT_NAMES

BACKGROUND = (24, 24, 28)
NEAREST_GREY, FARTHEST_GREY = 215, 75
TEXT = (235, 235, 235)
TEXT_HEIGHT_PX = 18
_SUBPIXEL_BITS = 4  # cv2 draws lines between points given in sixteenths of a pixel


@dataclass(frozen=True)
class Style:
    """How one of several skeletons in a picture is told from the others. Right and left are the person's."""

    name: str
    right: tuple[int, int, int]
    left: tuple[int, int, int]
    middle: tuple[int, int, int]
    width_px: int
    filled: bool

    def colour(self, *joints: int) -> tuple[int, int, int]:
        names = [JOINT_NAMES[joint] for joint in joints]
        if any(name.startswith("right") for name in names):
            return self.right
        return self.left if any(name.startswith("left") for name in names) else self.middle


TRUE = Style("true", right=(255, 190, 110), left=(120, 225, 255), middle=(255, 255, 255), width_px=2, filled=False)
ESTIMATED = Style("estimated", right=(225, 25, 45), left=(25, 70, 240), middle=(20, 150, 40), width_px=3, filled=True)


def depth_picture(depth_m: np.ndarray) -> np.ndarray:
    """(H, W) metres to RGB: near is light, far is dark grey, nothing measured is nearly black.

    The greys span what the middle 98 % of the image's pixels span, and at least 0.4 m.
    """
    measured = depth_m > 0
    picture = np.full((*depth_m.shape, 3), BACKGROUND, np.uint8)
    if measured.any():
        near, far = np.percentile(depth_m[measured], (1, 99))
        far = max(far, near + 0.4)
        share = np.clip((depth_m[measured] - near) / (far - near), 0, 1)
        picture[measured] = (NEAREST_GREY + (FARTHEST_GREY - NEAREST_GREY) * share).astype(np.uint8)[:, None]
    return picture


def probability_picture(probability: np.ndarray) -> np.ndarray:
    """(H, W) values in 0..1 to RGB, for ridge images and heatmaps: black through orange to white."""
    coloured = cv2.applyColorMap((np.clip(probability, 0, 1) * 255).astype(np.uint8), cv2.COLORMAP_HOT)
    return cv2.cvtColor(coloured, cv2.COLOR_BGR2RGB)


def draw_skeleton(picture: np.ndarray, joints_camera_m: np.ndarray, camera: Camera, style: Style) -> None:
    """Draws (15, 3) joints in metres into the picture; joints that are missing or not before the camera are left out.

    The picture may be larger than the camera's image, by one factor for width and height.
    """
    scale = picture.shape[1] / camera.width
    uvz = camera.project(joints_camera_m)
    drawable = np.isfinite(uvz).all(axis=-1) & (uvz[..., 2] > 0) & (np.abs(uvz[..., :2]) < 1e5).all(axis=-1)
    # A pixel's centre lies at a whole coordinate: at u in the small picture, at (u + 0.5) scale - 0.5 in the large.
    at = np.where(drawable[:, None], (uvz[:, :2] + 0.5) * scale - 0.5, 0)
    at = np.round(at * 2**_SUBPIXEL_BITS).astype(int)
    for parent, child in BONES:
        if drawable[parent] and drawable[child]:
            ends = tuple(at[parent].tolist()), tuple(at[child].tolist())
            cv2.line(picture, *ends, style.colour(parent, child), style.width_px, cv2.LINE_AA, _SUBPIXEL_BITS)
    radius = (style.width_px + 1) * 2**_SUBPIXEL_BITS
    for joint in np.flatnonzero(drawable):
        thickness = -1 if style.filled else 1
        centre = tuple(at[joint].tolist())
        cv2.circle(picture, centre, radius, style.colour(joint), thickness, cv2.LINE_AA, _SUBPIXEL_BITS)


def person_view(
    depth_m: np.ndarray, camera: Camera, joints_camera_m: tuple[np.ndarray, ...] = (), margin: float = 0.06
) -> tuple[np.ndarray, Camera]:
    """The square part of the image around the silhouette and the joints, and its camera.

    Outside the image nothing is measured. Without a silhouette and joints it is the whole image.
    """
    rows, columns = np.nonzero(depth_m)
    points = [np.stack([columns, rows], axis=1).astype(float)]
    points += [camera.project(joints)[:, :2] for joints in joints_camera_m]
    uv = np.concatenate(points)
    uv = uv[np.isfinite(uv).all(axis=1)]
    inside = (np.abs(uv - [camera.cx, camera.cy]) < [camera.width, camera.height]).all(axis=1)
    uv = uv[inside] if inside.any() else np.array([[0, 0], [camera.width - 1, camera.height - 1]], float)
    low, high = uv.min(axis=0), uv.max(axis=0)
    side = max(8, int(np.ceil((high - low).max() * (1 + 2 * margin))))
    x0, y0 = np.round((low + high) / 2 - side / 2).astype(int).tolist()
    view = np.zeros((side, side), np.float32)
    height, width = depth_m.shape
    top, bottom, left, right = max(y0, 0), min(y0 + side, height), max(x0, 0), min(x0 + side, width)
    if top < bottom and left < right:
        view[top - y0 : bottom - y0, left - x0 : right - x0] = depth_m[top:bottom, left:right]
    return view, camera.cropped(x0, y0, side, side)


def person_tile(
    depth_m: np.ndarray,
    camera: Camera,
    skeletons: tuple[tuple[np.ndarray, Style], ...],
    side_px: int = 288,
    captions: tuple[str, ...] = (),
) -> np.ndarray:
    """A square picture of one person with skeletons over the depth, first ones below, and lines of text under it.

    Args:
        depth_m: (H, W) metres.
        camera: its camera.
        skeletons: (15, 3) joints in metres with the style to draw them in.
        side_px: width of the picture.
        captions: lines of plain ASCII.
    """
    view, view_camera = person_view(depth_m, camera, tuple(joints for joints, _ in skeletons))
    picture = enlarged(depth_picture(view), side_px)
    for joints, style in skeletons:
        draw_skeleton(picture, joints, view_camera, style)
    return with_captions(picture, captions)


def enlarged(picture: np.ndarray, width_px: int) -> np.ndarray:
    """The picture at another width, its pixels left square and sharp."""
    height_px = round(picture.shape[0] * width_px / picture.shape[1])
    return cv2.resize(picture, (width_px, height_px), interpolation=cv2.INTER_NEAREST)


def with_captions(picture: np.ndarray, captions: tuple[str, ...]) -> np.ndarray:
    """The picture with lines of text below it, on a plain ground, shrunk where they would not fit."""
    ground = np.full((TEXT_HEIGHT_PX * len(captions), picture.shape[1], 3), BACKGROUND, np.uint8)
    for line, text in enumerate(captions):
        write(ground, text, (4, TEXT_HEIGHT_PX * (line + 1) - 5))
    return np.concatenate([picture, ground])


def write(picture: np.ndarray, text: str, left_bottom: tuple[int, int], colour: tuple[int, int, int] = TEXT) -> int:
    """Writes a line of text into the picture, smaller where it would run out of it; returns its width in pixels."""
    room = picture.shape[1] - left_bottom[0] - 4
    size = 0.42
    width = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, size, 1)[0][0]
    size *= min(1.0, room / max(width, 1))
    cv2.putText(picture, text, left_bottom, cv2.FONT_HERSHEY_SIMPLEX, size, colour, 1, cv2.LINE_AA)
    return min(width, room)


def legend(styles: tuple[Style, ...], width_px: int) -> np.ndarray:
    """A strip that says which colour is which."""
    strip = np.full((TEXT_HEIGHT_PX + 6, width_px, 3), BACKGROUND, np.uint8)
    x = 6
    for style in styles:
        for side, colour in (("right", style.right), ("left", style.left), ("middle", style.middle)):
            y = strip.shape[0] // 2
            cv2.line(strip, (x, y), (x + 22, y), colour, style.width_px, cv2.LINE_AA)
            cv2.circle(strip, (x + 11, y), style.width_px + 1, colour, -1 if style.filled else 1, cv2.LINE_AA)
            x += 28
            x += write(strip, f"{style.name}, {side}", (x, strip.shape[0] - 8)) + 14
    return strip


def sheet(
    rows: list[tuple[str, list[np.ndarray]]], styles: tuple[Style, ...] = (), title: str = "", gap_px: int = 6
) -> np.ndarray:
    """Tiles in titled rows, with a title and a legend above.

    Args:
        rows: title (may be empty) and pictures of each row; all pictures of a row are equally high.
        styles: what the legend names.
        title: the sheet's own.
        gap_px: between pictures.
    """
    bands = []
    for row_title, tiles in rows:
        spacer = np.full((tiles[0].shape[0], gap_px, 3), BACKGROUND, np.uint8)
        band = np.concatenate([part for tile in tiles for part in (spacer, tile)] + [spacer], axis=1)
        bands.append((row_title, band))
    width = max(band.shape[1] for _, band in bands)
    parts = [with_captions(np.empty((0, width, 3), np.uint8), (title,))] if title else []
    parts += [legend(styles, width)] if styles else []
    for row_title, band in bands:
        parts += [with_captions(np.empty((0, width, 3), np.uint8), (row_title,))] if row_title else []
        padded = np.full((band.shape[0] + gap_px, width, 3), BACKGROUND, np.uint8)
        padded[: band.shape[0], : band.shape[1]] = band
        parts.append(padded)
    return np.concatenate(parts)


def save_png(path: Path | str, picture: np.ndarray) -> None:
    """Writes an RGB picture, whole or not at all; makes its folder.

    Raises:
        InputError: it cannot be written there.
    """
    path = Path(path)
    _, encoded = cv2.imencode(".png", cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as part:
            part.write_bytes(encoded.tobytes())
    except OSError as error:
        raise InputError(f"{path}: the picture cannot be written there ({error.strerror}); give another place") from error
