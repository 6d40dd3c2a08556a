"""Rendered depth against analytic scenes, and the two renderers against each other."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from kpopnet.camera import CAMERAS, Camera
from kpopnet.errors import InputError
from synth.body.shape import BodyConfig, draw_person
from synth.scene.render import CpuRenderer, GlRenderer, make_renderer
from synth.scene.room import LIVING_ROOM, Room, View, ViewConfig, draw_room, draw_view
from synth.scene.scene import Scene

CAMERA = CAMERAS["kinect_v1"]
LEVEL = View(np.array([0.0, 0.0, 1.0]), np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]))
COMPARED_SCENES = 4


def test_a_box_in_a_room_has_its_analytic_depth() -> None:
    """A box of 1 m with its face at 2.5 m, in front of a wall at 4 m, on a floor 1 m below a level camera."""
    scene = Scene(CAMERA)
    room = Room(
        np.array([[0, 0, -0.1], [0, 4.1, 2], [0, 3.0, 0.5]]),
        np.array([[9, 9, 0.1], [9, 0.1, 5], [0.5, 0.5, 0.5]]),
        np.zeros(3),
    )
    scene.set_view(LEVEL)
    scene.set_room(room)
    depth_m = CpuRenderer(scene).room_m()
    assert depth_m[130, 160] == pytest.approx(2.5, abs=1e-5)
    assert depth_m[40, 160] == pytest.approx(4.0, abs=1e-5)
    assert depth_m[235, 20] == pytest.approx(CAMERA.fy * 1.0 / (235 - CAMERA.cy), rel=1e-5)


def compared_scene(scene: Scene, k: int) -> None:
    """Sets up scene k of those that both renderers draw. The last person intersects the near plane."""
    rng = np.random.default_rng(k)
    scene.set_person(draw_person(rng, BodyConfig(), "train"))
    scene.set_view(draw_view(rng, ViewConfig()))
    scene.set_room(draw_room(rng, LIVING_ROOM))
    quats = np.array([1.0, 0, 0, 0]) + 0.15 * rng.normal(size=(len(scene.asset.bone_names), 4))
    distance_m = 0.05 if k == COMPARED_SCENES - 1 else rng.uniform(1.2, 3.5)
    scene.pose(quats / np.linalg.norm(quats, axis=1, keepdims=True), np.array([0.2, distance_m, 0.9]))


DRAW_WITH_GL = """
import sys, numpy as np
sys.path.insert(0, sys.argv[2])
from test_render import CAMERA, COMPARED_SCENES, compared_scene
from kpopnet.errors import InputError
from synth.scene.render import GlRenderer
from synth.scene.scene import Scene
scene = Scene(CAMERA)
try:
    renderer = GlRenderer(scene)
except InputError as error:
    print(error); sys.exit(7)
images = []
for k in range(COMPARED_SCENES):
    compared_scene(scene, k)
    images += [renderer.person_m(), renderer.room_m()]
renderer.close()
np.save(sys.argv[1], np.stack(images))
"""


def draw_with_gl(backend: str, path: Path) -> str:
    """Renders in a separate process, because MuJoCo selects its GL backend at import. Returns the reason of a failure."""
    run = subprocess.run(
        [sys.executable, "-c", DRAW_WITH_GL, str(path), str(Path(__file__).parent)],
        env=os.environ | {"MUJOCO_GL": backend},
        capture_output=True,
        text=True,
        check=False,
    )
    return "" if run.returncode == 0 else f"{backend}: {(run.stdout + run.stderr).strip().splitlines()[-1]}"


def test_cpu_and_gl_draw_the_same(tmp_path: Path) -> None:
    reasons = []
    for backend in ("osmesa", "egl"):
        reason = draw_with_gl(backend, tmp_path / "gl.npy")
        if not reason:
            break
        reasons.append(reason)
    else:
        pytest.skip(f"no OpenGL here ({'; '.join(reasons)}); Debian: apt-get install libosmesa6")
    drawn_by_gl = np.load(tmp_path / "gl.npy")
    scene = Scene(CAMERA)
    renderer = CpuRenderer(scene)
    for k in range(COMPARED_SCENES):
        compared_scene(scene, k)
        for what, gl_m in zip(("person_m", "room_m"), drawn_by_gl[2 * k : 2 * k + 2], strict=True):
            cpu_m = getattr(renderer, what)()
            both, either = (cpu_m > 0) & (gl_m > 0), (cpu_m > 0) | (gl_m > 0)
            assert both.sum() > 1000, (k, what)
            assert both.sum() / either.sum() > 0.999, (k, what)
            assert np.median(np.abs(cpu_m - gl_m)[both]) < 1e-5, (k, what)


def test_renderers_are_selected_by_name() -> None:
    scene = Scene(CAMERA)
    assert make_renderer("cpu", scene).name == "cpu"
    with pytest.raises(InputError, match="auto, gl, cpu"):
        make_renderer("vulkan", scene)
    with pytest.raises(InputError, match="centred principal point"):
        GlRenderer(Scene(Camera(285, 285, 150, 119.5, 320, 240)))


@pytest.mark.parametrize(("backend", "on_gpu"), [(None, True), ("osmesa", True), ("egl", True), ("egl", False)])
def test_auto_draws_with_gl_only_where_egl_does_it_on_a_gpu(backend, on_gpu, monkeypatch) -> None:
    closed = []

    class Gl:
        name = "gl"

        def __init__(self, scene: Scene) -> None:
            assert backend == "egl", "a GL context was created"

        def on_gpu(self) -> bool:
            return on_gpu

        def close(self) -> None:
            closed.append(self)

    monkeypatch.delenv("MUJOCO_GL", raising=False)
    if backend is not None:
        monkeypatch.setenv("MUJOCO_GL", backend)
    monkeypatch.setattr("synth.scene.render.GlRenderer", Gl)
    assert make_renderer("auto", Scene(CAMERA)).name == ("gl" if backend == "egl" and on_gpu else "cpu")
    assert bool(closed) == (backend == "egl" and not on_gpu)
