"""Depth from files: folders of images, arrays, videos, bags of ROS, recordings of phones; one image at a time, in metres."""

from kpopnet.sources.opening import chosen_camera, open_depth
from kpopnet.sources.source import DepthSource

__all__ = ["DepthSource", "chosen_camera", "open_depth"]
