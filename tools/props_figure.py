"""Draws docs/figures/props.png: seats, held objects, second people, and people whom the image's border cuts.

python tools/props_figure.py docs/figures/props.png
"""

import sys
from itertools import islice
from pathlib import Path

import numpy as np

from kpopnet.camera import MM_PER_METRE
from kpopnet.skeleton import Joint
from kpopnet.viz.drawing import TRUE, depth_rgb, draw_skeleton, enlarged, save_png, sheet, with_captions
from synth.motion import MotionConfig
from synth.motion.poses import FAMILIES, ProceduralPoses
from synth.samples.placing import StageConfig
from synth.samples.sampler import RenderedSample, SampleConfig, Sampler
from synth.scene.props import NO_PROPS, PropsConfig

TILE_PX, COLUMNS = 190, 6
UPRIGHT = ("standing", "free_arms", "dancing")
NEAR = StageConfig(cut=0, distance_m=(1.8, 3.2))
ROWS = {
    "on a seat": (("squat",), NEAR, PropsConfig(seat=1, held=0, second_person=0, attached=0.5)),
    "holding something": (UPRIGHT, NEAR, PropsConfig(seat=0, held=1, second_person=0, attached=0)),
    "with a second person": (UPRIGHT, NEAR, PropsConfig(seat=0, held=0, second_person=1, attached=1)),
    "cut by the border": (UPRIGHT, StageConfig(cut=1), NO_PROPS),
}
"""Title of a row, its families of poses, where people stand, and what is around them."""


def row(families: tuple[str, ...], stage: StageConfig, props: PropsConfig) -> list[np.ndarray]:
    """The first samples with something around the person, or without props the first ones."""
    config = SampleConfig(
        motion=MotionConfig("poses"), stage=stage, props=props, renderer="cpu", samples_per_body=1, samples_per_room=1
    )
    sampler = Sampler(config, 0, "train")
    sampler.source = ProceduralPoses({name: FAMILIES[name] for name in families})
    shown = (tile(one, sampler) for one in sampler.samples(0, 300) if props == NO_PROPS or not one.around.is_empty)
    return list(islice(shown, COLUMNS))


def tile(rendered: RenderedSample, sampler: Sampler) -> np.ndarray:
    """Above: everything but the room. Below: what is segmented as the person, with the true joints."""
    sample = rendered.sample
    scene_m = person_m = sample.depth_mm / np.float32(MM_PER_METRE)
    for other_m in rendered.around.others_m:
        scene_m = np.where((other_m > 0) & ((scene_m == 0) | (other_m < scene_m)), other_m, scene_m)
    skeleton = enlarged(depth_rgb(person_m), TILE_PX)
    draw_skeleton(skeleton, sample.joints_camera_m, sampler.scene.camera, TRUE)
    caption = f"torso at {sample.joints_camera_m[Joint.TORSO, 2]:.1f} m"
    return np.concatenate([enlarged(depth_rgb(scene_m), TILE_PX), with_captions(skeleton, (caption,))])


if __name__ == "__main__":
    rows = [(title, row(*settings)) for title, settings in ROWS.items()]
    save_png(Path(sys.argv[1]), sheet(rows, (TRUE,), "simulated: the people, and what is segmented as the person"))
