"""kpopnet estimates 3D human joints from depth images, and computes a dance score from the joints.

After "Real-time dance evaluation by markerless human pose estimation" (Kim & Kim 2018), called "the paper" throughout.

Conventions throughout the package:

- Metres, seconds, radians. Camera frame: x right, y down, z forward. Depth is z, not ray length.
- Depth images are float32 metres in memory, 0 where nothing was measured, and uint16 millimetres on disk.
- Images are (H, W), sequences (T, H, W), joints (T, J, 3), and batch dimensions lead.
- Pixel centres lie at whole pixel coordinates: the principal point of a centred camera is ((W-1)/2, (H-1)/2).
- Right is the person's own right. A missing joint is NaN with confidence 0, never (0, 0, 0).
- Quaternions are w, x, y, z.
"""

import atexit
import contextlib
import os
import shutil
import tempfile
from pathlib import Path

# By default OpenMP threads spin while they wait. A training step then takes up to ten times as long when the cores have
# other work, such as preparing batches. The variable must be set before torch is loaded.
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")

__version__ = "0.1.0"


def _ensure_kernel_cache() -> None:
    """Where neither this folder nor the user's cache can be written, numba keeps compiled kernels in a folder of this process.

    It would not load a module without one. They are compiled anew then whenever a program starts.
    """
    if "NUMBA_CACHE_DIR" in os.environ:
        return
    for folder in (Path(__file__).parent / "__pycache__", Path(os.environ.get("XDG_CACHE_HOME", "~/.cache")) / "numba"):
        with contextlib.suppress(OSError, RuntimeError):  # RuntimeError: a user without a home
            folder.expanduser().mkdir(parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=folder.expanduser()).close()
            return
    with contextlib.suppress(OSError):  # no folder at all can be written: numba says so, once it needs one
        os.environ["NUMBA_CACHE_DIR"] = folder = tempfile.mkdtemp(prefix="kpopnet-kernels-")
        process = os.getpid()
        atexit.register(lambda: os.getpid() == process and shutil.rmtree(folder, ignore_errors=True))


_ensure_kernel_cache()
