"""Human extraction on rendered people in furnished rooms through a simulated Kinect, and on real depth."""

import numpy as np
import pytest
from extraction_scenes import iou
from real_data import REAL, UTD_MHAD

from kpopnet.camera import Camera
from kpopnet.extraction import HumanExtractor
from kpopnet.pose.extraction import extract_person
from synth.scene.room import LIVING_ROOM
from synth.simulated.eval_sim import EvalSim, EvalSimConfig
from synth.simulated.film import Shot, Take

CAMERA = EvalSim.camera

ITOP = REAL / "itop_side_test_3frames.npz"
FRAME_STEP = 3
FEET_HEIGHT_M = 0.12


@pytest.fixture
def maker(monkeypatch) -> EvalSim:
    """In rooms with the furniture that the extraction was developed with; elsewhere it takes steps or a piano for a person in
    2 of 72 films (docs/results.md)."""
    monkeypatch.setattr("synth.simulated.sequences.DANCE_HALL", LIVING_ROOM)
    return EvalSim(EvalSimConfig(seed=90210))


def filmed(maker: EvalSim, kind: str) -> tuple[Take, list[Shot]]:
    """A whole sequence at a third of its frame rate."""
    index = maker.kinds.index(kind)
    take = maker.take(index)
    return take, list(maker.shots(index, take, range(0, len(take.played), FRAME_STEP)))


def heights_m(depth_m: np.ndarray, floor: np.ndarray) -> np.ndarray:
    return CAMERA.points(depth_m) @ floor[:3] + floor[3]


@pytest.mark.parametrize("kind", ["dance", "sitting", "handstand", "kicks"])
def test_a_dancer_in_a_furnished_room_is_never_lost_and_no_other_person_is_found(maker, kind):
    take, shots = filmed(maker, kind)
    floor = take.view.floor()
    extractor, ious, feet = HumanExtractor(CAMERA, expect_person=True), [], []
    for shot in shots:
        (human,) = extractor.extract(shot.depth_m)
        assert human.identity == 0
        found = human.whole(CAMERA) > 0
        ious.append(iou(found, shot.person))
        low = shot.person & (heights_m(shot.depth_m, floor) < FEET_HEIGHT_M)
        feet.append((found & low).sum() / max(low.sum(), 1))
        assert extractor.floor[:3] @ floor[:3] > np.cos(np.radians(0.7))
        assert extractor.floor[3] == pytest.approx(floor[3], abs=0.05)
    assert np.mean(ious) > 0.975
    assert min(ious) > 0.9
    assert np.mean(feet) > 0.6


def test_a_person_is_found_soon_after_the_first_movement_and_not_before(maker):
    _, shots = filmed(maker, "dance")
    extractor = HumanExtractor(CAMERA)
    assert not extractor.extract(shots[0].depth_m)
    found = [extractor.extract(shot.depth_m) for shot in shots[1:]]
    first = next(index for index, humans in enumerate(found) if humans)
    assert all(len(humans) == 1 for humans in found[first:])
    assert first * FRAME_STEP < 60  # the pose is held for a second, with slight sway
    pairs = zip(found[first + 5 :], shots[first + 6 :], strict=True)
    assert np.mean([iou(humans[0].whole(CAMERA) > 0, shot.person) for humans, shot in pairs]) > 0.97


@pytest.mark.skipif(not ITOP.is_file(), reason="the real depth data is not available")
@pytest.mark.parametrize("frame", range(3))
def test_a_real_person_in_a_real_room_is_found_in_a_single_image(frame):
    stored = np.load(ITOP)
    depth_m = stored["depth_mm"][frame].astype(np.float32) / 1000
    camera = Camera.centred(285.714, 320, 240)
    extractor = HumanExtractor(camera, expect_person=True)
    (human,) = extractor.extract(depth_m)
    assert extractor.floor is not None and 1.1 < extractor.floor[3] < 1.4
    # The labelled joints lie slightly behind the visible surface, except those occluded by a leg.
    joints = stored["joints_m"][frame] * [1, -1, 1]
    u, v = np.rint(camera.project(joints)[:, :2]).astype(int).T
    found = human.whole(camera)[v, u]
    assert (found > 0).mean() > 0.9
    assert np.median(np.abs(joints[found > 0, 2] - found[found > 0])) < 0.12
    assert human.whole(camera).astype(bool).mean() < 0.2


@pytest.mark.skipif(not (UTD_MHAD / "Depth").is_dir(), reason="the real depth data is not available")
@pytest.mark.parametrize("name", ["a1_s1_t1", "a22_s3_t1", "a27_s1_t1"])
def test_real_people_without_background_are_extracted_completely(name):
    from kpopnet.datasets.utd_mhad import UtdMhadBenchmark, UtdMhadConfig

    sequence = UtdMhadBenchmark(UtdMhadConfig(path=str(UTD_MHAD), lag=0)).read(name)
    extracted = extract_person(sequence.depth_m, sequence.camera)
    shares = [(a > 0).sum() / (d > 0).sum() for a, d in zip(extracted, sequence.depth_m, strict=True)]
    assert min(shares) > 0.95
