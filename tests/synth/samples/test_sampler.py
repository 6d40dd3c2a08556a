"""Samples: what they depend on, where people stand, what is around them, and the consistency of labels and depth image."""

from dataclasses import fields, replace

import numpy as np
import pytest
from fingerprints import fingerprint

from kpopnet.rotations import rotate
from kpopnet.skeleton import Joint
from synth.body.asset import load_body
from synth.body.outfit import ClothesConfig
from synth.body.shape import BodyConfig
from synth.motion import MotionConfig, Poses
from synth.motion.posture import STANDING, rotations
from synth.motion.skeleton import LEG_M, NUM_JOINTS, on_floor_m
from synth.samples.placing import NEAREST_M, StageConfig
from synth.samples.sampler import RenderedSample, SampleConfig, Sampler, body_rotations, heading_rad
from synth.samples.writer import GENERATOR
from synth.scene.mesh import about_z
from synth.scene.props import NO_PROPS, PropsConfig

CONFIG = SampleConfig(renderer="cpu", motion=MotionConfig(source="poses"), samples_per_body=4, samples_per_room=10)


BUSY = replace(CONFIG, props=PropsConfig(seat=1, held=0.5, second_person=0.5, attached=0.5), samples_per_room=3)


@pytest.fixture(scope="module")
def sampler() -> Sampler:
    return Sampler(CONFIG, 7, "train")


def same(a: RenderedSample, b: RenderedSample) -> bool:
    return all(np.array_equal(getattr(a.sample, one.name), getattr(b.sample, one.name)) for one in fields(a.sample))


@pytest.mark.parametrize("props", [NO_PROPS, BUSY.props])
def test_a_sample_does_not_depend_on_the_other_samples_drawn(props: PropsConfig) -> None:
    config = replace(CONFIG, props=props, samples_per_room=3)
    batch = list(Sampler(config, 7, "train").samples(0, 30))
    assert all(one.around.is_empty for one in batch) == (props == NO_PROPS)
    for index in (17, 3, 29):
        (single,) = Sampler(config, 7, "train").samples(index, index + 1)
        assert same(single, batch[index]), index


@pytest.mark.parametrize(("seed", "split"), [(8, "train"), (7, "test"), (7, "validation")])
def test_seed_and_split_change_every_sample_and_room(sampler: Sampler, seed: int, split: str) -> None:
    other = Sampler(CONFIG, seed, split)
    assert not any(same(a, b) for a, b in zip(sampler.samples(0, 6), other.samples(0, 6), strict=True))
    assert not np.array_equal(sampler.room(0).depth_mm, other.room(0).depth_mm)


def test_visible_joints_and_the_box_lie_on_the_person(sampler: Sampler) -> None:
    camera = sampler.scene.camera
    visible = 0
    for rendered in sampler.samples(0, 40):
        sample = rendered.sample
        u, v, z = camera.project(sample.joints_camera_m).T
        for joint in np.flatnonzero(sample.visible):
            seen_m = sample.depth_mm[round(v[joint]), round(u[joint])] / 1000
            assert seen_m > 0 and seen_m < z[joint] + 0.05, (Joint(joint), sample.motion)
            visible += 1
        x0, y0, x1, y1 = sample.box
        assert np.count_nonzero(sample.depth_mm[y0:y1, x0:x1]) == np.count_nonzero(sample.depth_mm)
        assert sample.depth_mm[y0].any() and sample.depth_mm[y1 - 1].any()
        assert sample.depth_mm[:, x0].any() and sample.depth_mm[:, x1 - 1].any()
    assert visible > 40 * 8


def test_people_stand_on_the_floor_and_not_in_walls_or_furniture(sampler: Sampler) -> None:
    refused = 0
    for rendered in sampler.samples(0, 60):
        skin_m = sampler.renderer.vertices_world_m()
        room = sampler.room(rendered.sample.room).room
        for centre, half, yaw in zip(room.centres_m[1:], room.halves_m[1:], room.yaws_rad[1:], strict=True):
            assert not (np.abs((skin_m - centre) @ about_z(yaw)) < half).all(axis=1).any()
        assert skin_m[:, 2].min() > -1e-5 and not rendered.forced
        refused += rendered.refused_places
    assert refused > 0


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
        if other.around.is_empty:
            assert np.array_equal(one.sample.depth_mm, other.sample.depth_mm)
    assert hidden >= 3 and added >= 3


def test_another_person_hides_at_most_half_of_a_person() -> None:
    joined = PropsConfig(seat=0, held=0, second_person=1, attached=0)
    alone, before = (Sampler(replace(CONFIG, props=props), 3, "train").samples(20, 40) for props in (NO_PROPS, joined))
    pairs = [(one, two) for one, two in zip(alone, before, strict=True) if one.refused_places == two.refused_places]
    seen = [np.count_nonzero(two.sample.depth_mm) / np.count_nonzero(one.sample.depth_mm) for one, two in pairs]
    assert 0.5 <= min(seen) < 0.7 and max(seen) == 1


