"""Renders depth images of the scene with MuJoCo's OpenGL (`gl`) or with a z-buffer rasteriser in numba (`cpu`).

Both renderers draw the same vertices, skinned by MuJoCo, and agree to a hundredth of a millimetre. `gl` needs an OpenGL
library: EGL with a GPU, OSMesa without one. `cpu` needs no library and is several times faster on a CPU. `auto` is `gl`
where a GPU draws through EGL, and `cpu` everywhere else.
"""

import contextlib
import logging
import os
import warnings

import mujoco
import numpy as np
from numba import njit

from kpopnet.camera import Camera
from kpopnet.errors import InputError, check_one_of
from synth.scene.mesh import BOX_CORNERS, BOX_FACES, Mesh
from synth.scene.scene import FAR_M, NEAR_M, ROOM_GROUP, Scene

log = logging.getLogger(__name__)

MOST_BEYOND = 2  # `whole_px` counts pixels up to this many times the image's width and height beyond its borders

EDGE_TOLERANCE = 1e-9
"""Slack of the barycentric inside test. A pixel centre on the common edge of two triangles belongs to one of them."""


def make_renderer(name: str, scene: Scene) -> "CpuRenderer":
    """Builds the renderer `auto`, `gl` or `cpu`. Raises InputError for `gl` without a usable OpenGL.

    `auto` tries OpenGL only with MuJoCo's EGL backend (MUJOCO_GL=egl, which `synth` sets on a machine with an NVIDIA GPU
    and an EGL library).
    """
    check_one_of("renderer", name, ("auto", "gl", "cpu"))
    if name == "cpu":
        return CpuRenderer(scene)
    if name == "gl":
        return GlRenderer(scene)
    reason = "no GPU with EGL"
    if os.environ.get("MUJOCO_GL", "").lower() == "egl":
        try:
            renderer = GlRenderer(scene)
            if renderer.on_gpu():
                return renderer
            renderer.close()
        except InputError as error:
            reason = str(error)
    log.info("renderer=auto: the CPU rasteriser draws (%s)", reason)
    return CpuRenderer(scene)


def _options(*, skin: bool) -> mujoco.MjvOption:
    """What MuJoCo draws: the skin alone, or the room alone."""
    options = mujoco.MjvOption()
    options.geomgroup[:] = 0
    options.geomgroup[ROOM_GROUP] = not skin
    options.skingroup[:] = skin
    options.sitegroup[:] = 0
    options.flags[mujoco.mjtVisFlag.mjVIS_SKIN] = skin
    options.flags[mujoco.mjtVisFlag.mjVIS_STATIC] = not skin
    return options


class CpuRenderer:
    """Renders the current state of a scene, with the z-buffer rasteriser.

    Depth images are (H, W) float32 metres along the optical axis, 0 where no surface is visible. Geometry nearer than
    NEAR_M is clipped at that plane, like the blind zone of a sensor.
    """

    name = "cpu"

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self._options = [_options(skin=False), _options(skin=True)]
        self._drawn = mujoco.MjvScene(scene.model, maxgeom=64)
        self._mujoco_camera = mujoco.MjvCamera()
        self._mujoco_camera.type = mujoco.mjtCamera.mjCAMERA_FIXED
        self._mujoco_camera.fixedcamid = 0

    def _update(self, *, skin: bool) -> None:
        """Lets MuJoCo skin the person, or collect the room. It needs no OpenGL."""
        scene, options, everything = self.scene, self._options[skin], mujoco.mjtCatBit.mjCAT_ALL
        mujoco.mjv_updateScene(scene.model, scene.data, options, None, self._mujoco_camera, everything, self._drawn)

    def vertices_world_m(self) -> np.ndarray:
        """(V, 3) float32 skin vertices of the posed person, world frame."""
        self._update(skin=True)
        return self._drawn.skinvert.reshape(-1, 3)

    def person_m(self) -> np.ndarray:
        """(H, W) depth of the person without the room."""
        return draw_mesh_m(self.scene, Mesh(self.vertices_world_m(), self.scene.skin.faces))

    def room_m(self) -> np.ndarray:
        """(H, W) depth of the room without the person."""
        return draw_mesh_m(self.scene, box_mesh(self.scene))

    def close(self) -> None:
        """Frees the renderer's resources."""


