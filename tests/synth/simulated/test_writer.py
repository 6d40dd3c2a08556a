"""Files of simulated sequences: what was filmed, whole or not at all, the same again from any number of processes."""

import json
import os
import socket
import subprocess
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from fingerprints import fingerprint
from stand_ins import film_of

from kpopnet.datasets.protocol import BenchmarkConfig
from kpopnet.datasets.simulated import PeopleSet, SimulatedBenchmark, read_sequence
from kpopnet.errors import InputError
from kpopnet.evaluation.poses.definition import in_label_definition
from kpopnet.skeleton import Joint
from synth.__main__ import BENCHMARKS, main
from synth.body.markers import MARKERS
from synth.simulated.film import Studio
from synth.simulated.rooms import Rooms, RoomsConfig
from synth.simulated.stand_ins import JOINT_MARKERS, EvalSim, EvalSimConfig, Smmc10Sim, Smmc10SimConfig
from synth.simulated.two_people import TwoPeople, TwoPeopleConfig

EVAL = EvalSim(EvalSimConfig(seed=3, sequences=2), frames=(24, 30))
SMMC10 = Smmc10Sim(Smmc10SimConfig(seed=3, sequences=2), frames=(50, 56))
PAIR = TwoPeople(TwoPeopleConfig(seed=3, sequences=1), frames=(12, 16))
ROOMS = Rooms(RoomsConfig(seed=3, sequences=3, kinds=["crowd", "empty_room", "single_image"]), frames=(12, 16))


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """A set of each kind."""
    folder = tmp_path_factory.mktemp("sets")
    for one in (EVAL, SMMC10, PAIR, ROOMS):
        one.write(folder / one.benchmark.name, processes=1)
    return folder


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.glob("*.h5"))}


def test_the_reader_returns_the_film(folder):
    benchmark = SimulatedBenchmark(BenchmarkConfig("eval_sim", str(folder / "eval_sim")))
    assert benchmark.sequence_names() == ["seq_00", "seq_01"] and EVAL.hash in benchmark.about
    sequence, film = benchmark.read("seq_01"), film_of(EVAL, 1)
    assert (sequence.identity, sequence.fps, sequence.camera) == ("person 1", 30.0, EvalSim.camera)
    assert not sequence.is_segmented
    np.testing.assert_array_equal(sequence.depth_m, film.depth_m)
    np.testing.assert_array_equal(sequence.joints_camera_m, film.joints_camera_m)
    assert sequence.visible.all() and 24 <= len(film.depth_m) <= 30
    assert benchmark.provenance == {"seed": 3, "version": EvalSim.generator, "config_hash": EVAL.hash}


def test_the_truth_of_smmc10_sim_is_the_mean_of_markers(folder):
    benchmark = SimulatedBenchmark(BenchmarkConfig("smmc10_sim", str(folder / "smmc10_sim")))
    assert benchmark.sequence_names() == ["sim_01", "sim_02"] and benchmark.truth == "simulated markers"
    sequence, stored = benchmark.read("sim_02"), read_sequence(benchmark.path("sim_02"))
    assert sequence.identity == "person 1" and stored.kind == "arms"
    assert sequence.depth_m.shape[1:] == (176, 144)
    markers_m = film_of(SMMC10, 1).markers_m
    np.testing.assert_array_equal(stored.markers_m[:, 0], markers_m)
    assert stored.marker_names == tuple(MARKERS)
    for joint in Joint:
        chosen = [list(MARKERS).index(name) for name in JOINT_MARKERS[joint]]
        np.testing.assert_allclose(sequence.joints_camera_m[:, joint], markers_m[:, chosen].mean(axis=1), atol=1e-6)
    np.testing.assert_array_equal(sequence.visible, np.isfinite(sequence.joints_camera_m).all(axis=-1))
    assert sequence.visible.mean() > 0.9


def test_true_joints_lie_beside_the_markers_of_smmc10_sim_and_agree_with_them_in_their_definition(folder):
    """Who estimates joints without any error is off by centimetres of them, nearly the same ones for everybody."""
    of_markers, of_joints = (
        SimulatedBenchmark(BenchmarkConfig(name, str(folder / name))) for name in ("smmc10_sim", "eval_sim")
    )
    assert (of_markers.label_definition, of_joints.label_definition) == ("simulated markers", None)
    labels_m, joints_m, person = [], [], []
    for index in range(2):
        for shot in SMMC10.studio.shots(SMMC10.take(index), SMMC10.sensor, SMMC10.noise(index), range(0, 20, 4)):
            labels_m.append(SMMC10.truth_m(shot["joints_camera_m"], shot["markers_m"]))
            joints_m.append(shot["joints_camera_m"])
            person.append(index)
    labels_m, joints_m, person = map(np.array, (labels_m, joints_m, person))
    raw_m = np.nanmean(np.linalg.norm(joints_m - labels_m, axis=-1))
    defined_m = np.nanmean(np.linalg.norm(in_label_definition(labels_m, joints_m, person) - labels_m, axis=-1))
    assert raw_m > 0.04 and defined_m < raw_m / 2


