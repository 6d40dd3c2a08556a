"""The figures of the acceptance sheet on sequences of joints whose answers are known."""

from dataclasses import replace

import numpy as np
import pytest
from cone_people import cone_joints
from scipy.spatial.transform import Rotation
from two_people_files import write_two_people

from kpopnet.camera import Camera
from kpopnet.datasets.check_script import step_s
from kpopnet.errors import InputError
from kpopnet.evaluation.acceptance.figures import exchanges, false_people, figures, script_fault
from kpopnet.evaluation.acceptance.watched import Kept, Watched, stored_truth, surfaces_m2
from kpopnet.skeleton import MIRROR, Joint

FPS = 30
IN_VIEW_S, AWAY_S = (10.0, 45.0), 52.0
PERSON_M = cone_joints().astype(np.float32)


def at(seconds: float) -> int:
    return round(seconds * FPS)


@pytest.fixture
def run() -> Watched:
    """A minute without a fault: a person is in view from 10 s to 45 s and from 52 s on, 20 ms behind."""
    times_s = np.arange(60 * FPS) / FPS
    in_view = ((times_s >= IN_VIEW_S[0]) & (times_s < IN_VIEW_S[1])) | (times_s >= AWAY_S)
    joints_m = np.where(in_view[:, None, None], PERSON_M, np.float32(np.nan))
    people_m = [[PERSON_M] if one else [] for one in in_view]
    delays_s = np.full(len(times_s), 0.02)
    known = joints_m, people_m, in_view, ~in_view, {}, joints_m.copy()
    return Watched("minute", "any", times_s, delays_s, delays_s / 2, len(times_s), *known)


def missing(run: Watched, *spans_s: tuple[float, float]) -> Watched:
    """The run without joints from one time to another."""
    joints_m = run.joints_m.copy()
    for start_s, end_s in spans_s:
        joints_m[at(start_s) : at(end_s)] = np.nan
    return replace(run, joints_m=joints_m)


def test_a_faultless_minute(run: Watched) -> None:
    found = figures([run])
    assert found["images_in_s"] == pytest.approx(FPS) and found["images_out_s"] == pytest.approx(FPS)
    assert [found[f"delay_{one}_ms"] for one in ("p50", "p95", "p99", "longest")] == pytest.approx([20] * 4)
    assert found["processor_p95_ms"] == pytest.approx(10)
    assert found["empty_s"] == pytest.approx(17) and found["availability"] == 1
    for key in ("stale_images", "false_people", "found_first_ms", "found_again_ms", "longest_gap_ms", "exchanges"):
        assert found[key] == 0
    for key in ("jitter_core_mm", "jitter_ends_mm", "mean_error_mm", "ends_error_mm"):
        assert found[key] == pytest.approx(0, abs=1e-3)


def test_delays_and_dropped_images(run: Watched) -> None:
    delays_s = np.full(len(run.times_s), 0.02)
    delays_s[:36] = 0.16  # 2 % of 1800
    found = figures([replace(run, delays_s=delays_s, received=2 * len(run.times_s))])
    assert found["stale_images"] == 36
    assert [found[f"delay_{one}_ms"] for one in ("p99", "p95")] == pytest.approx([160, 20])
    assert found["images_in_s"] == pytest.approx(2 * FPS, rel=1e-3) and found["images_out_s"] == pytest.approx(FPS)
    fast = figures([replace(run, delays_s=np.full(len(run.times_s), np.nan))])
    assert fast["delay_p95_ms"] is fast["images_out_s"] is fast["stale_images"] is None and fast["availability"] == 1


