"""What a source of live depth is: a camera, or what stands in for one."""

from typing import Protocol

import numpy as np

from kpopnet.camera import Camera


class CameraAwayError(Exception):
    """The camera sends no images just now; a later call may find it again. The text says what to do."""


class LiveCamera(Protocol):
    """A depth camera, or what stands in for one.

    Attributes:
        camera: its intrinsics.
    """

    camera: Camera

    def read(self) -> tuple[np.ndarray, float] | None:
        """Waits for the next image; None after the last one of a recording.

        Returns:
            (H, W) float32 depth of the whole scene, metres, 0 where nothing was measured, and when it was taken, in seconds of
            `time.monotonic`.

        Raises:
            CameraAwayError: no image came for a while; the next call looks for the camera again.
            InputError: there will be no more images.
        """
        ...

    def close(self) -> None:
        """Lets go of the camera."""
        ...
