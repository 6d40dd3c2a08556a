"""A dance of a group: added from a file for each dancer, kept, shown, and danced by several learners."""

import json
from dataclasses import replace

import numpy as np
import pytest
from bvh_files import write_bvh
from scipy.spatial.transform import Rotation

from kpopnet.dance.joint_files.reader import read_performances
from kpopnet.dance.performance import Performance
from kpopnet.errors import InputError
from kpopnet.pose import PersonPose
from kpopnet.skeleton import Joint
from kpopnet.teacher.adding import add_group
from kpopnet.teacher.library import Library
from kpopnet.teacher.live.lesson import Lesson
from kpopnet.teacher.live.loop import Learners, taught_to
from kpopnet.teacher.live.score import kept_formation
from kpopnet.teacher.posing import as_bvh
from synth.motion.choreography.composer import dance as composed

PLACES_M = {"ann": (0.0, 0.0), "bea": (1.5, 0.6), "cho": (-1.2, 0.0)}  # to the dancers' left, away from the camera


@pytest.fixture(scope="module")
def group(library, tmp_path_factory):
    """A library with a dance of three, who were recorded together in a BVH file each."""
    folder = tmp_path_factory.mktemp("group")
    one, paths = library.dance("dance_001"), []
    for name, (left_m, away_m) in PLACES_M.items():
        paths.append(folder / f"{name}.bvh")
        paths[-1].write_text(as_bvh(library.body, one.quats, one.hips_m + np.array([left_m, away_m, 0]), one.fps))
    own = Library(folder / "library", library.body)
    identity = add_group(own, read_performances(paths), "the files", "Trio")
    return own, identity


def test_dancers_keep_their_places_and_are_counted_from_their_left(group, library):
    own, identity = group
    dance = own.dance(identity)
    assert [len(one.joints_m) for one in dance.dancers] == [len(dance.joints_m)] * 3 and dance.about.name == "Trio"
    starts_m = np.array([one.start_m for one in dance.dancers])[:, [0, 2]]
    np.testing.assert_allclose(starts_m - starts_m[1], [PLACES_M["bea"], (0, 0), PLACES_M["cho"]], atol=0.02)
    for one in dance.others:  # each dances as was recorded, over the own start
        np.testing.assert_allclose(one.quats, dance.quats, atol=0.02)
        np.testing.assert_allclose(one.hips_m, dance.hips_m, atol=0.02)
    assert np.abs(own.dance(identity).others[1].joints_m - dance.others[1].joints_m).max() == 0


def test_a_dance_of_a_group_lasts_while_all_are_recorded(library, tmp_path):
    whole, own = library.dance("dance_001").performance, Library(tmp_path, library.body)
    shorter = Performance(whole.joints_m[60:-30], whole.times_s[60:-30])
    dance = own.dance(add_group(own, [whole, shorter], "the files", "Duo"))
    assert dance.about.seconds == pytest.approx(whole.times_s[-31] - whole.times_s[60], abs=0.05)
    for one in dance.dancers:
        np.testing.assert_allclose(one.joints_m, whole.joints_m[60:-31], atol=1e-6)


def test_files_of_two_kinds_or_without_common_time_are_no_group(group, tmp_path, library):
    joints_m = library.dance("dance_001").joints_m
    np.savez(tmp_path / "own.npz", joints_m=joints_m, fps=30)
    names = [joint.name for joint in Joint if joint is not Joint.TORSO]
    points = np.delete(joints_m, Joint.TORSO, axis=1)
    np.savez(tmp_path / "points.npz", points=points, names=names, times_s=np.arange(len(points)) / 30 + 1000)
    with pytest.raises(InputError, match=r"points\.npz: expected a file of the same kind"):
        read_performances([tmp_path / "own.npz", tmp_path / "points.npz"])
    np.savez(tmp_path / "centimetres.npz", points=100 * points, names=names, fps=30)
    with pytest.raises(InputError, match=r"centimetres\.npz: in another unit"):
        read_performances([tmp_path / "points.npz", tmp_path / "centimetres.npz"])
    first, late = (read_performances([tmp_path / f"{name}.npz"])[0] for name in ("own", "points"))
    with pytest.raises(InputError, match="a dance lasts 5 to"):
        add_group(group[0], [first, late], "own.npz", "none")


def hip_widths_m(performance):
    joints_m = performance.joints_m
    return np.linalg.norm(joints_m[:, Joint.LEFT_HIP] - joints_m[:, Joint.RIGHT_HIP], axis=1)