def test_fingers_flex_towards_the_palms() -> None:
    asset = load_body()
    local = body_rotations(asset, np.tile([1.0, 0, 0, 0], (NUM_JOINTS, 1)), 0.0, np.array([0.5, 1.0]))
    for side, outwards, curl in (("Left", 1.0, 0.5), ("Right", -1.0, 1.0)):
        fingers = rotate(local[asset.bone(f"{side}HandFinger1")], np.array([outwards, 0, 0]))
        np.testing.assert_allclose(fingers, (outwards * np.cos(1.4 * curl), 0, -np.sin(1.4 * curl)), atol=1e-9)


class Standing:
    """A source of poses: upright, half a metre above the floor."""

    def poses(self, generators: list[np.random.Generator]) -> Poses:
        count = len(generators)
        quats = np.repeat(rotations(STANDING[None]), count, axis=0)
        root_m = on_floor_m(quats) + np.float32((0, 0.5, 0))
        return Poses(quats, root_m, np.full(count, LEG_M, np.float32), ["standing"] * count)


def test_a_jump_is_as_high_in_proportion_to_the_legs_and_who_faces_the_camera_does_so_as_far_as_asked() -> None:
    sampler = Sampler(replace(CONFIG, stage=StageConfig(turned=0, turn_deg=4, off_centre=0), props=NO_PROPS), 5, "train")
    sampler.source, yaws_rad = Standing(), []
    for rendered in sampler.samples(0, 16):
        jump_m = 0.5 * sampler.scene.person.leg_m / LEG_M
        assert sampler.renderer.vertices_world_m()[:, 2].min() == pytest.approx(jump_m, abs=1e-4)
        if abs(rendered.sample.joints_camera_m[Joint.TORSO, 0]) < 0.1:  # those whom the border cuts are anywhere
            yaws_rad.append(rendered.sample.yaw_rad)
    assert len(yaws_rad) > 8 and 1 < np.degrees(np.std(yaws_rad)) < 8


def test_who_is_seen_nowhere_is_forced() -> None:
    stage = StageConfig(cut=0, place_tries=3, least_pixels=10**6, distance_m=(2.5, 3.5), off_centre=0.1)
    forced = [one for one in Sampler(replace(CONFIG, stage=stage, props=NO_PROPS), 7, "train").samples(0, 12) if one.forced]
    assert len(forced) > 2 and all(one.refused_places == 3 for one in forced)


def test_yaw_is_the_heading_relative_to_the_camera(sampler: Sampler) -> None:
    scene = sampler.scene
    sampler.room(0)
    list(sampler.samples(0, 1))
    straight = np.tile([1.0, 0, 0, 0], (len(scene.asset.bone_names), 1))
    for turn in (0.0, 0.7, -2.0):
        straight[0] = np.cos(turn / 2), 0, 0, np.sin(turn / 2)
        scene.pose(straight, np.array([0, 3.0, 1.0]))
        assert heading_rad(scene) == pytest.approx(turn, abs=1e-6)


def test_self_penetration_is_rejected_and_the_number_of_tries_is_limited() -> None:
    sampler = Sampler(replace(CONFIG, stage=StageConfig(tries=2, penetration_m=0.0), props=NO_PROPS), 7, "train")
    rejected = set()
    for rendered in sampler.samples(0, 60):
        rejected.add(rendered.rejected)
        assert rendered.forced == (rendered.rejected == 2) == (sampler.scene.penetration_m() > 0)
    assert rejected == {0, 1, 2}


def test_a_seed_generates_the_samples_that_it_generated() -> None:
    """Sets are published by their seeds: other samples need another version of the generator, and numbers here."""
    bare = BodyConfig(clothes=ClothesConfig(**dict.fromkeys(vars(ClothesConfig()), 0.0)))
    config = replace(
        BUSY, body=bare, motion=MotionConfig(dances=3, seconds=4.0), stage=StageConfig(cut=0.5), samples_per_body=2
    )
    sampler = Sampler(config, 11, "validation")
    for rendered, expected in zip(sampler.samples(0, 6), PUBLISHED[GENERATOR], strict=True):
        sample, site = rendered.sample, sampler.room(rendered.sample.room)
        counts = rendered.rejected, rendered.refused_places, int(sample.visible.sum()), len(rendered.around.others_m)
        numbers = fingerprint(sample.joints_camera_m, [sample.yaw_rad], site.floor), float(site.depth_mm.mean())
        assert (sample.motion, *counts) == expected[:5]
        assert (np.count_nonzero(sample.depth_mm), *numbers) == pytest.approx(expected[5:], abs=0.003, rel=1e-3)


PUBLISHED = {
    4: [
        ("pose:kneel", 1, 0, 10, 1, 5573, 4.3677, 4164.6493),
        ("pose:free_arms", 0, 1, 7, 0, 7894, 1.1683, 4164.6493),
        ("pose:broad", 1, 0, 12, 1, 4755, 5.9339, 4164.6493),
        ("pose:kick", 0, 0, 6, 1, 1081, 1.5808, 4639.0029),
        ("choreography:1-2@3.7s", 0, 0, 14, 0, 4174, 2.1285, 4639.0029),
        ("pose:free_arms", 0, 6, 15, 1, 2660, 1.108, 4639.0029),
    ]
}
