"""Draws docs/figures/props.png: seats, held objects, second people, and people whom the image's border cuts.

python tools/props_figure.py docs/figures/props.png
"""

import sys
from pathlib import Path

import numpy as np

from kpopnet.camera import MM_PER_METRE
from kpopnet.skeleton import Joint
from kpopnet.viz.drawing import TRUE, depth_rgb, draw_skeleton, enlarged, save_png, sheet, with_captions
from synth.motion import MotionConfig
from synth.motion.poses.families import FAMILIES, ProceduralPoses
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


def chosen(families: tuple[str, ...], stage: StageConfig, props: PropsConfig) -> tuple[list[RenderedSample], Sampler]:
    """The samples of a row; of seats and held objects one of each kind comes first."""
    config = SampleConfig(
        motion=MotionConfig("poses"), stage=stage, props=props, renderer="cpu", samples_per_body=1, samples_per_room=1
    )
    sampler = Sampler(config, 0, "train")
    sampler.source = ProceduralPoses({name: FAMILIES[name] for name in families})
    found = [one for one in sampler.samples(0, 300) if one.props or props == NO_PROPS]
    first = {one.props: one for one in reversed(found)}
    kinds = list(first.values()) if len(first) > 1 else []
    others = [one for one in found if all(one is not kind for kind in kinds)]
    return [*kinds, *others][:COLUMNS], sampler


def tile(rendered: RenderedSample, sampler: Sampler) -> np.ndarray:
    """Above: everything but the room. Below: what is segmented as the person, with the true joints."""
    sample, around = rendered.sample, rendered.around
    person_m = sample.depth_mm / np.float32(MM_PER_METRE)
    scene_m = person_m
    for other_m in around.others_m:
        scene_m = np.where((other_m > 0) & ((scene_m == 0) | (other_m < scene_m)), other_m, scene_m)
    skeleton = enlarged(depth_rgb(person_m), TILE_PX)
    draw_skeleton(skeleton, sample.joints_camera_m, sampler.scene.camera, TRUE)
    distance_m = sample.joints_camera_m[Joint.TORSO, 2]
    caption = f"{', '.join(rendered.props).replace('_', ' ') or 'torso'}, {distance_m:.1f} m"
    return np.concatenate([enlarged(depth_rgb(scene_m), TILE_PX), with_captions(skeleton, (caption,))])


if __name__ == "__main__":
    rows = []
    for title, settings in ROWS.items():
        samples, sampler = chosen(*settings)
        rows.append((title, [tile(rendered, sampler) for rendered in samples]))
    save_png(Path(sys.argv[1]), sheet(rows, (TRUE,), "simulated: the people, and what is segmented as the person"))
