"""Draws pictures of docs/generating.md: what is simulated.

python tools/people_figures.py                 # clothes, stances, props
python tools/people_figures.py data/rooms      # rooms: a frame of the first film of each kind of scene, and single images
"""

import argparse
from dataclasses import replace
from functools import partial
from itertools import islice
from pathlib import Path

import numpy as np

from kpopnet.camera import MM_PER_METRE, Camera
from kpopnet.datasets.protocol import BenchmarkConfig
from kpopnet.datasets.simulated import PeopleSet
from kpopnet.runtime.endings import user_errors
from kpopnet.skeleton import Joint
from kpopnet.viz.drawing import TRUE, depth_rgb, draw_skeleton, enlarged, save_png, sheet, with_captions
from synth.body.asset import load_body
from synth.body.garments import HELD_BACK, ORDINARY, Figure, hair, shoes
from synth.body.outfit import ClothesConfig, unworn
from synth.body.shape import BodyConfig, Person, draw_person, dress, shape_person
from synth.motion import MotionConfig
from synth.motion.poses import FAMILIES, ProceduralPoses
from synth.motion.posture import angles, rotations
from synth.samples.placing import StageConfig
from synth.samples.sampler import RenderedSample, SampleConfig, Sampler, body_rotations
from synth.scene.props import NO_PROPS, PropsConfig
from synth.scene.render import CpuRenderer
from synth.scene.room import posed_view
from synth.scene.scene import Scene
from synth.simulated.rooms import SINGLE
from synth.simulated.sequences import frame_tile

FIGURES = Path(__file__).resolve().parents[1] / "docs" / "figures"
CAMERA = Camera.centred(420.0, 260, 320)
DISTANCE_M, HEIGHT_M = 2.9, 0.95
NOTHING = ClothesConfig(**dict.fromkeys(vars(ClothesConfig()), 0.0))

UPRIGHT = ("standing", "free_arms", "dancing")
NEAR = StageConfig(cut=0, distance_m=(1.8, 3.2))
PROPS = {
    "on a seat": (("squat",), NEAR, PropsConfig(seat=1, held=0, second_person=0, attached=0.5)),
    "holding something": (UPRIGHT, NEAR, PropsConfig(seat=0, held=1, second_person=0, attached=0)),
    "with a second person": (UPRIGHT, NEAR, PropsConfig(seat=0, held=0, second_person=1, attached=1)),
    "cut by the border": (UPRIGHT, StageConfig(cut=1), NO_PROPS),
}
"""Title of a row, its families of poses, where people stand, and what is around them."""


class Photographer:
    """Draws people before an empty background, lit from the camera."""

    def __init__(self) -> None:
        self.scene = Scene(CAMERA)
        self.scene.set_view(posed_view(np.array([0, -DISTANCE_M, HEIGHT_M]), 0.0, 0.0))
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
    bare, rng = shape_person(np.zeros(len(load_body().basis), np.float32), load_body()), np.random.default_rng(3)
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
    rows = [("", tiles[k : k + 9]) for k in range(0, len(tiles), 9)]
    for who, children, first in (("person", 0.0, 0), ("person", 0.0, 9), ("child", 1.0, 0)):
        body, numbers = BodyConfig(children=children, clothes=ClothesConfig(dressed=1.0)), range(first, first + 9)
        people = [draw_person(np.random.default_rng(number), body, "train") for number in numbers]
        turned = zip(people, numbers, strict=True)
        rows.append(("", [picture(p, yaw_deg=40 * (k % 9) - 160, caption=f"{who} {k}") for p, k in turned]))
    return sheet(
        rows, (TRUE,), "SIMULATED: garments on the mean body, then people as they are drawn, then children of 6 to 12 years"
    )


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


def props() -> np.ndarray:
    """Seats, held objects, second people, and people whom the image's border cuts."""
    rows = []
    for title, (families, stage, around) in PROPS.items():
        config = SampleConfig(
            motion=MotionConfig("poses"), stage=stage, props=around, renderer="cpu", samples_per_body=1, samples_per_room=1
        )
        sampler = Sampler(config, 0, "train")
        sampler.source = ProceduralPoses({name: FAMILIES[name] for name in families})
        shown = (one for one in sampler.samples(0, 300) if around == NO_PROPS or not one.around.is_empty)
        rows.append((title, [props_tile(one, sampler.scene.camera) for one in islice(shown, 6)]))
    return sheet(rows, (TRUE,), "simulated: the people, and what is segmented as the person")


def props_tile(rendered: RenderedSample, camera: Camera) -> np.ndarray:
    """Above: everything but the room. Below: what is segmented as the person, with the true joints."""
    sample = rendered.sample
    scene_m = person_m = sample.depth_mm / np.float32(MM_PER_METRE)
    for other_m in rendered.around.others_m:
        scene_m = np.where((other_m > 0) & ((scene_m == 0) | (other_m < scene_m)), other_m, scene_m)
    skeleton = enlarged(depth_rgb(person_m), 190)
    draw_skeleton(skeleton, sample.joints_camera_m, camera, TRUE)
    caption = f"torso at {sample.joints_camera_m[Joint.TORSO, 2]:.1f} m"
    return np.concatenate([enlarged(depth_rgb(scene_m), 190), with_captions(skeleton, (caption,))])


def rooms(folder: str) -> np.ndarray:
    films, tiles, kinds = PeopleSet(BenchmarkConfig("rooms", folder)), [], []
    for name in films.names:
        stored = films.read(name)
        if kinds.count(stored.kind) < (12 if stored.kind == SINGLE else 1):
            kinds.append(stored.kind)
            tiles.append(frame_tile(stored, len(stored.depth) // 2, stored.kind.replace("_", " ")))
    return sheet([("", tiles[first : first + 5]) for first in range(0, len(tiles), 5)], (TRUE,), "SIMULATED: rooms")


@user_errors
def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rooms", nargs="?", help="folder of a set of rooms: its picture instead of the others")
    given = parser.parse_args()
    if given.rooms is not None:
        save_png(FIGURES / "rooms.png", rooms(given.rooms))
    else:
        photographer = Photographer()
        save_png(FIGURES / "clothes.png", clothes(photographer))
        save_png(FIGURES / "stances.png", stances(photographer))
        save_png(FIGURES / "props.png", props())


if __name__ == "__main__":
    main()