def test_gaps_and_times_until_found(run: Watched) -> None:
    found = figures([missing(run, (10.0, 10.4), (30.0, 30.5), (31.0, 31.2), (52.0, 52.8))])
    assert found["found_first_ms"] == pytest.approx(400) and found["found_again_ms"] == pytest.approx(800)
    assert found["longest_gap_ms"] == pytest.approx(500)
    assert found["availability"] == pytest.approx(1 - 1.9 / 43)
    never = figures([missing(run, (52.0, 60.0))])
    assert never["found_again_ms"] == np.inf and never["longest_gap_ms"] == 0  # it is no gap, no person was found before
    alone = figures([replace(run, in_view=run.in_view & (run.times_s < 50))])
    assert alone["found_again_ms"] is None and alone["found_first_ms"] == 0


def test_dropped_images_weigh_as_long_as_the_answer_before_them_was_the_newest(run: Watched) -> None:
    """Joints are missing in one image, after which a second passes without another."""
    run = missing(run, (20.0, 20.0 + 1 / FPS))
    kept = np.ones(len(run.times_s), bool)
    kept[at(20.0) + 1 : at(21.0)] = False
    arrays = {name: getattr(run, name)[kept] for name in ("times_s", "joints_m", "in_view", "empty", "truth_m")}
    people_m = [one for one, keep in zip(run.people_m, kept, strict=True) if keep]
    found = figures([replace(run, people_m=people_m, **arrays)])
    assert found["availability"] == pytest.approx(1 - 1 / 43) and found["longest_gap_ms"] == pytest.approx(1000)


def test_false_people_are_counted_by_appearance(run: Watched) -> None:
    people_m = [list(one) for one in run.people_m]
    for number in (*range(30, 90), *range(120, 123), at(48.0)):
        people_m[number] = [PERSON_M]
    run = replace(run, people_m=people_m)
    assert false_people(run) == [30, 120, at(48.0)] and figures([run, run])["false_people"] == 6


def exchanged(run: Watched, joints: tuple[str, ...], start_s: float, end_s: float) -> Watched:
    """The run in which the joints of these names change sides for a while."""
    joints_m, columns = run.joints_m.copy(), [joint for joint in Joint if joint.name.endswith(joints)]
    joints_m[at(start_s) : at(end_s), columns] = joints_m[at(start_s) : at(end_s)][:, MIRROR[columns]]
    return replace(run, joints_m=joints_m)


@pytest.mark.parametrize("joints", [("SHOULDER", "ELBOW", "HAND"), ("HIP", "KNEE", "FOOT"), tuple(one.name for one in Joint)])
@pytest.mark.parametrize("truth", [True, False])
def test_exchanges_of_sides_there_and_back(run: Watched, joints: tuple[str, ...], truth: bool) -> None:
    run = run if truth else replace(run, truth_m=None)
    assert exchanges(exchanged(run, joints, 20.0, 25.0)) == [at(20.0), at(25.0)]
    assert exchanges(exchanged(run, joints, 52.0, 60.0)) == ([at(52.0)] if truth else [])  # else they were not known before
    assert exchanges(missing(exchanged(run, joints, 20.0, 25.0), (25.0, 25.2))) == [at(20.0), at(25.2)]


def test_turning_around_is_no_exchange(run: Watched) -> None:
    """Once around in six seconds: left and right change places in the image, not on the person."""
    angle_deg, middle_m = 360 * np.clip((run.times_s - 21) / 6, 0, 1), PERSON_M[Joint.TORSO]
    turns = Rotation.from_euler("y", angle_deg[:, None], degrees=True).as_matrix()
    joints_m = np.where(run.in_view[:, None, None], (PERSON_M - middle_m) @ turns + middle_m, np.nan).astype(np.float32)
    for truth_m in (joints_m, None):
        assert exchanges(replace(run, joints_m=joints_m, truth_m=truth_m)) == []


def test_where_nobody_is_in_view_nothing_is_shown_and_the_cause_is_told(run: Watched) -> None:
    in_view = np.zeros(len(run.times_s), bool)
    run = replace(run, truth_m=None)
    alone = replace(run, in_view=in_view, empty=~in_view, joints_m=np.full_like(run.joints_m, np.nan))
    found = figures([alone])
    assert found["exchanges"] is found["longest_gap_ms"] is found["availability"] is None
    assert script_fault(run) == "" and "no person was in view" in script_fault(alone)
    assert "images of the empty room" in script_fault(replace(run, people_m=[[PERSON_M]] * len(run.times_s)))


