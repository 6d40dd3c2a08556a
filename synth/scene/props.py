"""Things that people use: seats under them and objects in their hands.

A seat is a function of a random generator and the height of its top that returns boxes, like furniture (`synth.scene.room`):
its frame's origin is on the floor below the hips, its back faces +y. A held object is a function of a random generator that
returns a mesh in the frame of a hand: x along the fingers, -z out of the palm, the palm's surface about 2 cm below the origin.
To add one, write the function and enter it in SEATS, IN_PALM or HANGING.
"""

from dataclasses import dataclass

import numpy as np

from kpopnet.errors import check_between
from kpopnet.skeleton import Joint
from synth.scene.mesh import Box, Mesh, about_z, ball, boxes, joined, rod
from synth.scene.room import four_legs, overlaps_boxes
from synth.scene.scene import Scene

PALM_M = 0.02  # distance of the palm's skin from the centre of the hand
SEAT_GIVE_M = 0.03  # depth to which seat and flesh give way to each other
SEATED_HIPS_M = (0.25, 0.7)  # height of the hips' joints above the floor at which a seat fits under them


@dataclass(frozen=True)
class PropsConfig:
    """Things and people that hide a person, or that the segmentation takes for a part of them. All are probabilities.

    Attributes:
        seat: that a person in a sitting pose with room beneath sits on a chair, a stool, a box or a bench.
        held: that a person holds a ball, a stick, a book, a phone, a cup or a bag. What is held belongs to the silhouette.
        second_person: that another person stands close by, before them or beside them.
        attached: that the parts of a seat or of another person that are nearest to the person are segmented as the person.
    """

    seat: float = 0.5
    held: float = 0.06
    second_person: float = 0.04
    attached: float = 0.5

    def __post_init__(self) -> None:
        for name, probability in vars(self).items():
            check_between(f"props.{name}", probability, 0, 1)


NO_PROPS = PropsConfig(seat=0, held=0, second_person=0, attached=0)


def chair(rng: np.random.Generator, top_m: float) -> list[Box]:
    w, d, back = rng.uniform(0.2, 0.26), rng.uniform(0.18, 0.22), rng.uniform(0.2, 0.3)
    return [
        ((0, 0, top_m - 0.02), (w, d, 0.02)),
        ((0, d, top_m + back), (w, 0.015, back)),
        *four_legs(w - 0.02, d - 0.02, top_m - 0.04, 0.02),
    ]


def stool(rng: np.random.Generator, top_m: float) -> list[Box]:
    w = rng.uniform(0.14, 0.2)
    return [((0, 0, top_m - 0.02), (w, w, 0.02)), *four_legs(w - 0.02, w - 0.02, top_m - 0.04, 0.02)]


def crate(rng: np.random.Generator, top_m: float) -> list[Box]:
    w, d = rng.uniform(0.18, 0.3), rng.uniform(0.15, 0.2)
    return [((0, 0, top_m / 2), (w, d, top_m / 2))]


def bench(rng: np.random.Generator, top_m: float) -> list[Box]:
    w, d = rng.uniform(0.5, 0.8), rng.uniform(0.14, 0.2)
    panels = [((s * (w - 0.1), 0, top_m / 2 - 0.02), (0.02, d, top_m / 2 - 0.02)) for s in (-1, 1)]
    return [((0, 0, top_m - 0.02), (w, d, 0.02)), *panels]


SEATS = (chair, stool, crate, bench)


def is_sitting(joints_m: np.ndarray) -> bool:
    """Whether a person with (15, 3) joints in the world sits, or squats as if sitting, with room beneath for a seat.

    The hips are low but well above the feet, both thighs nearly level, and the trunk upright.
    """
    hips, knees = joints_m[[Joint.LEFT_HIP, Joint.RIGHT_HIP]], joints_m[[Joint.LEFT_KNEE, Joint.RIGHT_KNEE]]
    feet, trunk = joints_m[[Joint.LEFT_FOOT, Joint.RIGHT_FOOT]], joints_m[Joint.NECK] - hips.mean(axis=0)
    thighs = knees - hips
    level = np.abs(thighs[:, 2]) < 0.6 * np.linalg.norm(thighs, axis=1)
    low, high = SEATED_HIPS_M
    return bool(
        level.all()
        and low < hips[:, 2].min() < high
        and feet[:, 2].max() < hips[:, 2].min() - 0.2
        and trunk[2] > 0.7 * np.linalg.norm(trunk)
    )