def test_the_files_of_two_people_agree_with_the_true_joints(folder):
    sequence = PeopleSet(BenchmarkConfig("two_people", str(folder / "two_people"))).read("pair_00")
    assert 12 <= len(sequence.depth) <= 16 and sequence.kind == "crossing"
    for joints_m in sequence.joints_m[0]:
        u, v, z = TwoPeople.camera.project(joints_m[Joint.TORSO])
        assert 0 < z - sequence.depth[0, round(v), round(u)] / 1000 < 0.3  # the torso lies behind its skin


def test_the_files_of_rooms_hold_any_number_of_people_before_any_camera(folder):
    benchmark = PeopleSet(BenchmarkConfig("rooms", str(folder / "rooms")))
    crowd, empty, image = (benchmark.read(name) for name in benchmark.names)
    assert [one.kind for one in (crowd, empty, image)] == ["crowd", "empty_room", "single_image"]
    assert len(crowd.people) >= 3 and empty.people == () and empty.joints_m.shape[1] == 0 and len(image.depth) == 1
    for one in (crowd, empty, image):
        assert one.depth.shape[1:] == (one.camera.height, one.camera.width) and one.depth.max() > 0


def test_a_seed_makes_the_sequences_that_it_made(folder):
    """Sets are published by their seeds: other sequences need another version of their generator, and numbers here."""
    for one in (EVAL, SMMC10, PAIR, ROOMS):
        paths = sorted((folder / one.benchmark.name).glob("*.h5"))
        found = [fingerprint(np.nan_to_num(read_sequence(path, ()).joints_m)) for path in paths]
        assert found == pytest.approx(PUBLISHED[one.benchmark.name, one.generator], abs=0.02)


PUBLISHED = {
    ("eval_sim", 5): [-3.184, -0.347],
    ("smmc10_sim", 3): [0.643, -0.029],
    ("two_people", 3): [-1.395],
    ("rooms", 5): [2.326, 0.0, 1.153],
}


def test_every_set_calls_itself_simulated_and_has_a_contact_sheet(folder):
    for one in folder.iterdir():
        manifest = json.loads((one / "manifest.json").read_text())
        assert manifest["simulated"] is True and "SIMULATED" in manifest["about"] and manifest["benchmark"] == one.name
        sheet = cv2.imread(str(one / "contact_sheet.png"))
        assert sheet.shape[1] > 1500 and sheet.std() > 20


def test_missing_files_are_made_by_any_number_of_processes_and_existing_files_are_kept(folder, tmp_path, capsys):
    before = contents(folder / "eval_sim")
    one = replace(EVAL, benchmark=EvalSimConfig(seed=3, sequences=1))
    one.write(tmp_path, processes=1)
    assert contents(tmp_path) == {"seq_00.h5": before["seq_00.h5"]}
    stamp = (tmp_path / "seq_00.h5").stat().st_mtime_ns
    (tmp_path / ".seq_01.h5.elsewhere.1.tmp").write_bytes(b"half a frame")
    ended = subprocess.Popen(["true"])
    ended.wait()
    killed, writing = (tmp_path / f".manifest.json.{socket.gethostname()}.{one}-0.tmp" for one in (ended.pid, os.getpid()))
    killed.touch()
    writing.touch()
    manifest = EVAL.write(tmp_path, processes=2)
    assert contents(tmp_path) == before and (tmp_path / "seq_00.h5").stat().st_mtime_ns == stamp
    assert list(tmp_path.glob(".*")) == [writing] and manifest["sequences"] == 2
    assert "1 of 2 sequences are there already" in capsys.readouterr().out
    # With a smaller size configured, it is still a set of two.
    assert one.write(tmp_path, 1)["sequences"] == 2


def test_an_interrupted_run_leaves_no_partial_file_and_no_file_without_a_manifest(tmp_path, monkeypatch):
    def dying(*_):
        assert json.loads((tmp_path / "manifest.json").read_text())["simulated"]
        raise KeyboardInterrupt

    monkeypatch.setattr(Studio, "shots", dying)
    with pytest.raises(KeyboardInterrupt):
        EVAL.write(tmp_path, processes=1)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["manifest.json"]


def test_a_folder_with_other_files_is_refused(folder, tmp_path):
    before = contents(folder / "eval_sim")
    others = {
        r"benchmark\.seed=3, not 4": {"benchmark": EvalSimConfig(seed=4, sequences=2)},
        r"frames=\[24, 30\], not \[24, 31\]": {"frames": (24, 31)},
        r"renderer=cpu, not gl": {"renderer": "gl"},
    }
    for named, other in others.items():
        with pytest.raises(InputError, match=rf"holds another set \({named}\); choose another out="):
            replace(EVAL, **other).write(folder / "eval_sim", 1)
    assert contents(folder / "eval_sim") == before
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "manifest.json").write_text("[1]")
    with pytest.raises(InputError, match=r"holds another set \(settings=None, not \{.*choose another out="):
        EVAL.write(tmp_path / "other", 1)
    (tmp_path / "recording.h5").write_bytes(b"other data")
    with pytest.raises(InputError, match=r"recording\.h5: not made by this program"):
        EVAL.write(tmp_path, 1)
    assert (tmp_path / "recording.h5").read_bytes() == b"other data"


def test_a_benchmark_that_is_not_simulated_is_refused(monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["synth", "benchmark=utd_mhad"])
    with pytest.raises(SystemExit, match="1"):
        main()
    assert capsys.readouterr().err == f"error: benchmark=utd_mhad: the simulated benchmarks are {', '.join(BENCHMARKS)}\n"