class GlRenderer(CpuRenderer):
    """MuJoCo's offscreen OpenGL. The camera must have square pixels and a centred principal point."""

    name = "gl"

    def __init__(self, scene: Scene) -> None:
        """Creates a GL context. Raises InputError without a usable OpenGL."""
        super().__init__(scene)
        camera = scene.camera
        centred = Camera.centred(camera.fy, camera.width, camera.height)
        if not np.allclose([camera.fx, camera.cx, camera.cy], [centred.fx, centred.cx, centred.cy], atol=1e-3):
            raise InputError("renderer=gl needs square pixels and a centred principal point: use renderer=cpu")
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # GLFW reports a missing display as warnings; the error below says it
                self._context = mujoco.GLContext(camera.width, camera.height)
                self._context.make_current()
                self._drawing = mujoco.MjrContext(scene.model, mujoco.mjtFontScale.mjFONTSCALE_100.value)
        except Exception as error:  # the type depends on the platform's GL loader
            raise InputError(
                f"no OpenGL to draw with ({type(error).__name__}: {error}); with a GPU set MUJOCO_GL=egl, without one "
                "install OSMesa (Debian: libosmesa6) and set MUJOCO_GL=osmesa, or use renderer=cpu"
            ) from error
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._drawing)
        self._viewport = mujoco.MjrRect(0, 0, camera.width, camera.height)
        flags, name = self._drawn.flags, mujoco.mjtRndFlag
        flags[name.mjRND_SHADOW] = flags[name.mjRND_REFLECTION] = flags[name.mjRND_SKYBOX] = False
        flags[name.mjRND_CULL_FACE] = True
        self._buffer = np.empty((camera.height, camera.width), np.float32)

    def on_gpu(self) -> bool:
        """Whether EGL draws with a GPU, not with one of Mesa's software rasterisers."""
        from OpenGL import GL

        renderer = GL.glGetString(GL.GL_RENDERER).decode().lower()
        return not any(name in renderer for name in ("llvmpipe", "softpipe", "swrast"))

    def person_m(self) -> np.ndarray:
        return self._draw_m(skin=True)

    def room_m(self) -> np.ndarray:
        return self._draw_m(skin=False)

    def _draw_m(self, *, skin: bool) -> np.ndarray:
        self._update(skin=skin)
        mujoco.mjr_render(self._viewport, self._drawn, self._drawing)
        mujoco.mjr_readPixels(None, self._buffer, self._viewport, self._drawing)
        # MuJoCo renders with reversed depth but returns the usual convention: 0 near, 1 far.
        with np.errstate(divide="ignore"):
            depth_m = NEAR_M / (1 - self._buffer[::-1] * (1 - NEAR_M / FAR_M))
        depth_m[depth_m >= 0.999 * FAR_M] = 0
        return depth_m

    def close(self) -> None:
        # Freed explicitly: OSMesa reports errors when the context is freed at interpreter exit.
        with contextlib.suppress(Exception):
            self._drawing.free()
            self._context.free()


def draw_mesh_m(scene: Scene, mesh: Mesh) -> np.ndarray:
    """(H, W) depth of a mesh in the world, as the scene's camera sees it, by the rasteriser. It needs no OpenGL."""
    points = _to_camera(mesh.vertices_m, scene.view.position_m, scene.view.rotation)
    return rasterise(points, mesh.faces, scene.camera)


def whole_px(scene: Scene, mesh: Mesh) -> int:
    """Pixels that a mesh in the world would have if the image reached MOST_BEYOND times its size beyond every border."""
    camera = scene.camera
    points = _to_camera(mesh.vertices_m, scene.view.position_m, scene.view.rotation)
    size = np.array([camera.width, camera.height])
    low, high = -MOST_BEYOND * size, (MOST_BEYOND + 1) * size  # the second one exclusive
    if points[:, 2].min() > NEAR_M:  # what is behind the camera has no place in the image
        uv = camera.project(points)[:, :2]
        low = np.clip(np.floor(uv.min(axis=0)).astype(int), low, high - 1)
        high = np.clip(np.ceil(uv.max(axis=0)).astype(int) + 1, low + 1, high)
    around = camera.cropped(*low.tolist(), *(high - low).tolist())
    return int(np.count_nonzero(rasterise(points, mesh.faces, around)))


def box_mesh(scene: Scene) -> Mesh:
    """Triangulates the boxes of the room, world frame."""
    model, data = scene.model, scene.data
    boxes = np.flatnonzero((model.geom_type == mujoco.mjtGeom.mjGEOM_BOX) & (data.geom_xpos[:, 2] > -50))
    corners = BOX_CORNERS * model.geom_size[boxes][:, None]
    world = np.einsum("bij,bkj->bki", data.geom_xmat[boxes].reshape(-1, 3, 3), corners) + data.geom_xpos[boxes][:, None]
    faces = BOX_FACES + 8 * np.arange(len(boxes), dtype=np.int32)[:, None, None]
    return Mesh(world.reshape(-1, 3), faces.reshape(-1, 3))


