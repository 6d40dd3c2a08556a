"""The stand-in for SMMC-10: its content, its separation from training sets, and its files."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from stand_ins import assert_own_seeds, joints_world_m

from kpopnet.datasets.smmc10.benchmark import Smmc10Benchmark, Smmc10Config, Smmc10SimBenchmark
from kpopnet.datasets.smmc10.benchmark import Smmc10SimConfig as ReaderConfig
from kpopnet.datasets.smmc10.format import PACKED, PADDED, read_sequence
from kpopnet.errors import InputError
from kpopnet.skeleton import JOINT_NAMES, Joint
from synth.body.asset import load_body
from synth.body.markers import MARKERS, _segment_hits_mesh, tracked_markers
from synth.motion import MotionConfig
from synth.simulated.eval_sim import EvalSim, EvalSimConfig, EvalSimSet
from synth.simulated.film import Shot
from synth.simulated.smmc10_files import JOINT_MARKERS, MARKER_IDS, SMMC10_SIM, as_frame
from synth.simulated.smmc10_sim import CAMERA, FPS, KINDS, SEQUENCES, SUBJECTS, Smmc10Sim, Smmc10SimConfig, Smmc10SimSet
from synth.simulated.writer import write_set

SHORT = Smmc10SimSet(Smmc10SimConfig(seed=3, sequences=2), frames=(50, 56))
BY_ID = {joint: [MARKER_IDS[name] for name in names] for joint, names in JOINT_MARKERS.items()}


@pytest.fixture(scope="module")
def maker() -> Smmc10Sim:
    return Smmc10Sim(Smmc10SimSet(Smmc10SimConfig(seed=6)))


@pytest.fixture(scope="module")
def motions(maker: Smmc10Sim) -> dict[int, np.ndarray]:
    """True joints (T, 15, 3) in the world of a few easy and difficult sequences."""
    takes = {index: maker.take(index) for index in (0, 1, 18, 21, 23, 25, 27)}
    return {index: joints_world_m(maker.studio, take) for index, take in takes.items()}


# Content ------------------------------


def test_the_set_has_the_dimensions_of_the_real_one():
    assert (SEQUENCES, FPS, CAMERA.width, CAMERA.height) == (28, 25.0, 144, 176)
    assert Smmc10SimSet().frames == (100, 400) and Smmc10SimSet().sensor.name == "swissranger"
    names = [Smmc10Sim.sequence_name(index) for index in range(SEQUENCES)]
    assert [int(name.partition("_")[2]) for name in names] == list(range(1, 29))
    assert {name.partition("_")[0] for name in names} == set(SUBJECTS)
    assert KINDS[0] == ("arms",) and KINDS[-1] == ("kicks", "swings", "turns")


def test_lengths_vary_between_100_and_400_frames(motions):
    lengths = [len(joints) for joints in motions.values()]
    assert all(100 <= length <= 400 for length in lengths) and len(set(lengths)) > 4


def test_difficulty_increases(motions):
    def speed(index: int, *joints: Joint) -> float:
        """The 98th percentile of the speed after the start, metres per second."""
        step = np.diff(motions[index][50:, joints], axis=0)
        return float(np.quantile(np.linalg.norm(step, axis=-1).max(axis=1), 0.98)) * FPS

    feet, hands = (Joint.LEFT_FOOT, Joint.RIGHT_FOOT), (Joint.LEFT_HAND, Joint.RIGHT_HAND)
    for easy in (0, 1):
        assert speed(easy, *feet) < 0.5 and 0.3 < speed(easy, *hands) < 5
    for kicking in (21, 27):
        assert speed(kicking, *feet) > 2.5
    assert speed(18, *hands) > 3.0

    def headings(index: int) -> int:
        across = motions[index][:, Joint.LEFT_HIP, :2] - motions[index][:, Joint.RIGHT_HIP, :2]
        return len(set((np.degrees(np.arctan2(across[:, 1], across[:, 0])) // 45).astype(int).tolist()))

    assert headings(23) == 8 and headings(0) <= 3


def test_motions_have_no_jumps(motions):
    for joints in motions.values():
        step = np.diff(joints, axis=0)
        assert np.linalg.norm(step, axis=-1).max() * FPS < 12.0
        assert np.linalg.norm(step[:, Joint.TORSO], axis=-1).max() * FPS < 3.0


def test_the_markers_of_every_joint_are_near_it():
    film = Smmc10Sim(SHORT).film(0)
    assert set(JOINT_MARKERS) == set(JOINT_NAMES)
    for joint, names in JOINT_MARKERS.items():
        positions = film.markers_camera_m[:, [list(MARKERS).index(name) for name in names]].mean(axis=1)
        distance = np.linalg.norm(positions - film.joints_camera_m[:, JOINT_NAMES.index(joint)], axis=1)
        # Markers are near the joint but on the skin, so there is an offset between them.
        assert distance.max() < 0.15, joint
    hands = film.markers_camera_m[:, list(MARKERS).index("LWRI")] - film.joints_camera_m[:, Joint.LEFT_HAND]
    assert np.linalg.norm(hands, axis=1).min() > 0.01


def test_markers_occluded_by_the_body_are_not_tracked(maker):
    """Folded arms and lunges occlude some markers; the Y pose those of the shoulders at most, under thick sleeves."""
    take = maker.take(18)
    shots = list(maker.shots(18, take, range(0, len(take.played), 3)))
    tracked = np.array([shot.markers_tracked for shot in shots])
    assert 0.9 < tracked.mean() < 1
    assert tracked[:5, [not name.endswith("SHO") for name in MARKERS]].all()


def test_the_trunk_occludes_its_back_from_cameras_in_front(maker):
    scene, take = maker.studio.scene, maker.take(0)
    scene.set_person(scene.fit(take.played.person))
    scene.pose(take.played.local[0], take.played.hips_m[0])
    skin_m, offset_m = maker.studio.renderer.vertices_world_m(), 8 * scene.facing_world()

    def visible(place_m: np.ndarray) -> list[bool]:
        tracked = dict(zip(MARKERS, tracked_markers(skin_m, place_m).tolist(), strict=True))
        return [tracked[name] for name in ("STRN", "CLAV", "T10", "C7")]

    assert visible(offset_m) == [True, True, False, False]
    assert visible(-offset_m) == [False, False, True, True]
    assert visible(np.zeros(3)) == [True, True, True, True]


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=5, deadline=None)
def test_a_segment_hits_the_mesh_where_it_hits_a_triangle(seed):
    """Compares with a slow reference that intersects the segment with every triangle."""
    rng = np.random.default_rng(seed)
    mean = load_body().mean.reshape(-1, 3)[: len(load_body().weights)].astype(np.float64)
    faces = load_body().faces[::7]
    start = mean.mean(axis=0) + rng.normal(size=3)
    way = 1.5 * (mean[rng.integers(len(mean))] + 0.02 * rng.normal(size=3) - start)
    a, b, c = mean[faces.T]
    solved = np.linalg.solve(np.stack([b - a, c - a, np.broadcast_to(-way, a.shape)], axis=-1), (start - a)[..., None])[..., 0]
    u, v, along = solved.T
    met = (u >= 0) & (v >= 0) & (u + v <= 1) & (along > 0) & (along < 1)
    assert _segment_hits_mesh(mean, faces, start, way) == met.any()
    for face in np.flatnonzero(met)[:3]:
        assert _segment_hits_mesh(mean, faces[face : face + 1], start, way)


# Separation from training sets ------------------------------


def test_subjects_are_four_people_who_are_not_in_eval_sim(maker):
    everyone = [maker.person(subject) for subject in range(4)]
    for seed in (0, 6):
        eval_sim = EvalSim(EvalSimSet(EvalSimConfig(seed=seed)))
        everyone += [eval_sim.person(subject) for subject in range(3)]
    everyone += [Smmc10Sim(Smmc10SimSet(Smmc10SimConfig(seed=7))).person(subject) for subject in range(4)]
    for number, person in enumerate(everyone):
        for another in everyone[:number]:
            assert np.abs(person.heads_m - another.heads_m).max() > 0.005


def test_presets_use_no_generator_of_the_benchmark(monkeypatch):
    assert_own_seeds(Smmc10Sim(SHORT), b"smmc10_sim", monkeypatch)


def test_invalid_settings_are_rejected():
    with pytest.raises(InputError, match=r"either composed .* or recorded"):
        Smmc10SimSet(Smmc10SimConfig(), MotionConfig(source="poses"))
    for wrong in ({"sequences": 0}, {"sequences": 29}, {"seed": -1}, {"name": "smmc10"}):
        with pytest.raises(InputError, match=f"benchmark.{next(iter(wrong))}="):
            Smmc10SimConfig(**wrong)


# Files ------------------------------


@pytest.fixture(scope="module")
def written(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("smmc10_sim")
    write_set(SMMC10_SIM, SHORT, folder, processes=1)
    return folder


def test_files_equal_the_film_in_memory(written):
    film = Smmc10Sim(SHORT).film(1)
    path = SMMC10_SIM.path(written, 1)
    assert path.name == "sim02_2.cal.bin" and film.name == "sim02_2" and film.identity == "sim02"
    sequence = read_sequence(path, BY_ID)
    np.testing.assert_array_equal(sequence.depth_m, film.depth_m)
    assert 50 <= len(film.depth_m) <= 56 and sequence.depth_m.shape[1:] == (176, 144)
    for marker, name in enumerate(MARKERS):
        tracked = film.markers_tracked[:, marker]
        positions = sequence.markers_camera_m[MARKER_IDS[name]]
        np.testing.assert_array_equal(positions[tracked], film.markers_camera_m[tracked, marker])
        assert np.isnan(positions[~tracked]).all()
    assert abs(sequence.camera.fx - CAMERA.fx) < 1e-3 and abs(sequence.camera.cy - CAMERA.cy) < 1e-3
    raw = np.fromfile(path, PACKED)
    frames = len(film.depth_m)
    assert raw["frame"].tolist() == list(range(frames)) and (np.diff(raw["timestamp"]) == 40_000).all()
    distance = np.linalg.norm(raw["points"], axis=-1)
    np.testing.assert_allclose(raw["dist"] / 2**16 * 5.0, np.minimum(distance, 5.0), atol=1e-4)
    np.testing.assert_array_equal(raw["conf"] > 0, distance > 0)


def test_padded_and_packed_files_are_read_alike(written, tmp_path):
    path = SMMC10_SIM.path(written, 0)
    packed = np.fromfile(path, PACKED)
    padded = np.zeros(len(packed), PADDED)
    for name in PACKED.names:
        padded[name] = packed[name]
    padded.tofile(tmp_path / path.name)
    one, other = read_sequence(path, BY_ID), read_sequence(tmp_path / path.name, BY_ID)
    np.testing.assert_array_equal(one.depth_m, other.depth_m)
    np.testing.assert_array_equal(one.joints_camera_m, other.joints_camera_m)
    assert one.camera == other.camera


def test_a_marker_that_is_not_tracked_is_stored_as_not_visible():
    tracked = np.ones(len(MARKERS), bool)
    tracked[2] = False
    depth_m, positions = np.full((176, 144), 2.0, np.float32), np.ones((len(MARKERS), 3), np.float32)
    shot = Shot(depth_m, depth_m > 0, np.zeros((15, 3), np.float32), positions, tracked, 0.0)
    for layout in (PACKED, PADDED):
        markers = as_frame(shot, 4, layout)["markers"]
        assert (markers["cond"][: len(MARKERS)] > 0).tolist() == tracked.tolist()
        assert not markers["pos"][2].any() and (markers["pos"][3] == [1, -1, -1]).all()


def test_the_number_of_processes_does_not_matter_and_existing_files_are_kept(written, tmp_path, capsys):
    before = {path.name: path.read_bytes() for path in written.glob("*.cal.bin")}
    assert len(before) == 2
    write_set(SMMC10_SIM, replace(SHORT, benchmark=Smmc10SimConfig(seed=3, sequences=1)), tmp_path, processes=1)
    (tmp_path / ".sim02_2.cal.bin.elsewhere.1.tmp").write_bytes(b"half a frame")
    write_set(SMMC10_SIM, SHORT, tmp_path, processes=2)
    assert "1 of 2 sequences are there already" in capsys.readouterr().out
    assert {path.name: path.read_bytes() for path in tmp_path.glob("*.cal.bin")} == before and not list(tmp_path.glob(".*"))


def test_a_folder_with_other_files_is_rejected(tmp_path):
    (tmp_path / "real01_1.cal.bin").write_bytes(b"other data")
    with pytest.raises(InputError, match=r"real01_1\.cal\.bin: not made by this program, maybe the real SMMC-10"):
        write_set(SMMC10_SIM, SHORT, tmp_path, 1)
    assert (tmp_path / "real01_1.cal.bin").read_bytes() == b"other data"


def test_the_manifest_calls_the_set_simulated_and_the_reader_uses_it(written):
    manifest = json.loads((written / "manifest.json").read_text())
    assert manifest["simulated"] is True and "SIMULATED" in manifest["about"]
    assert manifest["contents"] == {"sim01_1": "arms", "sim02_2": "arms"}
    benchmark = Smmc10SimBenchmark(ReaderConfig(path=str(written)))
    assert benchmark.sequence_names() == ["sim01_1", "sim02_2"] and SHORT.hash in benchmark.about
    sequence, film = benchmark.read("sim02_2"), Smmc10Sim(SHORT).film(1)
    assert not sequence.is_segmented and sequence.identity == "sim02" and sequence.visible.mean() > 0.9
    known = np.isfinite(sequence.yaw_rad)
    turn = np.angle(np.exp(1j * (sequence.yaw_rad - film.yaw_rad)[known]))
    assert known.mean() > 0.8 and np.abs(turn).max() < 0.5
    with pytest.raises(InputError, match="simulated"):
        Smmc10Benchmark(Smmc10Config(path=str(written)))


def test_different_sets_have_different_hashes():
    others = [
        SHORT,
        replace(SHORT, benchmark=Smmc10SimConfig(seed=4, sequences=2)),
        replace(SHORT, frames=(50, 57)),
        EvalSimSet(EvalSimConfig(seed=3, sequences=2), frames=(50, 56)),
    ]
    assert len({other.hash for other in others}) == 4
    assert replace(SHORT, benchmark=Smmc10SimConfig(seed=3, sequences=9)).hash == SHORT.hash
