"""The stand-in for the K-Pop set: its content, its separation from training sets, and its reproducibility."""

import itertools
import json
import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import synth.dances.simulate
import synth.simulated.generator
from kpopnet.datasets.dances.dance_set import KpopSet
from kpopnet.datasets.protocol import Origin
from kpopnet.errors import InputError
from kpopnet.rotations import about, multiply
from kpopnet.skeleton import Joint
from synth.dances.simulate import CAMERA, DANCES, FPS, LEARNERS, KpopSim, KpopSimConfig, connected, is_danceable
from synth.dances.skill import LEVELS
from synth.motion import SPLITS, MotionConfig
from synth.motion.choreography.composer import dance
from synth.motion.recorded import Recordings, open_clips
from synth.motion.skeleton import Motion
from synth.sensor.film_noise import FilmNoise
from synth.sensor.model import SENSORS
from synth.simulated.film import measure_frame

SHORT = KpopSim(KpopSimConfig(seed=4, dances=2), seconds=(0.8, 1.0))


@pytest.fixture(scope="module")
def written(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("kpop_sim")
    SHORT.write(folder, processes=1)
    return folder


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.glob("dance_*/*"))}


def test_a_set_has_the_format_and_a_manifest_that_calls_it_simulated(written):
    dances = KpopSet(written)
    assert dances.names == ["dance_000", "dance_001"] and dances.manifest.origin is Origin.SIMULATED
    assert dances.manifest.dances == 2 and dances.manifest.hash == SHORT.hash
    assert "SIMULATED" in dances.manifest.about and "no real person" in dances.manifest.about
    assert dances.manifest.ordered and dances.manifest.independent
    ends = KpopSim(benchmark=KpopSimConfig(faults="ends"), motion=MotionConfig("clips", path="pack")).manifest_entries()
    assert (ends["ordered"], ends["independent"]) == (False, False)
    assert (written / "contact_sheet.png").stat().st_size > 10_000
    for name in dances.names:
        dance = dances.dance(name)
        assert sorted(learner.name for learner in dance.learners) == list(LEARNERS)
        assert [learner.about["level"] for learner in dance.learners] == list(LEVELS)


def test_names_do_not_reveal_levels():
    maker = KpopSim()
    levels = np.array([maker.levels(index) for index in range(100)])
    assert (np.sort(levels, axis=1) == np.arange(4)).all()
    assert (np.abs(levels.mean(axis=0) - 1.5) < 0.4).all()


def test_the_teacher_faces_a_level_camera(written):
    joints_m = KpopSet(written).dance("dance_000").teacher().joints_m
    start = joints_m[0]
    assert start[Joint.LEFT_SHOULDER, 0] > start[Joint.RIGHT_SHOULDER, 0] + 0.2
    assert abs(start[Joint.LEFT_SHOULDER, 2] - start[Joint.RIGHT_SHOULDER, 2]) < 0.1
    assert start[Joint.HEAD, 1] < start[Joint.TORSO, 1] < start[Joint.LEFT_FOOT, 1]
    np.testing.assert_allclose(start[Joint.TORSO, [0, 2]], [0, 2.5], atol=0.15)
    assert 0.8 < start[Joint.LEFT_FOOT, 1] < 1.0  # the camera is 1 m above the floor


