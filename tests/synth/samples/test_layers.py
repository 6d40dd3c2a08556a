"""The stored image of a person among other things, on constructed images of one row."""

import numpy as np

from kpopnet.camera import Camera
from kpopnet.skeleton import Joint
from synth.samples.layers import Around, at_joints, compose, hidden_fraction, visible_joints

CAMERA = Camera(100.0, 100.0, 3.5, 0.0, 8, 1)


def row(*metres: float) -> np.ndarray:
    return np.array([metres], np.float32)


ROOM_MM = np.array([[0, 0, 4000, 4000, 4000, 1500, 4000, 4000]], np.uint16)
PERSON = row(0, 2, 2, 2, 2, 2, 0, 0)


def test_the_room_hides_the_person() -> None:
    composed = compose(PERSON, ROOM_MM, Around(), CAMERA)
    assert composed.depth_mm.tolist() == [[0, 2000, 2000, 2000, 2000, 0, 0, 0]]
    assert composed.box == (1, 0, 5, 1)


def test_what_is_held_belongs_to_the_silhouette_but_is_not_the_person() -> None:
    held = row(1.9, 0, 0, 1.9, 2.1, 1.9, 1.9, 0)
    composed = compose(PERSON, ROOM_MM, Around(held), CAMERA)
    assert composed.depth_mm.tolist() == [[1900, 2000, 2000, 1900, 2000, 0, 1900, 0]]
    assert composed.own_mm.tolist() == [[0, 2000, 2000, 0, 2000, 0, 0, 0]]
    assert composed.box == (0, 0, 7, 1)


def test_others_hide_the_person_and_their_nearest_parts_are_attached() -> None:
    other = row(0, 0, 0, 0, 1.95, 1.95, 1.95, 1.2)
    hidden = compose(PERSON, ROOM_MM, Around(None, (other,), (0.0,)), CAMERA)
    assert hidden.depth_mm.tolist() == [[0, 2000, 2000, 2000, 0, 0, 0, 0]]
    # 1 pixel is 1.95 cm of the other: 6 cm reach three pixels, where the room hides one and the last is far in front.
    attached = compose(PERSON, ROOM_MM, Around(None, (other,), (0.06,)), CAMERA)
    assert attached.depth_mm.tolist() == [[0, 2000, 2000, 2000, 1950, 0, 1950, 0]]
    assert attached.own_mm.tolist() == hidden.own_mm.tolist()


def test_an_image_has_no_value_at_joints_that_are_not_inside_it() -> None:
    # Pixel 5 of CAMERA lies 3 cm beside the optical axis at 2 m, pixel 8, beyond the image, 9 cm.
    joints_m = np.array([(0.03, 0, 2), (0.09, 0, 2), (-0.09, 0, 2), (0.03, 0.02, 2), (0.03, 0, -2), (np.nan, np.nan, np.nan)])
    assert at_joints(ROOM_MM, joints_m, CAMERA).tolist() == [1500, 0, 0, 0, 0, 0]


def test_the_hidden_fraction_is_of_what_the_room_lets_see() -> None:
    # Of the person's five pixels the room hides one; the other person is before two of the others, and behind a third.
    assert hidden_fraction(PERSON, row(1, 1.5, 2.5, 1.5, 0, 1, 1, 1), ROOM_MM) == 2 / 4
    assert hidden_fraction(row(0, 0, 0, 0, 0, 2, 0, 0), PERSON, ROOM_MM) == 0


def test_a_joint_is_visible_where_the_surface_belongs_to_its_body_part() -> None:
    joints_m = np.full((len(Joint), 3), (-0.01, 0, 2.05))  # at pixel 3
    joints_m[[Joint.LEFT_HAND, Joint.LEFT_KNEE, Joint.TORSO], 2] = 2.1, 2.1, 2.3
    joints_m[Joint.RIGHT_HAND] = 0.03, 0, 2.05  # where the room hides the person
    joints_m[Joint.RIGHT_FOOT] = -0.09, 0, 2.05  # beyond the image
    own_mm = compose(PERSON, ROOM_MM, Around(), CAMERA).own_mm
    hidden = {Joint.LEFT_HAND, Joint.TORSO, Joint.RIGHT_HAND, Joint.RIGHT_FOOT}
    assert {joint for joint in Joint if not visible_joints(joints_m, own_mm, CAMERA)[joint]} == hidden
