"""Freed memory is used again."""

import subprocess
import sys

import pytest

FAULTS = """
import resource
import sys
import numpy as np
from kpopnet.runtime.cpu import keep_freed_memory

if sys.argv[1] == "kept":
    keep_freed_memory()
for _ in range(60):
    images = [np.ones(4_000_000, np.uint8) for _ in range(4)]
    del images
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt)
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="the setting is glibc's")
def test_arrays_of_an_images_size_are_not_returned_to_the_kernel() -> None:
    faults = {
        how: int(subprocess.run([sys.executable, "-c", FAULTS, how], capture_output=True, text=True, check=True).stdout)
        for how in ("kept", "returned")
    }
    assert faults["returned"] - faults["kept"] > 10_000, "each of 60 rounds faults in 4,000 pages anew where nothing is kept"
