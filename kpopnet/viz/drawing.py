"""Draws depth and skeletons for reports, training logs and contact sheets. All output images are (H, W, 3) uint8 RGB."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from kpopnet.camera import Camera
from kpopnet.runtime.atomic_write import write_whole
from kpopnet.skeleton import BONES, JOINT_NAMES

BACKGROUND = (24, 24, 28)
NEAREST_GREY, FARTHEST_GREY = 215, 75
TEXT = (235, 235, 235)
TEXT_HEIGHT_PX, GAP_PX = 18, 6
TEXT_SIZE = 0.42  # of OpenCV's font
_SUBPIXEL_BITS = 4  # cv2 takes the end points of lines in sixteenths of a pixel


@dataclass(frozen=True)
class Style:
    """The name of a skeleton in the legend, the RGB colours of its sides and middle; its joints are discs or circles."""

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


def depth_rgb(depth_m: np.ndarray) -> np.ndarray:
    """Maps (H, W) depth in metres to RGB: near is light grey, far is dark grey, not measured is nearly black.

    The greys span the range of the middle 98 % of the measured depths, and at least 0.4 m.
    """
    measured = depth_m > 0
    rgb = np.full((*depth_m.shape, 3), BACKGROUND, np.uint8)
    if measured.any():
        near, far = np.percentile(depth_m[measured], (1, 99))
        far = max(far, near + 0.4)
        share = np.clip((depth_m[measured] - near) / (far - near), 0, 1)
        rgb[measured] = (NEAREST_GREY + (FARTHEST_GREY - NEAREST_GREY) * share).astype(np.uint8)[:, None]
    return rgb


def probability_rgb(probability: np.ndarray) -> np.ndarray:
    """Maps (H, W) values in 0..1 to RGB, for ridge images and heatmaps: black through orange to white."""
    coloured = cv2.applyColorMap((np.clip(probability, 0, 1) * 255).astype(np.uint8), cv2.COLORMAP_HOT)
    return cv2.cvtColor(coloured, cv2.COLOR_BGR2RGB)


def draw_skeleton(image: np.ndarray, joints_camera_m: np.ndarray, camera: Camera, style: Style) -> None:
    """Draws (15, 3) joints in metres into an RGB image, in place; missing joints and those behind the camera are omitted.

    The image may be larger than the camera's image, by the same factor in width and height.
    """
    scale = image.shape[1] / camera.width
    uvz = camera.project(joints_camera_m)
    drawable = np.isfinite(uvz).all(axis=-1) & (uvz[..., 2] > 0) & (np.abs(uvz[..., :2]) < 1e5).all(axis=-1)
    # Pixel centres lie at integer coordinates: column u of the camera is column (u + 0.5) scale - 0.5 of the image.
    at = np.where(drawable[:, None], (uvz[:, :2] + 0.5) * scale - 0.5, 0)
    at = np.round(at * 2**_SUBPIXEL_BITS).astype(int)
    for parent, child in BONES:
        if drawable[parent] and drawable[child]:
            ends = tuple(at[parent].tolist()), tuple(at[child].tolist())
            cv2.line(image, *ends, style.colour(parent, child), style.width_px, cv2.LINE_AA, _SUBPIXEL_BITS)
    radius = (style.width_px + 1) * 2**_SUBPIXEL_BITS
    for joint in np.flatnonzero(drawable):
        thickness = -1 if style.filled else 1
        centre = tuple(at[joint].tolist())
        cv2.circle(image, centre, radius, style.colour(joint), thickness, cv2.LINE_AA, _SUBPIXEL_BITS)


def person_view(
    depth_m: np.ndarray, camera: Camera, joints_camera_m: tuple[np.ndarray, ...] = (), margin: float = 0.06
) -> tuple[np.ndarray, Camera]:
    """Crops a square around the silhouette in (H, W) metres and the (15, 3) joints in metres; else around the whole image.

    `margin` is the width added on each side, as a fraction of the side. (S, S) float32 metres, 0 outside the image, and the
    camera of these pixels.
    """
    rows, columns = np.nonzero(depth_m)
    points = [np.stack([columns, rows], axis=1).astype(float)]
    points += [camera.project(joints)[:, :2] for joints in joints_camera_m]
    uv = np.concatenate(points)
    uv = uv[np.isfinite(uv).all(axis=1)]
    size = np.array([camera.width, camera.height])
    inside = (np.abs(uv - (size - 1) / 2) < size).all(axis=1)  # a cropped camera's principal point may lie far outside
    uv = uv[inside] if inside.any() else np.array([[0, 0], [camera.width - 1, camera.height - 1]], float)
    low, high = uv.min(axis=0), uv.max(axis=0)
    side = max(8, int(np.ceil((high - low).max() * (1 + 2 * margin))))
    x0, y0 = np.round((low + high) / 2 - side / 2).astype(int).tolist()
    view = np.zeros((side, side), np.float32)
    there = depth_m[max(y0, 0) : max(y0 + side, 0), max(x0, 0) : max(x0 + side, 0)]
    top, left = max(-y0, 0), max(-x0, 0)
    view[top : top + there.shape[0], left : left + there.shape[1]] = there
    return view, camera.cropped(x0, y0, side, side)


def person_tile(
    depth_m: np.ndarray,
    camera: Camera,
    skeletons: tuple[tuple[np.ndarray, Style], ...],
    side_px: int = 288,
    captions: tuple[str, ...] = (),
) -> np.ndarray:
    """Draws one person as a square image of (H, W) depth in metres, skeletons over it, and lines of ASCII text below.

    Each skeleton is (15, 3) joints in metres with its style; the first one is drawn lowest.
    """
    return scene_tile(*person_view(depth_m, camera, tuple(joints for joints, _ in skeletons)), skeletons, side_px, captions)


def scene_tile(
    depth_m: np.ndarray,
    camera: Camera,
    skeletons: Iterable[tuple[np.ndarray, Style]],
    width_px: int,
    captions: tuple[str, ...] = (),
) -> np.ndarray:
    """The same of a whole image, which need not be square."""
    image = enlarged(depth_rgb(depth_m), width_px)
    for joints, style in skeletons:
        draw_skeleton(image, joints, camera, style)
    return with_captions(image, captions)


def enlarged(image: np.ndarray, width_px: int, interpolation: int = cv2.INTER_NEAREST) -> np.ndarray:
    """Resizes an image to another width."""
    height_px = max(round(image.shape[0] * width_px / image.shape[1]), 1)
    return cv2.resize(image, (width_px, height_px), interpolation=interpolation)


def with_captions(image: np.ndarray, captions: tuple[str, ...]) -> np.ndarray:
    """Adds lines of text below an image, in a smaller font where a line would not fit."""
    strip = np.full((TEXT_HEIGHT_PX * len(captions), image.shape[1], 3), BACKGROUND, np.uint8)
    for line, text in enumerate(captions):
        write(strip, text, (4, TEXT_HEIGHT_PX * (line + 1) - 5))
    return np.concatenate([image, strip])


def write(image: np.ndarray, text: str, left_bottom: tuple[int, int]) -> int:
    """Writes a line of text into an image, in a smaller font where it would not fit; returns its width in pixels."""
    text = text.encode("utf-8", "backslashreplace").decode()  # OpenCV crashes at half of a surrogate pair
    available = image.shape[1] - left_bottom[0] - 4
    width = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, TEXT_SIZE, 1)[0][0]
    size = TEXT_SIZE * min(1.0, available / max(width, 1))
    cv2.putText(image, text, left_bottom, cv2.FONT_HERSHEY_SIMPLEX, size, TEXT, 1, cv2.LINE_AA)
    return min(width, available)


def legend(styles: tuple[Style, ...], width_px: int) -> np.ndarray:
    """Strips that explain the colours of the styles, as many as the width needs."""
    strips, x = [], width_px
    for style in styles:
        for side, colour in (("right", style.right), ("left", style.left), ("middle", style.middle)):
            text = f"{style.name}, {side}"
            if x + 32 + cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, TEXT_SIZE, 1)[0][0] > width_px:
                strips.append(np.full((TEXT_HEIGHT_PX + 6, width_px, 3), BACKGROUND, np.uint8))
                x = 6
            strip, y = strips[-1], strips[-1].shape[0] // 2
            cv2.line(strip, (x, y), (x + 22, y), colour, style.width_px, cv2.LINE_AA)
            cv2.circle(strip, (x + 11, y), style.width_px + 1, colour, -1 if style.filled else 1, cv2.LINE_AA)
            x += 28
            x += write(strip, text, (x, strip.shape[0] - 8)) + 14
    return np.concatenate(strips)


def sheet(rows: list[tuple[str, list[np.ndarray]]], styles: tuple[Style, ...] = (), title: str = "") -> np.ndarray:
    """Arranges images in rows, each with a title, which may be empty; a title and a legend stand above."""
    bands = []
    for _, tiles in rows:
        height = max(len(tile) for tile in tiles)
        bands.append(np.concatenate([_bordered(tile, height - len(tile), left=GAP_PX) for tile in tiles], axis=1))
    width = max(band.shape[1] for band in bands) + GAP_PX
    no_image = np.empty((0, width, 3), np.uint8)
    parts = [with_captions(no_image, (title,))] if title else []
    parts += [legend(styles, width)] if styles else []
    for (row_title, _), band in zip(rows, bands, strict=True):
        parts += [with_captions(no_image, (row_title,))] if row_title else []
        parts.append(_bordered(band, GAP_PX, right=width - band.shape[1]))
    return np.concatenate(parts)


def _bordered(image: np.ndarray, below: int, left: int = 0, right: int = 0) -> np.ndarray:
    """An image with background around it, pixels."""
    return cv2.copyMakeBorder(image, 0, below, left, right, cv2.BORDER_CONSTANT, value=BACKGROUND)


def save_png(path: Path | str, image: np.ndarray) -> None:
    """Writes an RGB image to a PNG file atomically, and creates its folder."""
    path = Path(path)
    _, encoded = cv2.imencode(".png", cv2.cvtColor(image, cv2.COLOR_RGB2BGR))
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, encoded.tobytes())