def test_bvh_files_of_a_group_are_in_one_unit(tmp_path):
    """A leg of 0.85 m is metres; one of 1.18 m alone fits no unit, and is an adult's of the mean size then."""
    motion = composed(0, seconds=2.0)
    mean, tall = write_bvh(tmp_path / "mean.bvh", motion, unit=1.0), write_bvh(tmp_path / "tall.bvh", motion, unit=0.72)
    for paths in ([mean, tall], [tall, mean]):
        widths_m = dict(zip(paths, map(hip_widths_m, read_performances(paths)), strict=True))
        np.testing.assert_allclose(widths_m[tall], widths_m[mean] / 0.72, rtol=1e-4)
    np.testing.assert_allclose(hip_widths_m(read_performances([tall])[0]), widths_m[mean], rtol=1e-3)
    first, again = map(hip_widths_m, read_performances([tall, write_bvh(tmp_path / "as_tall.bvh", motion, unit=0.74)]))
    np.testing.assert_allclose(again, first * 0.72 / 0.74, rtol=1e-4)


def test_a_bvh_file_in_another_unit_or_other_axes_than_the_groups_is_named(tmp_path):
    motion = composed(0, seconds=2.0)
    first = write_bvh(tmp_path / "first.bvh", motion)
    otherwise = "its rest pose stands or faces otherwise than that of .*first"
    for told, given in (
        ("in another unit than .*first", {"unit": 1.0}),
        (otherwise, {"axes": Rotation.from_euler("x", 90, degrees=True)}),
        (otherwise, {"axes": Rotation.from_euler("y", 180, degrees=True)}),
    ):
        with pytest.raises(InputError, match=rf"other\.bvh: {told}"):
            read_performances([first, write_bvh(tmp_path / "other.bvh", motion, **given)])


def test_learners_dance_neighbours_in_the_order_in_which_they_stand(group):
    dance = group[0].dance(group[1])
    told = {(1, 0): [0], (1, 2): [2], (1, 9): [2], (2, 1): [1, 2], (2, 2): [1, 2], (3, 1): [0, 1, 2]}
    for (people, dancer), expected in told.items():
        for mirrored in (True, False):  # the formation is the group's in both
            assert taught_to(Lesson("dance_001", people=people, dancer=dancer, mirrored=mirrored), dance) == expected
    assert taught_to(Lesson("dance_001", people=3), replace(dance, others=dance.others[:1])) == [0, 1, 1]
    assert taught_to(Lesson("dance_001", people=3), replace(dance, others=())) == [0, 0, 0]
    learners = Learners(3)
    people = [PersonPose(k, np.full((15, 3), x_m), np.ones(15)) for k, x_m in enumerate((-0.5, 1.0, 0.2))]
    poses = learners.choose(people, 0.0, begun=False)
    assert learners.in_order([None, *poses[1:]]) == [None, *poses[1:]] and learners.choose(people, 1.0, begun=False) == poses
    assert [one.identity for one in learners.in_order(poses)] == [1, 2, 0]
    assert [one.identity for one in learners.choose(people, 2.0, begun=True)] == [1, 2, 0]


def test_a_formation_is_kept_or_told(group):
    dance = group[0].dance(group[1])
    times_s = np.arange(len(dance.joints_m)) / dance.fps
    ones = np.ones((len(times_s), 15))
    members = [{"joints_m": one.joints_m, "times_s": times_s, "confidence": ones} for one in dance.dancers]
    first, second, third = members
    right = kept_formation(dance.dancers, members)
    assert right["similarity"] > 99 and right["spread"] == pytest.approx(1, abs=0.01) and right["remarks"] == []
    wrong = kept_formation(dance.dancers, [first, third, second])
    assert wrong["similarity"] < 5 and {1, 2} <= {one["member"] for one in json.loads(json.dumps(wrong))["remarks"]}
    assert kept_formation(dance.dancers, [first, second, {key: value[:0] for key, value in third.items()}]) is None
    hips = [Joint.LEFT_HIP, Joint.RIGHT_HIP]
    about_hips = [one | {"joints_m": one["joints_m"] - one["joints_m"][:, hips].mean(axis=1, keepdims=True)} for one in members]
    told = kept_formation(dance.dancers, about_hips)
    assert told == {"why_not": "not graded: as recorded, the hips never move (learner)"}
