"""Draws docs/figures/clothes.png and stances.png: every garment on one body, and poses of every family.

python tools/people_figures.py
"""

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from kpopnet.camera import Camera
from kpopnet.viz.drawing import TRUE, draw_skeleton, enlarged, save_png, sheet, with_captions
from synth.body.asset import load_body
from synth.body.garments import HELD_BACK, ORDINARY, Figure, hair, shoes
from synth.body.outfit import ClothesConfig, unworn
from synth.body.shape import BodyConfig, Person, draw_person, dress, shape_person
from synth.motion.poses import FAMILIES, ProceduralPoses
from synth.motion.posture import angles, rotations
from synth.samples.sampler import body_rotations
from synth.scene.render import CpuRenderer
from synth.scene.room import View
from synth.scene.scene import Scene

FIGURES = Path(__file__).resolve().parents[1] / "docs" / "figures"
CAMERA = Camera.centred(420.0, 260, 320)
DISTANCE_M, HEIGHT_M = 2.9, 0.95
NOTHING = ClothesConfig(**dict.fromkeys(vars(ClothesConfig()), 0.0))


class Photographer:
    """Draws people before an empty background, lit from the camera."""

    def __init__(self) -> None:
        self.scene = Scene(CAMERA)
        forward_right_down = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]).T  # camera x right, y down, z forward
        self.scene.set_view(View(np.array([0, -DISTANCE_M, HEIGHT_M]), forward_right_down))
        self.renderer = CpuRenderer(self.scene)

    def picture(
        self, person: Person, quats: np.ndarray, yaw_deg: float, caption: str, *, width_px: int = 200, joints: bool = True
    ) -> np.ndarray:
        """RGB image of a person in a pose (23, 4), turned to the left, with the true joints over it."""
        scene = self.scene
        scene.set_person(person)
        local = body_rotations(scene.asset, quats, np.radians(yaw_deg), np.zeros(2))
        scene.pose(local, np.zeros(3))
        scene.pose(local, np.array([0, 0, -self.renderer.vertices_world_m()[:, 2].min()]))
        image = np.ascontiguousarray(shaded(self.renderer.person_m()))
        if joints:
            draw_skeleton(image, scene.view.to_camera(scene.joints_world_m()), CAMERA, TRUE)
        return with_captions(enlarged(image, width_px), (caption,))


def shaded(depth_m: np.ndarray) -> np.ndarray:
    """(H, W, 3) the surface of a depth image (H, W) in metres, bright where it faces the camera."""
    points = CAMERA.points(depth_m)
    across, down = np.gradient(points, axis=1), np.gradient(points, axis=0)
    normals = np.cross(across, down)
    facing = np.abs(normals[..., 2]) / np.maximum(np.linalg.norm(normals, axis=-1), 1e-12)
    grey = np.where(depth_m > 0, 40 + 200 * facing, 15)
    return np.repeat(grey[..., None], 3, axis=2).astype(np.uint8)


def clothes(photographer: Photographer) -> np.ndarray:
    """Every garment alone on the mean body, and drawn people."""
    bare, rng = shape_person(np.zeros(len(load_body().basis), np.float32)), np.random.default_rng(3)
    figure = Figure(bare.bare_m, bare.heads_m, female=True)
    upright = rotations(angles(left_raise=18, right_raise=18, left_abduct=-2, right_abduct=-2)[None])[0]
    picture = partial(photographer.picture, quats=upright, joints=False)
    tiles = [picture(bare, yaw_deg=25, caption="unclothed")]
    worn = ORDINARY.tops | ORDINARY.bottoms | HELD_BACK.tops | HELD_BACK.bottoms
    garments = {name: garment for name, (_, garment) in worn.items()} | {"shoes": shoes, "hair": hair}
    for name, garment in garments.items():
        worn = [bare.bare_m + garment(figure, rng), *unworn(figure).values()]
        tiles.append(picture(replace(bare, vertices_m=np.concatenate(worn)), yaw_deg=25, caption=name))
    for name in ("skirt", "coat", "long_hair", "hat", "backpack", "bag"):
        config = replace(NOTHING, haired=1.0, **{name: 1.0})
        turned = 100 if name in ("backpack", "long_hair") else 25
        tiles.append(picture(dress(bare, True, rng, config), yaw_deg=turned, caption=name))
    people = [draw_person(np.random.default_rng(seed), BodyConfig(), "train") for seed in range(18)]
    drawn = [picture(p, yaw_deg=40 * (k % 9) - 160, caption=f"person {k}") for k, p in enumerate(people)]
    rows = [("", tiles[k : k + 9]) for k in range(0, len(tiles), 9)] + [("", drawn[k : k + 9]) for k in range(0, 18, 9)]
    return sheet(rows, (TRUE,), "SIMULATED: garments on the mean body, then people as they are drawn")


def stances(photographer: Photographer) -> np.ndarray:
    """Drawn people in poses of every family."""
    rows = []
    for name in FAMILIES:
        generators = [np.random.default_rng([7, k]) for k in range(9)]
        poses = ProceduralPoses().family(name, generators)
        people = [draw_person(np.random.default_rng(100 + k), BodyConfig(), "train") for k in range(9)]
        shots = zip(people, poses.quats, strict=True)
        rows.append((name, [photographer.picture(p, quats, 15, "", width_px=110) for p, quats in shots]))
    return sheet(rows, (TRUE,), "SIMULATED: families of procedural poses")


if __name__ == "__main__":
    photographer = Photographer()
    save_png(FIGURES / "clothes.png", clothes(photographer))
    save_png(FIGURES / "stances.png", stances(photographer))