def rasterise(vertices_camera_m: np.ndarray, faces: np.ndarray, camera: Camera) -> np.ndarray:
    """(H, W) float32 depth in metres of a triangle mesh, 0 where no triangle covers the pixel centre.

    From vertices (V, 3) float32 in the camera frame and faces (F, 3) int32, counter-clockwise seen from outside; back faces are
    not drawn.
    """
    inverse = np.zeros((camera.height, camera.width), np.float32)
    _rasterise(vertices_camera_m, faces, camera.fx, camera.fy, camera.cx, camera.cy, NEAR_M, inverse)
    return np.divide(1, inverse, out=inverse, where=inverse > 0)


@njit(cache=True)
def _to_camera(points, position, rotation):
    """`View.to_camera` in a fixed order of summation: the last bits of a BLAS product differ between machines."""
    moved = np.empty((points.shape[0], 3), np.float32)
    for i in range(points.shape[0]):
        x, y, z = points[i, 0] - position[0], points[i, 1] - position[1], points[i, 2] - position[2]
        for axis in range(3):
            moved[i, axis] = x * rotation[0, axis] + y * rotation[1, axis] + z * rotation[2, axis]
    return moved


@njit(cache=True)
def _rasterise(points, faces, fx, fy, cx, cy, near, inverse):
    """Fills `inverse` (H, W) with 1/z of the nearest front face; 1/z is linear over the image."""
    us, vs, ws = np.empty(len(points)), np.empty(len(points)), np.zeros(len(points))
    for i in range(len(points)):
        z = points[i, 2]
        if z >= near:
            w = 1.0 / z
            us[i], vs[i], ws[i] = fx * points[i, 0] * w + cx, fy * points[i, 1] * w + cy, w
    polygon = np.empty((4, 3))
    for f in range(len(faces)):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        behind = (ws[i] == 0) + (ws[j] == 0) + (ws[k] == 0)
        if behind == 0:
            _triangle(us[i], vs[i], ws[i], us[j], vs[j], ws[j], us[k], vs[k], ws[k], inverse)
        elif behind < 3:
            corners = _clip(points, faces[f], near, polygon)
            for c in range(corners):
                w = 1.0 / polygon[c, 2]
                polygon[c, 0], polygon[c, 1], polygon[c, 2] = fx * polygon[c, 0] * w + cx, fy * polygon[c, 1] * w + cy, w
            u, v, w = polygon[:, 0], polygon[:, 1], polygon[:, 2]
            _triangle(u[0], v[0], w[0], u[1], v[1], w[1], u[2], v[2], w[2], inverse)
            if corners == 4:
                _triangle(u[0], v[0], w[0], u[2], v[2], w[2], u[3], v[3], w[3], inverse)


@njit(cache=True)
def _clip(points, face, near, polygon):
    """Clips a triangle at the near plane into `polygon`: 3 or 4 corners in order. Returns the number of corners."""
    count = 0
    for c in range(3):
        a, b = face[c], face[(c + 1) % 3]
        za, zb = points[a, 2], points[b, 2]
        if za >= near:
            for axis in range(3):  # element by element: numba compiles a copy of a row for a second
                polygon[count, axis] = points[a, axis]
            count += 1
        if (za >= near) != (zb >= near):
            t = (near - za) / (zb - za)
            for axis in range(3):
                polygon[count, axis] = points[a, axis] + t * (points[b, axis] - points[a, axis])
            count += 1
    return count


@njit(cache=True)
def _triangle(ua, va, wa, ub, vb, wb, uc, vc, wc, inverse):
    """Draws a projected triangle a b c (u, v, w = 1/z) if it faces the camera. It covers the pixels whose centres it covers."""
    # v points down, so a front face, counter-clockwise from outside, has a negative cross product.
    area = (ub - ua) * (vc - va) - (vb - va) * (uc - ua)
    if area >= 0:
        return
    height, width = inverse.shape
    x_first = max(0, int(np.ceil(min(ua, ub, uc))))
    x_last = min(width - 1, int(np.floor(max(ua, ub, uc))))
    y_first = max(0, int(np.ceil(min(va, vb, vc))))
    y_last = min(height - 1, int(np.floor(max(va, vb, vc))))
    if x_first > x_last or y_first > y_last:
        return
    # Barycentric coordinates of b and c, linear in the pixel.
    scale = 1.0 / area
    b_dx, b_dy = (vc - va) * scale, (ua - uc) * scale
    c_dx, c_dy = (va - vb) * scale, (ub - ua) * scale
    for y in range(y_first, y_last + 1):
        b_row = (y - va) * b_dy - ua * b_dx
        c_row = (y - va) * c_dy - ua * c_dx
        for x in range(x_first, x_last + 1):
            weight_b, weight_c = b_row + x * b_dx, c_row + x * c_dx
            if weight_b >= -EDGE_TOLERANCE and weight_c >= -EDGE_TOLERANCE and weight_b + weight_c <= 1 + EDGE_TOLERANCE:
                w = np.float32(wa + weight_b * (wb - wa) + weight_c * (wc - wa))
                if w > inverse[y, x]:
                    inverse[y, x] = w
