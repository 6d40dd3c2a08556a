from dataclasses import replace

import numpy as np
import pytest
from bvh_files import write_bvh

from kpopnet.errors import InputError
from synth.motion import SPLITS, MixedPoses, MotionConfig, build_motion, identity_of_recordings
from synth.motion.choreography.composer import dance
from synth.motion.poses import FAMILIES, ProceduralPoses
from synth.motion.skeleton import LEG_M, REST_OFFSETS_M, Motion
from synth.samples.sampler import SampleConfig
from synth.samples.writer import SetConfig
from synth.simulated.stand_ins import EvalSim, EvalSimConfig

STILL = Motion(np.tile(np.eye(4, dtype=np.float32)[0], (3, 23, 1)), np.ones((3, 3), np.float32), 30.0, "still", LEG_M)


def generators(n, seed=0):
    return [np.random.default_rng([seed, i]) for i in range(n)]


@pytest.fixture
def pack(tmp_path):
    """A small motion pack in the published format; frames 3 to 5 of each clip are bad."""
    rows = [("a", "train", 60), ("b", "train", 30), ("c", "test", 20), ("d", "val", 20)]
    folder = tmp_path / "pack"
    (folder / "clips").mkdir(parents=True)
    lines = [f'{name},clips/{name}.npz,{split},"a, b",{frames / 30}' for name, split, frames in rows]
    (folder / "index.csv").write_text("\n".join(["clip_id,file,split,description,seconds", *lines]))
    for i, (name, _, frames) in enumerate(rows):
        motion, bad = dance(i, seconds=frames / 30), np.zeros(frames, bool)
        bad[3:6] = True
        quat = np.round(motion.quats * 32767).astype(np.int16)
        others = {"offsets": REST_OFFSETS_M.astype(np.float32), "fps": np.float32(30), "bad": bad}
        np.savez(folder / "clips" / f"{name}.npz", quat=quat, root=motion.root_m, **others)
    return folder


def clips(path, split="train", **changes):
    return build_motion(MotionConfig(source="clips", path=str(path), **changes), split)


def test_a_pack_is_split_by_its_index(pack):
    assert len(clips(pack)) == 2
    assert [clips(pack, split="test").motion(0).name] == ["clip:c"]
    assert [clips(pack, split="validation").motion(0).name] == ["clip:d"]
    with pytest.raises(InputError, match="split=val: expected one of train, validation, test"):
        clips(pack, split="val")


def test_a_clip_is_read_as_stored_without_its_bad_frames(pack):
    motion, truth = clips(pack).motion(0), dance(0, seconds=2.0)
    assert len(motion) == 54 and motion.fps == 30
    assert motion.leg_m == pytest.approx(LEG_M, abs=1e-6)
    np.testing.assert_allclose(motion.quats, truth.quats[6:], atol=5e-5)
    np.testing.assert_allclose(np.linalg.norm(motion.quats, axis=-1), 1, atol=1e-6)
    np.testing.assert_array_equal(motion.root_m, truth.root_m[6:])


def test_single_poses_of_a_pack_are_uniform_over_time_and_never_bad_frames(pack):
    poses = clips(pack).poses(generators(600))
    frames = [(name.split("@")[0], round(float(name.split("@")[1][:-1]) * 30)) for name in poses.names]
    assert {name for name, _ in frames} == {"clip:a", "clip:b"}
    assert np.mean([name == "clip:a" for name, _ in frames]) == pytest.approx(2 / 3, abs=0.07)
    assert np.abs(poses.quats[:, 0, 2]).max() < 1e-6  # the hips have no heading
    truth = np.concatenate([dance(0, seconds=2.0).quats[3:6], dance(1, seconds=1.0).quats[3:6]])
    # The legs of no pose equal those of a bad frame.
    apart = np.abs(poses.quats[:, None, 15:] - truth[None, :, 15:]).max(axis=(2, 3)).min()
    assert apart > 1e-4


def used_by_split(folder):
    opened = {split: clips(folder, split) for split in SPLITS}
    return {split: {one.motion(number).name for number in range(len(one))} for split, one in opened.items()}


def test_bvh_files_are_clips_split_by_name(tmp_path, caplog):
    for k in range(24):
        write_bvh(tmp_path / f"{k}.bvh", STILL)
    used = used_by_split(tmp_path)
    assert "split by file; takes of one dancer may be in several splits" in caplog.text
    assert set().union(*used.values()) == {f"bvh:{k}" for k in range(24)} and sum(map(len, used.values())) == 24
    assert all(used.values()) and len(used["train"]) > 12
    for name in ("00", "1 more", "zz"):
        write_bvh(tmp_path / f"{name}.bvh", STILL)
    assert all(used[split] <= names for split, names in used_by_split(tmp_path).items())  # none goes to another split
    one = clips(tmp_path / "2.bvh", fps=60.0)
    assert len(one) == 1 and one.motion(0).fps == 60.0
    assert clips(tmp_path).clip_indices("dance") == list(range(len(clips(tmp_path))))  # who knows what they show
    poses = clips(tmp_path).poses(generators(20))
    np.testing.assert_allclose(poses.leg_m, LEG_M, atol=1e-5)
    np.testing.assert_allclose(poses.quats, np.broadcast_to([1, 0, 0, 0], poses.quats.shape), atol=1e-6)