def test_jitter_is_that_of_standing_still(run: Watched) -> None:
    """Hands go to and fro by 30 mm, and everything leaps by a metre when the person moves."""
    joints_m, hands = run.joints_m.copy(), [Joint.RIGHT_HAND, Joint.LEFT_HAND]
    joints_m[::2, hands, 0] += 0.03
    joints_m[1::2, hands, 0] -= 0.03
    joints_m[at(25.0) : at(26.0), :, 1] += 1
    found = figures([replace(run, joints_m=joints_m, truth_m=None)])
    assert found["jitter_core_mm"] == pytest.approx(0, abs=1e-3)
    assert found["jitter_ends_mm"] == pytest.approx(30 / np.sqrt(2), rel=1e-3)  # of four ends two move
    assert found["mean_error_mm"] is None


def test_errors_and_joints_of_something_else(run: Watched) -> None:
    joints_m = run.joints_m.copy()
    joints_m[:, [Joint.RIGHT_FOOT, Joint.LEFT_FOOT], 2] += 0.15
    found = figures([replace(run, joints_m=joints_m)])
    assert found["mean_error_mm"] == pytest.approx(20, rel=1e-3) and found["ends_error_mm"] == pytest.approx(75, rel=1e-3)
    joints_m[at(20.0) : at(24.3)] += (0.6, 0, 0)  # a tenth of the time in view: a chair is taken for the person
    assert figures([replace(run, joints_m=joints_m)])["availability"] == pytest.approx(0.9)
    assert figures([replace(run, joints_m=joints_m, truth_m=None)])["availability"] == 1


def test_the_surface_before_the_empty_room_is_that_of_who_came_in() -> None:
    camera, rng = Camera.centred(300.0, 320, 240), np.random.default_rng(3)
    images_m = np.full((12, 240, 320), 4, np.float32)
    images_m[:, :, ::40] = np.where(rng.random((12, 240, 8)) < 0.5, 2, 4)  # edges flicker
    images_m[:, 100:110] = 0  # not measured
    images_m[8:, 60:180, 100:200] = 2
    images_m[11] = 0
    images_m[8:, 200:, :] = 66.0  # through a window, beyond what 16 bits hold
    kept = [Kept.of(image_m, camera) for image_m in images_m]
    assert kept[0].depth_mm.shape == (120, 160) and kept[0].camera.fx == 150
    areas_m2 = surfaces_m2(kept, np.arange(12) < 8)
    assert (areas_m2[:8] == 0).all()
    assert areas_m2[8:11] == pytest.approx([100 * 120 * 4 / 300**2] * 3, rel=0.05)
    assert np.isnan(areas_m2[11])  # nothing was measured: no empty room


def test_the_truth_of_two_people_is_refused(tmp_path):
    write_two_people(tmp_path, 1)
    (path,) = tmp_path.rglob("*.h5")
    with pytest.raises(InputError, match=r"pair_00.*expected a film of one person"):
        stored_truth(path)


def test_jitter_is_not_that_of_coming_to_rest_or_of_moving_on(run):
    start_s, end_s = step_s("stand still")
    moving = ((run.times_s >= start_s) & (run.times_s < start_s + 1.9)) | ((run.times_s >= end_s - 0.4) & (run.times_s < end_s))
    joints_m = run.joints_m.copy()
    joints_m[moving] += np.float32([0.5, 0, 0])
    found = figures([replace(run, joints_m=joints_m, truth_m=None)])
    assert found["jitter_core_mm"] == pytest.approx(0, abs=1e-3) and found["jitter_ends_mm"] == pytest.approx(0, abs=1e-3)
