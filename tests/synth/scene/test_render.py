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
from synth.scene.render import CpuRenderer, GlRenderer, make_renderer, rasterise
from synth.scene.room import LIVING_ROOM, Room, ViewConfig, draw_room, draw_view, posed_view
from synth.scene.scene import Scene

CAMERA = CAMERAS["kinect_v1"]


def test_a_box_in_a_room_has_its_analytic_depth() -> None:
    """A box of 1 m with its face at 2.5 m, in front of a wall at 4 m, on a floor 1 m below a level camera."""
    scene = Scene(CAMERA)
    room = Room(
        np.array([[0, 0, -0.1], [0, 4.1, 2], [0, 3.0, 0.5]]),
        np.array([[9, 9, 0.1], [9, 0.1, 5], [0.5, 0.5, 0.5]]),
        np.zeros(3),
    )
    scene.set_view(posed_view(np.array([0.0, 0.0, 1.0]), 0.0, 0.0))
    scene.set_room(room)
    depth_m = CpuRenderer(scene).room_m()
    assert depth_m[130, 160] == pytest.approx(2.5, abs=1e-5)
    assert depth_m[40, 160] == pytest.approx(4.0, abs=1e-5)
    # The floor in front of the box, which is cut at the near plane: it goes on behind the camera.
    rows = np.arange(CAMERA.height)[:, None]
    floor_m = np.where(rows > CAMERA.cy + CAMERA.fy / 2.5, CAMERA.fy / (rows - CAMERA.cy), 0) * np.ones(CAMERA.width)
    np.testing.assert_allclose(depth_m[floor_m > 0], floor_m[floor_m > 0], rtol=1e-5)


@pytest.mark.parametrize("turn", range(3))
def test_a_triangle_that_begins_behind_the_camera_is_drawn_whole_and_from_its_front(turn: int) -> None:
    corners = np.roll([(0, 1, -50), (-50, 1, 50), (50, 1, 50)], turn, axis=0).astype(np.float32)  # on a floor 1 m below
    faces = np.array([[0, 2, 1]], np.int32)
    rows = np.broadcast_to(np.arange(CAMERA.height)[:, None], (CAMERA.height, CAMERA.width))
    floor_m = CAMERA.fy / np.maximum(rows - CAMERA.cy, 1e-9)
    np.testing.assert_allclose(rasterise(corners, faces, CAMERA), np.where(floor_m < 50, floor_m, 0), rtol=1e-5)
    assert not rasterise(corners, faces[:, ::-1].copy(), CAMERA).any()


def images_m(kind: type[CpuRenderer]) -> np.ndarray:
    """(8, H, W) person and room of four scenes by a renderer; the last person intersects the near plane."""
    scene, images = Scene(CAMERA), []
    renderer = kind(scene)
    for k in range(4):
        rng = np.random.default_rng(k)
        scene.set_person(draw_person(rng, BodyConfig(), "train"))
        scene.set_view(draw_view(rng, ViewConfig()))
        scene.set_room(draw_room(rng, LIVING_ROOM))
        quats = np.array([1.0, 0, 0, 0]) + 0.15 * rng.normal(size=(len(scene.asset.bone_names), 4))
        distance_m = 0.05 if k == 3 else rng.uniform(1.2, 3.5)
        scene.pose(quats / np.linalg.norm(quats, axis=1, keepdims=True), np.array([0.2, distance_m, 0.9]))
        images += [renderer.person_m(), renderer.room_m()]
    renderer.close()
    return np.stack(images)


def draw_with_gl(backend: str, path: Path) -> str:
    """Renders in a separate process, because MuJoCo selects its GL backend at import. Returns the reason of a failure."""
    code = "import sys, test_render as t; t.np.save(sys.argv[1], t.images_m(t.GlRenderer))"
    environment = os.environ | {"MUJOCO_GL": backend, "PYTHONPATH": os.pathsep.join([*sys.path, str(Path(__file__).parent)])}
    run = subprocess.run([sys.executable, "-c", code, str(path)], env=environment, capture_output=True, text=True)
    return "" if run.returncode == 0 else f"{backend}: {run.stderr.strip().splitlines()[-1]}"


def test_cpu_and_gl_draw_the_same(tmp_path: Path) -> None:
    reasons = []
    for backend in ("osmesa", "egl"):
        if not (reason := draw_with_gl(backend, tmp_path / "gl.npy")):
            break
        # Without libOSMesa PyOpenGL fails as mujoco is imported, before any of our code.
        assert "InputError: no OpenGL" in reason or "no attribute 'glGetError'" in reason
        reasons.append(reason)
    else:
        pytest.skip(f"no OpenGL here ({'; '.join(reasons)}); Debian: apt-get install libosmesa6")
    for cpu_m, gl_m in zip(images_m(CpuRenderer), np.load(tmp_path / "gl.npy"), strict=True):
        both, either = (cpu_m > 0) & (gl_m > 0), (cpu_m > 0) | (gl_m > 0)
        assert both.sum() > 1000
        assert both.sum() / either.sum() > 0.999
        assert np.median(np.abs(cpu_m - gl_m)[both]) < 1e-5


def test_renderers_are_selected_by_name() -> None:
    scene = Scene(CAMERA)
    assert make_renderer("cpu", scene).name == "cpu"
    with pytest.raises(InputError, match="auto, gl, cpu"):
        make_renderer("vulkan", scene)
    with pytest.raises(InputError, match="centred principal point"):
        GlRenderer(Scene(Camera(285, 285, 150, 119.5, 320, 240)))


@pytest.mark.parametrize(("backend", "on_gpu"), [("", True), ("osmesa", True), ("egl", True), ("egl", False)])
def test_auto_draws_with_gl_only_where_egl_does_it_on_a_gpu(backend, on_gpu, monkeypatch) -> None:
    done = []
    monkeypatch.setenv("MUJOCO_GL", backend)
    monkeypatch.setattr(GlRenderer, "__init__", lambda self, scene: done.append("a GL context is made"))
    monkeypatch.setattr(GlRenderer, "on_gpu", lambda self: on_gpu)
    monkeypatch.setattr(GlRenderer, "close", lambda self: done.append("and closed"))
    assert make_renderer("auto", Scene(CAMERA)).name == ("gl" if backend == "egl" and on_gpu else "cpu")
    assert done == (["a GL context is made", "and closed"][: 1 if on_gpu else 2] if backend == "egl" else [])