def test_every_split_gets_a_file_of_eight_whatever_their_names(tmp_path):
    for k in (0, 1, 3, 4, 5, 7, 9, 11):  # whose names would all draw train
        write_bvh(tmp_path / f"{k}.bvh", STILL)
    used = used_by_split(tmp_path)
    assert [len(used[split]) for split in SPLITS] == [6, 1, 1] and len(set().union(*used.values())) == 8


@pytest.mark.parametrize("settings", [{}, {"source": "choreography"}, {"weights": {"poses": 1.0, "clips": 0.0}}])
def test_a_path_that_no_motion_would_be_taken_from_is_refused(tmp_path, settings):
    write_bvh(tmp_path / "a.bvh", STILL)
    with pytest.raises(InputError, match=r"no motion would be taken from it; choose motion=clips"):
        MotionConfig(path=str(tmp_path), **settings)
    mixed = MotionConfig(path=str(tmp_path), fps=25.0, weights={"poses": 1.0, "choreography": 1.0, "clips": 1.0})
    build_motion(mixed, "train")


def test_a_set_is_identified_by_its_bvh_files_beside_their_path(tmp_path, pack):
    write_bvh(tmp_path / "a.bvh", STILL)

    def identities(folder):
        motion = MotionConfig(source="clips", path=str(folder))
        mixed = MotionConfig(source="mix", path=str(folder), weights={"clips": 1.0})
        samples = (SetConfig(SampleConfig(renderer="cpu", motion=one), 3, "train", 10, 5, None) for one in (motion, mixed))
        return [EvalSim(EvalSimConfig(seed=3), motion=motion).hash, *(one.hash for one in samples)]

    before = identities(tmp_path)
    assert identities(tmp_path) == before
    write_bvh(tmp_path / "b.bvh", STILL)
    assert not set(identities(tmp_path)) & set(before)
    (tmp_path / "b.bvh").unlink()
    assert identities(tmp_path) == before
    # Sets on disk that were made from a motion pack are known by its path alone.
    assert identity_of_recordings(MotionConfig(source="clips", path=str(pack))) == {}
    assert identity_of_recordings(MotionConfig(source="choreography")) == {}


def test_a_path_without_motion_is_refused_with_the_remedy(tmp_path):
    for path, found in ((tmp_path / "nowhere", "does not exist"), (tmp_path, "holds neither an index.csv nor")):
        with pytest.raises(InputError, match=rf"{found}.*choreography needs no data"):
            clips(path)


def test_clips_and_indices_of_other_contents_are_refused(pack):
    clip, index = pack / "clips" / "a.npz", pack / "index.csv"
    with np.load(clip) as stored:
        arrays = dict(stored)
    for changed, message in (
        ({"fps": np.float32(np.nan)}, "1 to 1000 frames a second"),
        ({"root": np.zeros((59, 3), np.float32)}, r"root: shape \(59, 3\), expected \(frames = 60, 3\)"),
        ({"quat": np.full((60, 23, 4), np.nan, np.float32)}, "finite rotations other than 0"),
        ({"quat": np.zeros((60, 23, 4), np.int16)}, "finite rotations other than 0"),
    ):
        np.savez(clip, **(arrays | changed))
        with pytest.raises(InputError, match=message):
            clips(pack).motion(0)
    with pytest.raises(InputError, match=r"motion\.fps=60: the rate of BVH files; .* is a motion pack"):
        build_motion(MotionConfig(source="clips", path=str(pack), fps=60), "train")
    rows = index.read_text()
    for old, new, message in (
        ("clips/b.npz", "../b.npz", "row 3: expected a file inside the pack"),
        ("1.0", "-1.0", "row 3: expected a duration of 0 to"),
        ("split", "part", r"index\.csv: expected columns clip_id, file, seconds, split"),
    ):
        index.write_text(rows.replace(old, new))
        with pytest.raises(InputError, match=message):
            clips(pack)


def test_splits_of_the_choreography_share_no_dance():
    config = MotionConfig(source="choreography", dances=3)
    sources = [*(build_motion(config, split) for split in SPLITS), build_motion(replace(config, seed=1), "train")]
    assert len({source.motion(i).name for source in sources for i in range(3)}) == 12


def test_a_mixture_draws_sources_by_weight_and_each_pose_from_its_generator():
    only = [ProceduralPoses({name: FAMILIES[name]}) for name in ("kick", "sit", "lie")]
    mixture = MixedPoses(only, [0.5, 0.3, 0.2])
    batch = mixture.poses(generators(400))
    for name, weight in (("kick", 0.5), ("sit", 0.3), ("lie", 0.2)):
        assert batch.names.count(f"pose:{name}") / 400 == pytest.approx(weight, abs=0.08)
    for k in (0, 3, 399):
        single = mixture.poses([generators(400)[k]])
        assert single.names == [batch.names[k]]
        np.testing.assert_array_equal(single.quats[0], batch.quats[k])
        np.testing.assert_array_equal(single.root_m[0], batch.root_m[k])


def test_the_order_of_the_weights_says_nothing():
    """A set's identity sorts its settings, so their order must not change the samples."""

    weights = {"poses": 0.7, "choreography": 0.3}
    one, other = (MotionConfig(dances=5, weights=dict(items)) for items in (weights.items(), reversed(weights.items())))
    assert build_motion(one, "train").poses(generators(40)).names == build_motion(other, "train").poses(generators(40)).names
