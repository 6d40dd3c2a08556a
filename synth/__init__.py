"""synth makes depth: posed bodies in rooms, rendered, spoilt by a depth camera and cut out, with their true joints.

It imports kpopnet's nouns (skeleton, camera, ridge, shards, observation) and what the programs share (errors, entry,
drawing); kpopnet never imports synth.
"""

import ctypes.util
import os

# MuJoCo chooses its OpenGL when it is imported, and without a screen only if it is told: on a GPU, EGL.
if "MUJOCO_GL" not in os.environ and os.path.exists("/dev/nvidiactl") and ctypes.util.find_library("EGL"):
    os.environ["MUJOCO_GL"] = "egl"
