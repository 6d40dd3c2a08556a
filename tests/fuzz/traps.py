"""What hostile files aim at: code that runs, files elsewhere, memory; and the terminal of who reads the message."""

import functools
import os
import zlib

SECRET = 4.321
"""Every number in files that lie outside of what is read, in metres; such depth is 4321 mm."""

BOMB_PX = 9_400
"""Side of a square image of zeros: more than twice `kpopnet.camera.MAX_IMAGE_PIXELS` and just below Pillow's own limit."""

ANY, TELLS, NEVER, WILD = "any", "tells", "never", "wild"
"""What a mutation demands: nothing; that its content is refused or has not changed, because the format's checksums tell; that
it is refused; nothing, and not even that a library whose structures were changed takes little memory, or gives none of it."""


CANARY = "canary"
"""A folder that only code hidden in a file makes, in the working folder of the reader."""

EXPRESSION = f"__import__('os').mkdir({CANARY!r})"
"""Python that makes it."""


class Maker:
    """An object whose pickle makes the canary when it is loaded."""

    def __reduce__(self):
        return os.mkdir, (CANARY,)


@functools.cache
def packed_zeros(count: int) -> bytes:
    """That many zeros, compressed by zlib to a thousandth."""
    packer = zlib.compressobj(1)
    block = bytes(1 << 20)
    parts = [packer.compress(block[: min(len(block), count - start)]) for start in range(0, count, len(block))]
    return b"".join([*parts, packer.flush()])
