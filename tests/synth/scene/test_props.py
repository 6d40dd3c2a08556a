"""Meshes of solids, seats under sitting people and objects in hands."""

import numpy as np
import pytest

from kpopnet.skeleton import Joint
from synth.motion.poses import FAMILIES, ProceduralPoses
from synth.samples.placing import StageConfig
from synth.samples.sampler import SampleConfig, Sampler
from synth.scene import props
from synth.scene.mesh import Mesh, ball, boxes, rod
from synth.scene.props import NO_PROPS, held_by, is_sitting, platform_under, seat_under


def volume_m3(mesh: Mesh) -> float:
    """Volume by the divergence theorem: positive only if faces are counter-clockwise from outside, and closed."""
    a, b, c = (mesh.vertices_m[mesh.faces[:, k]] for k in range(3))
    return float((a * np.cross(b, c)).sum() / 6)


def test_solids_are_closed_and_face_outwards() -> None:
    assert volume_m3(boxes([((1, 2, 3), (0.5, 0.25, 2))])) == pytest.approx(2.0)
    twelve_sided = 3.0 * 0.1**2  # area of a regular dodecagon with circumradius 0.1
    assert volume_m3(rod(0.1, 0.5)) == pytest.approx(twelve_sided)
    assert 0.8 < volume_m3(ball(0.1)) / (4 / 3 * np.pi * 0.001) < 1


@pytest.fixture(scope="module")
def squatting() -> Sampler:
    stage = StageConfig(cut=0, distance_m=(2.5, 3.5))
    sampler = Sampler(SampleConfig(stage=stage, props=NO_PROPS, renderer="cpu", samples_per_body=10), 2, "train")
    sampler.source = ProceduralPoses({"squat": FAMILIES["squat"]})
    return sampler


def test_a_seat_touches_a_sitting_person_from_below_and_does_not_cut_the_legs(
    squatting: Sampler, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene, sitting, found, chairs = squatting.scene, 0, 0, 0
    for index, _ in enumerate(squatting.samples(0, 60)):
        joints_m, skin_m = scene.joints_world_m(), squatting.renderer.vertices_world_m()
        if not is_sitting(joints_m):
            continue
        sitting += 1
        if (seat := seat_under(np.random.default_rng(index), scene, skin_m)) is None:
            continue
        found, vertices = found + 1, seat.vertices_m
        hips_m = joints_m[[Joint.LEFT_HIP, Joint.RIGHT_HIP]].mean(axis=0)
        assert vertices[:, 2].min() == pytest.approx(0, abs=1e-6)
        low, high = vertices[:, :2].min(axis=0), vertices[:, :2].max(axis=0)
        assert (low < hips_m[:2]).all() and (hips_m[:2] < high).all()  # the hips are above the seat
        below_m = hips_m[2] - vertices[:, 2]
        assert ((below_m > 0) & (below_m < 0.2)).any()  # and just above it
        inside = (skin_m[:, 2] < hips_m[2] - 0.25) & (np.abs(skin_m[:, :2] - hips_m[:2]) < 0.01).all(axis=1)
        assert not inside.any()
        with monkeypatch.context() as only:
            only.setattr(props, "SEATS", (props.chair,))
            if (chair := seat_under(np.random.default_rng(index), scene, skin_m)) is not None:
                back_m = chair.vertices_m[chair.vertices_m[:, 2] > hips_m[2] + 0.1, :2] - hips_m[:2]
                forward_m = back_m @ scene.facing_world()[:2]
                assert forward_m.max() < -0.1 and np.ptp(forward_m) < 0.05  # its back is behind the person, across
                chairs += 1
    assert sitting >= 6 and found >= 2 and chairs


@pytest.mark.parametrize("left", [True, False])
def test_held_objects_are_at_the_palm_of_either_hand(squatting: Sampler, left: bool) -> None:
    scene, along_m = squatting.scene, []
    scene.set_person(squatting.person(0))
    scene.pose(np.tile([1.0, 0, 0, 0], (len(scene.asset.bone_names), 1)), np.array([1.0, 2.0, 1.2]))  # the T-pose
    for seed in range(60):
        held = held_by(np.random.default_rng(seed), scene, left)
        own = held.vertices_m - scene.joints_world_m()[Joint.LEFT_HAND if left else Joint.RIGHT_HAND]
        assert volume_m3(held) > 0
        assert (own.min(axis=0) < 0.05).all() and (own.max(axis=0) > -0.05).all()
        assert own[:, 2].max() < 0.01  # the palms face down
        along_m.append(own[:, 0].mean() * (1 if left else -1))
    assert min(along_m) > -1e-6 and max(along_m) > 0.04  # a book reaches along the fingers


def seated(**moved: tuple[float, float, float]) -> np.ndarray:
    """(15, 3) joints of a person on a chair who faces -y, of which some are elsewhere."""
    places = {"NECK": (0, 0, 1.0)}
    for side, x in (("LEFT", 0.1), ("RIGHT", -0.1)):
        places |= {f"{side}_HIP": (x, 0, 0.5), f"{side}_KNEE": (x, -0.4, 0.5), f"{side}_FOOT": (x, -0.4, 0.1)}
    joints_m = np.zeros((len(Joint), 3))
    for name, place in (places | moved).items():
        joints_m[Joint[name]] = place
    return joints_m


def test_who_sits_has_low_hips_level_thighs_feet_beneath_and_an_upright_trunk() -> None:
    assert is_sitting(seated())
    assert not is_sitting(seated(NECK=(0, -0.5, 0.6)))  # bends over
    assert not is_sitting(seated(LEFT_FOOT=(0.1, -0.8, 0.45)))  # a leg stretched out
    assert not is_sitting(seated(LEFT_KNEE=(0.1, -0.1, 0.1)))  # kneels
    assert not any(is_sitting(seated() + np.array([0, 0, off_m])) for off_m in (-0.3, 0.3))


def test_a_platform_lies_just_beneath_what_it_carries() -> None:
    low_m, high_m = np.array([-0.3, 2.0]), np.array([0.6, 2.5])
    vertices = platform_under(np.random.default_rng(1), low_m, high_m, 0.4).vertices_m
    assert vertices[:, 2].min() == 0 and vertices[:, 2].max() == pytest.approx(0.38)
    beyond_m = np.concatenate([low_m - vertices[:, :2].min(axis=0), vertices[:, :2].max(axis=0) - high_m])
    assert (beyond_m >= 0).all() and (beyond_m < 0.4).all()
