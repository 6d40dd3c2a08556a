"""Simulates depth images of people with ground-truth joints.

Posed bodies in furnished rooms are rendered to depth, degraded by a depth-camera model, and segmented. synth imports
kpopnet; of kpopnet its programs alone import synth.
"""

import ctypes.util
import os
from pathlib import Path

# MuJoCo selects its OpenGL backend at import, and selects EGL only if MUJOCO_GL says so. EGL draws on a GPU without a display.
if "MUJOCO_GL" not in os.environ and Path("/dev/nvidiactl").exists() and ctypes.util.find_library("EGL"):
    os.environ["MUJOCO_GL"] = "egl"