def test_a_learners_depth_agrees_with_the_true_joints(written):
    for learner in KpopSet(written).dance("dance_001").learners:
        clip, truth = learner.depth(), learner.joints()
        assert len(clip.depth_m) == len(truth.joints_m) and 0.8 * FPS - 1 <= len(clip.times_s) <= 1.0 * FPS + 1
        np.testing.assert_allclose(np.diff(clip.times_s), 1 / FPS)
        assert (clip.camera.fx, clip.camera.fy) == (CAMERA.fx, CAMERA.fy)
        for frame in (0, len(clip.depth_m) // 2, -1):
            image, joints_m = clip.depth_m[frame], truth.joints_m[frame]
            u, v, z = clip.camera.project(joints_m).T
            assert (u > 0).all() and (v > 0).all() and (u < clip.camera.width).all() and (v < clip.camera.height).all()
            near = [
                image[max(round(y) - 3, 0) : round(y) + 4, max(round(x) - 3, 0) : round(x) + 4].max()
                for x, y in zip(u, v, strict=True)
            ]
            assert np.count_nonzero(near) >= 13
            # The wall and the floor are removed, except for a few flying pixels.
            measured_m = image[image > 0]
            assert np.mean(np.abs(measured_m - np.median(z)) > 1.3) < 0.002 and 1500 < len(measured_m) < 40_000


@pytest.mark.parametrize("sensor", ["kinect_2", "kinect_v1"])
def test_a_learner_is_measured_as_a_part_of_the_whole_image(sensor):
    """What of the noise belongs to places in the image, its holes for instance, stays there when the person moves."""
    maker = replace(SHORT, sensor=SENSORS[sensor])
    take = maker.take(0, 0, maker.teacher_motion(0))
    packed, _ = maker.record(0, 0, take)
    noise, end = FilmNoise(maker._seed("noise", 0, 0)), 0
    for clean, (x0, y0, x1, y1) in zip(maker.studio.render(take, range(len(take))), packed.boxes.tolist(), strict=True):
        depth_m, person = measure_frame(clean, CAMERA, maker.sensor, noise)
        recorded_mm, begin = np.zeros(depth_m.shape), end
        end += (y1 - y0) * (x1 - x0)
        recorded_mm[y0:y1, x0:x1] = packed.depth_mm[begin:end].reshape(y1 - y0, x1 - x0)
        np.testing.assert_array_equal(recorded_mm, np.rint(connected(np.where(person, depth_m, np.float32(0))) * 1000))


def test_only_connected_pixels_are_kept() -> None:
    depth_m = np.zeros((6, 8), np.float32)
    depth_m[1:3, 1:3], depth_m[4, 5], depth_m[4, 6], depth_m[2, 3] = 2.0, 2.0, 2.05, 3.0
    expected = np.where(depth_m == 2.0, depth_m, 0)
    expected[4, 5] = 0
    np.testing.assert_array_equal(connected(depth_m), expected)


def test_missing_files_are_made_and_existing_files_are_kept(written, tmp_path, capsys):
    before = contents(written)
    sent = pickle.loads(pickle.dumps(replace(SHORT, benchmark=KpopSimConfig(seed=4, dances=1))))  # as to another process
    sent.write(tmp_path, processes=1)
    assert set(contents(tmp_path)) == {name for name in before if name.startswith("dance_000")}
    # As after a run that was killed in the middle of the second dance.
    (tmp_path / "dance_001").mkdir()
    (tmp_path / "dance_001" / "a.h5").write_bytes(before["dance_001/a.h5"])
    stamp = (tmp_path / "dance_001" / "a.h5").stat().st_mtime_ns
    (tmp_path / "dance_001" / ".b.h5.elsewhere.1.tmp").write_bytes(b"half")
    manifest = SHORT.write(tmp_path, processes=1)
    assert contents(tmp_path) == before and manifest["dances"] == 2
    assert (tmp_path / "dance_001" / "a.h5").stat().st_mtime_ns == stamp
    assert not list(tmp_path.glob("**/.*"))
    assert "1 of 2 dances are there already" in capsys.readouterr().out


def test_an_interrupted_run_leaves_no_labels_of_an_unfinished_dance(tmp_path, monkeypatch):
    original, made = synth.dances.simulate.write_learner, []

    def dying(folder, name, *rest):
        made.append(name)
        if len(made) == 3:
            raise KeyboardInterrupt
        original(folder, name, *rest)

    monkeypatch.setattr(synth.dances.simulate, "write_learner", dying)
    with pytest.raises(KeyboardInterrupt):
        replace(SHORT, benchmark=KpopSimConfig(seed=4, dances=1)).write(tmp_path, processes=1)
    assert sorted(path.name for path in (tmp_path / "dance_000").iterdir()) == ["a.h5", "b.h5", "teacher.h5"]
    with pytest.raises(InputError, match="no dances in it"):
        KpopSet(tmp_path)


def test_splits_share_no_dance_and_no_person():
    makers = [replace(SHORT, benchmark=KpopSimConfig(seed=4, split=split)) for split in SPLITS]
    assert len({maker.teacher_motion(0).name for maker in makers}) == len({maker.hash for maker in makers}) == 3
    takes = (maker.take(0, number, maker.learner(0, number).motion) for maker in makers for number in range(2))
    for one, other in itertools.combinations([take.played.person for take in takes], 2):
        assert np.abs(one.heads_m - other.heads_m).max() > 0.003


def test_only_clips_of_category_dance_are_used(tmp_path):
    lines = ["clip_id,file,category,split,seconds", "a,a.npz,other,test,9", "b,b.npz,dance,test,9", "c,c.npz,dance,train,9"]
    (tmp_path / "index.csv").write_text("\n".join(lines) + "\n")
    assert open_clips(tmp_path, "test").clip_indices("dance") == [1]
    (tmp_path / "index.csv").write_text("\n".join(line.replace("category", "kind") for line in lines) + "\n")
    assert open_clips(tmp_path, "test").clip_indices("dance") == [0, 1]
    (tmp_path / "index.csv").write_text("\n".join(lines[:2]) + "\n")
    maker = replace(SHORT, motion=MotionConfig(source="clips", path=str(tmp_path)))
    with pytest.raises(InputError, match=r"no recording of category dance in its split has 0\.8 s"):
        maker.teacher_motion(0)


PACK = MotionConfig("clips", path="pack")


def recordings_of(*motions: Motion) -> Recordings:
    return Recordings(lambda number: (motions[number], np.ones(len(motions[number]), bool)), ["dance"] * len(motions))


def of_recordings(monkeypatch, *motions: Motion, **settings) -> KpopSim:
    """A maker of dances of 0.8 s of these recordings."""
    monkeypatch.setattr(synth.simulated.generator, "build_motion", lambda *_: recordings_of(*motions))
    return KpopSim(KpopSimConfig(**settings), PACK, seconds=(0.8, 1.0))


def test_excerpts_of_recordings_share_no_frame_and_leave_out_what_cannot_be_danced(monkeypatch):
    long, short, leaping = dance(0, 5, 6.0, FPS), dance(0, 6, 0.7, 60.0), dance(0, 7, 3.0, FPS)
    leaping.root_m[30:, 0] += 3.0  # whoever is in both halves of it leaves the stage
    maker = of_recordings(monkeypatch, long, short, leaping)
    frames = [(clip, frame) for clip, start in maker.excerpts for frame in range(start, start + 24)]
    assert len(frames) == len(set(frames)) and {clip for clip, _ in maker.excerpts} == {0, 2}
    assert sorted(start for clip, start in maker.excerpts if clip == 0) == [24 * number for number in range(len(long) // 24)]
    assert sorted(start for clip, start in maker.excerpts if clip == 2) == [0, 39, 63]
    assert [len(maker.teacher_motion(index)) for index in range(len(maker.excerpts))] == [24] * len(maker.excerpts)
    assert of_recordings(monkeypatch, long, short, leaping, seed=3).excerpts != maker.excerpts
    assert maker.size == len(maker.excerpts) and replace(maker, benchmark=KpopSimConfig(dances=2)).size == 2
    with pytest.raises(InputError, match=f"have {len(maker.excerpts)} excerpts that can be danced, none for dance_040"):
        maker.teacher_motion(40)


def test_who_travels_farther_than_a_metre_along_either_axis_of_the_floor_does_not_fit_before_a_camera():
    still = dance(0, 5, 2.0, FPS)
    for axis, danceable in ((0, False), (1, True), (2, False)):
        root_m = np.zeros_like(still.root_m)
        root_m[:, axis] = np.linspace(0, 1.2, len(still))
        assert is_danceable(replace(still, root_m=root_m)) is danceable
        assert is_danceable(replace(still, root_m=0.8 * root_m))


def test_another_composed_dance_is_not_in_the_set():
    maker = KpopSim(KpopSimConfig(faults="ends"))
    assert not {maker._another(index) for index in range(DANCES)} & set(range(DANCES))


def test_another_recorded_dance_is_another_excerpt(monkeypatch):
    maker = of_recordings(monkeypatch, dance(0, 5, 1.7, FPS), faults="ends")
    danced = [maker.teacher_motion(index).quats for index in range(2)]
    for index, number in itertools.product(range(2), range(4)):
        learner = maker.learner(index, number)
        if maker.level_names[learner.level] == "another dance":
            np.testing.assert_allclose(learner.motion.quats, danced[1 - index], atol=1e-6)
    with pytest.raises(InputError, match="needs two dances"):
        of_recordings(monkeypatch, dance(0, 5, 0.9, FPS), faults="ends").learner(0, 0)


def test_recorded_dancers_face_the_camera_and_dance_the_same_as_in_their_recording(monkeypatch):
    composed = dance(0, 5, 0.9, FPS)
    turned = replace(composed, quats=composed.quats.copy())
    turned.quats[:, 0] = multiply(about(1, np.array(1.4)), composed.quats[:, 0])
    recorded = {facing: of_recordings(monkeypatch, turned, facing=facing) for facing in ("camera", "recording")}
    joints_m = {facing: maker.teacher_joints_m(0) for facing, maker in recorded.items()}
    across_m = {facing: (m[:, Joint.LEFT_SHOULDER] - m[:, Joint.RIGHT_SHOULDER]).mean(axis=0) for facing, m in joints_m.items()}
    assert across_m["camera"][0] > 4 * abs(across_m["camera"][2])
    assert abs(across_m["recording"][2]) > 4 * abs(across_m["recording"][0])
    apart = [np.linalg.norm(m[:, :, None] - m[:, None], axis=-1) for m in joints_m.values()]
    np.testing.assert_allclose(*apart, atol=1e-4)


def test_composed_sets_are_known_by_the_settings_of_before_there_were_recorded_ones(tmp_path):
    (tmp_path / "index.csv").write_text("clip_id,file,category,split,seconds\n")
    settings = [
        json.loads(replace(SHORT, motion=motion).as_json())
        for motion in (SHORT.motion, MotionConfig("clips", path=str(tmp_path)))
    ]
    assert [("facing" in one["benchmark"], one["generator"]) for one in settings] == [(False, 5), (True, 6)]
