"""One dance by its skeleton in the files of other programs is the same performance as in BVH; what is damaged is refused."""

import numpy as np
import pytest
from bvh_files import write_bvh
from gltf_files import write_gltf

from kpopnet.dance.joint_files.reader import read_performance
from kpopnet.errors import InputError
from synth.motion.choreography.composer import dance

DANCE = dance(2, seconds=2.0)


def assert_same_dance(path, expected, **tolerance):
    read = read_performance(path)
    step = round((len(read.times_s) - 1) / (len(expected.times_s) - 1))
    np.testing.assert_allclose(read.times_s[::step] - read.times_s[0], expected.times_s, atol=1e-4, err_msg=path.name)
    np.testing.assert_allclose(read.joints_m[::step], expected.joints_m, err_msg=path.name, **(tolerance or {"atol": 1e-3}))


@pytest.fixture(scope="module")
def in_bvh(tmp_path_factory):
    return read_performance(write_bvh(tmp_path_factory.mktemp("bvh") / "a.bvh", DANCE))


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("a.glb", {}),
        ("a.gltf", {"uri": "data:", "interpolation": "CUBICSPLINE"}),
        ("b.gltf", {"uri": "my%20buffer.bin", "interpolation": "STEP"}),
        ("a.vrma", {"humanoid": "VRMC_vrm_animation"}),
        ("a.vrm", {"humanoid": "VRMC_vrm"}),
        ("b.vrm", {"humanoid": "VRM", "integers": True}),
    ],
)
def test_a_gltf_file_holds_the_dance(tmp_path, in_bvh, name, options):
    path = write_gltf(tmp_path / name, DANCE, **options)
    if path.name == "b.gltf":
        (tmp_path / "my%20buffer.bin").rename(tmp_path / "my buffer.bin")
    assert_same_dance(path, in_bvh)


def without(*keys):
    def change(content):
        for key in keys:
            content.pop(key)

    return change


def circle(content):
    content["nodes"][23]["children"] = [1]


def sparse(content):
    content["accessors"][0]["sparse"] = {}


def too_long(content):
    content["accessors"][0]["count"] = 10**9


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (without("animations"), r"an animation of a skeleton, found none \(a \.vrm file is a body"),
        (without("nodes"), "not a readable glTF 2.0 file"),
        (lambda content: content["nodes"][10].update(name="Bone"), "no joint for"),
        (circle, "node 1: expected one parent"),
        (sparse, "accessor 0: expected an animation that is neither sparse nor compressed"),
        (too_long, "not a readable glTF 2.0 file"),
        (lambda content: content["buffers"][0].update(uri="../secret.bin"), "buffers in the file's own folder"),
        (lambda content: content["buffers"][0].update(uri="%2e%2e/secret.bin"), "buffers in the file's own folder"),
        (lambda content: content["buffers"][0].update(uri="/etc/passwd"), "buffers in the file's own folder"),
    ],
)
def test_other_gltf_files_are_refused(tmp_path, change, message):
    (tmp_path / "secret.bin").write_bytes(bytes(10**6))
    (tmp_path / "in").mkdir()
    with pytest.raises(InputError, match=rf"a\.glb.*{message}") as error:
        read_performance(write_gltf(tmp_path / "in" / "a.glb", DANCE, change=change))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("name", ["a.glb", "a.fbx"])
def test_a_truncated_empty_or_foreign_file_is_refused_in_one_line(tmp_path, name):
    whole = write_gltf(tmp_path / "whole.glb", DANCE).read_bytes()
    for content in (whole[: len(whole) // 2], whole[:15], b"", b"Kaydara FBX Binary  \0", whole[:4] + bytes(100)):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(InputError, match=name.replace(".", r"\.")) as error:
            read_performance(tmp_path / name)
        assert "\n" not in str(error.value)
