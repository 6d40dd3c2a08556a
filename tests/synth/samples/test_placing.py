"""Where people stand: out of walls and furniture, cut by the border as often as asked, and what is around them."""

from dataclasses import replace

import numpy as np
import pytest

from kpopnet.skeleton import Joint
from synth.motion import MotionConfig
from synth.samples.placing import NEAREST_M, StageConfig
from synth.samples.sampler import RenderedSample, SampleConfig, Sampler
from synth.scene.props import NO_PROPS, PropsConfig

CONFIG = SampleConfig(renderer="cpu", motion=MotionConfig(source="poses"))
BUSY = replace(CONFIG, props=PropsConfig(seat=1, held=0.5, second_person=0.5, attached=0.5), samples_per_room=3)


@pytest.fixture(scope="module")
def drawn() -> list[tuple[RenderedSample, bool, float]]:
    """100 samples, whether the body stands in a wall or in furniture, and its lowest point in metres."""
    sampler, found = Sampler(CONFIG, 5, "train"), []
    for rendered in sampler.samples(0, 100):
        skin_m = sampler.renderer.vertices_world_m()
        room, overlaps = sampler.room(rendered.sample.room).site.room, False
        for centre, half, yaw in zip(room.centres_m[1:], room.halves_m[1:], room.yaws_rad[1:], strict=True):
            turn = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
            overlaps |= bool((np.abs((skin_m - centre) @ turn) < half).all(axis=1).any())
        found.append((rendered, overlaps, float(skin_m[:, 2].min())))
    return found


def test_fewer_than_a_hundredth_of_the_people_stand_in_walls_or_furniture(drawn) -> None:
    assert sum(overlaps for _, overlaps, _ in drawn) / len(drawn) < 0.01
    assert min(lowest_m for _, _, lowest_m in drawn) > -1e-5
    assert sum(rendered.refused_places for rendered, _, _ in drawn) > 0
    assert not any(rendered.forced for rendered, _, _ in drawn)


def test_cut_people_keep_their_torso_in_the_image_and_true_joints() -> None:
    sampler = Sampler(replace(CONFIG, stage=StageConfig(cut=1.0), props=NO_PROPS), 1, "train")
    camera, outside = sampler.scene.camera, 0
    for rendered in sampler.samples(0, 30):
        sample = rendered.sample
        expected = sampler.scene.view.to_camera(sampler.scene.joints_world_m())
        np.testing.assert_allclose(sample.joints_camera_m, expected, atol=1e-5)
        assert np.isfinite(sample.joints_camera_m).all() and sample.joints_camera_m[:, 2].min() > NEAREST_M - 0.05
        if rendered.refused_places < sampler.config.stage.place_tries:
            u, v, _ = camera.project(sample.joints_camera_m[Joint.TORSO])
            assert -0.5 <= u <= camera.width - 0.5 and -0.5 <= v <= camera.height - 0.5
            x0, y0, x1, y1 = sample.box
            outside += x0 == 0 or y0 == 0 or x1 == camera.width or y1 == camera.height
        assert np.count_nonzero(sample.depth_mm) >= sampler.config.stage.least_pixels
    assert outside > 20


def test_props_change_the_image_but_not_the_person() -> None:
    bare, busy = (Sampler(replace(BUSY, props=props), 3, "train").samples(0, 20) for props in (NO_PROPS, BUSY.props))
    hidden = added = 0
    for one, other in zip(bare, busy, strict=True):
        if one.refused_places != other.refused_places:  # a prop hid the person: another place was drawn
            continue
        assert np.array_equal(one.sample.joints_camera_m, other.sample.joints_camera_m)
        assert (one.sample.visible | ~other.sample.visible).all()  # nothing becomes visible
        hidden += ((one.sample.depth_mm > 0) & (other.sample.depth_mm != one.sample.depth_mm)).any()
        added += ((one.sample.depth_mm == 0) & (other.sample.depth_mm > 0)).any()
        if not other.props:
            assert np.array_equal(one.sample.depth_mm, other.sample.depth_mm)
    assert hidden >= 3 and added >= 3