def seat_under(rng: np.random.Generator, scene: Scene, skin_m: np.ndarray) -> Mesh | None:
    """A seat in the world that touches the hips of the scene's sitting person from below and stands on the floor; None if every
    kind stands in the legs. The skin is (V, 3).
    """
    hips_m, facing = scene.joints_world_m()[[Joint.LEFT_HIP, Joint.RIGHT_HIP]].mean(axis=0), scene.facing_world()
    rotation = about_z(np.arctan2(facing[0], -facing[1]))
    own = (skin_m - (*hips_m[:2], 0)) @ rotation  # x to the person's left, y backwards, z above the floor
    beneath = (np.hypot(own[:, 0], own[:, 1] - 0.05) < 0.13) & (np.abs(own[:, 2] - hips_m[2]) < 0.2)
    if not beneath.any():
        return None
    top_m = own[beneath, 2].min()
    for kind in rng.permutation(len(SEATS)):
        make = SEATS[kind]
        parts = make(rng, float(top_m))
        centres, halves = (np.array(numbers, float) for numbers in zip(*parts, strict=True))
        if make is chair:
            centres[:, 1] += _to_back(own, centres[1], halves[1])
        lowered = centres - (0, 0, SEAT_GIVE_M)
        if not overlaps_boxes(own, np.zeros(3), lowered, halves, np.zeros(len(parts)), 0.0):
            mesh = boxes(zip(centres.tolist(), halves.tolist(), strict=True))
            return mesh.moved(rotation, np.array([*hips_m[:2], 0.0]))
    return None


def platform_under(rng: np.random.Generator, low_m: np.ndarray, high_m: np.ndarray, height_m: float) -> Mesh:
    """A bed, a mat or a stage of a height beneath a low person, from the corners (2,) x and y of what they cover, metres."""
    centre, half = (low_m + high_m) / 2, (high_m - low_m) / 2 + rng.uniform(0.0, 0.4, 2)
    half_z = height_m / 2 - 0.01
    return boxes([((*centre, half_z), (*half, half_z))])


def _to_back(skin_m: np.ndarray, centre: np.ndarray, half: np.ndarray) -> float:
    """How far backwards a chair moves, metres, so that its back, a box, touches the person's; the hips stay above the seat."""
    before = (np.abs(skin_m[:, [0, 2]] - centre[[0, 2]]) < half[[0, 2]] + 0.02).all(axis=1)
    behind_m = skin_m[before, 1].max(initial=0.0) + half[1] + 0.01
    return min(float(behind_m - centre[1]), 0.12)


def toy_ball(rng: np.random.Generator) -> Mesh:
    """A ball as small as a tennis ball or as large as a football, lying in the palm."""
    radius_m = rng.uniform(0.035, 0.11)
    return ball(radius_m).moved(np.eye(3), np.array([0, 0, -PALM_M - radius_m]))


def stick(rng: np.random.Generator) -> Mesh:
    """A stick held anywhere along its length, across the palm."""
    half_m = rng.uniform(0.15, 0.6)
    bar = rod(rng.uniform(0.012, 0.02), half_m)
    return bar.moved(np.eye(3), np.array([0, rng.uniform(-0.7, 0.7) * half_m, -PALM_M - 0.01]))


def book(rng: np.random.Generator) -> Mesh:
    thick_m = rng.uniform(0.006, 0.025)
    return boxes([((0.05, 0, -PALM_M - thick_m), (rng.uniform(0.1, 0.16), rng.uniform(0.07, 0.11), thick_m))])


def phone(rng: np.random.Generator) -> Mesh:
    return boxes([((0.01, 0, -PALM_M - 0.005), (rng.uniform(0.065, 0.085), rng.uniform(0.033, 0.042), 0.005))])


def cup(rng: np.random.Generator) -> Mesh:
    """A cup or a bottle gripped across the palm."""
    radius_m = rng.uniform(0.028, 0.045)
    return rod(radius_m, rng.uniform(0.045, 0.12)).moved(np.eye(3), np.array([0, 0, -PALM_M - radius_m]))


def bag(rng: np.random.Generator) -> Mesh:
    """A bag on two straps; z is up, the hand at the origin."""
    w, d, h, strap = rng.uniform(0.1, 0.2), rng.uniform(0.03, 0.08), rng.uniform(0.1, 0.2), rng.uniform(0.08, 0.2)
    straps = [((side * 0.6 * w, 0, -strap / 2), (0.018, 0.015, strap / 2)) for side in (-1, 1)]
    return joined([boxes([((0, 0, -strap - h), (w, d, h))]), boxes(straps), boxes([((0, 0, -0.01), (0.6 * w, 0.01, 0.01))])])


IN_PALM = (toy_ball, stick, book, phone, cup)
HANGING = (bag,)  # held objects whose frame stays upright, turned with the hand about the vertical


def held_by(rng: np.random.Generator, scene: Scene, left: bool) -> Mesh:
    """An object in the left or right hand of the scene's person, in the world."""
    make = (*IN_PALM, *HANGING)[rng.integers(len(IN_PALM) + len(HANGING))]
    if make in HANGING:
        frame = about_z(rng.uniform(-np.pi, np.pi))
    else:
        # In the T-pose the palms face down, the left hand points along x and the right one along -x.
        frame = scene.bone_rotation("LeftHand") if left else scene.bone_rotation("RightHand") * (-1, -1, 1)
    return make(rng).moved(frame, scene.joints_world_m()[Joint.LEFT_HAND if left else Joint.RIGHT_HAND])
