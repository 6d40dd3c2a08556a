"""What benchmarks share: the heading of a person, and sequences chosen evenly."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kpopnet.datasets.protocol import evenly_spaced, heading_rad
from kpopnet.errors import InputError
from kpopnet.skeleton import MIRROR, Joint


def facing_camera() -> np.ndarray:
    joints = np.zeros((15, 3))
    for side, sign in (("LEFT", 1), ("RIGHT", -1)):
        joints[Joint[f"{side}_SHOULDER"]] = 0.2 * sign, -0.5, 0
        joints[Joint[f"{side}_HIP"]] = 0.1 * sign, 0, 0
    return joints


@given(turn=st.floats(-3.1, 3.1), direction=st.floats(-0.5, 0.5), upside_down=st.booleans())
def test_the_heading_is_relative_to_the_direction_to_the_camera(turn, direction, upside_down):
    joints = facing_camera()
    if upside_down:
        joints[:, :2] *= -1
    # A turn to the person's left is counter-clockwise seen from above: from -z towards x.
    angle = turn - direction
    x, z = joints[:, 0].copy(), joints[:, 2].copy()
    joints[:, 0], joints[:, 2] = x * np.cos(angle) - z * np.sin(angle), x * np.sin(angle) + z * np.cos(angle)
    joints += 3 * np.array([np.sin(direction), 0, np.cos(direction)])
    found = heading_rad(joints[None].astype(np.float32))[0]
    assert abs(np.angle(np.exp(1j * (found - turn)))) < 1e-4
    mirrored = (joints * [-1, 1, 1])[MIRROR]
    assert abs(np.angle(np.exp(1j * (heading_rad(mirrored[None])[0] + turn)))) < 1e-4


def test_the_heading_is_unknown_if_joints_are_missing():
    joints = np.tile(facing_camera() + np.array([0, 0, 3]), (2, 1, 1))
    joints[1, Joint.LEFT_HIP] = np.nan
    found = heading_rad(joints)
    assert found[0] == pytest.approx(0) and np.isnan(found[1])


def test_chosen_sequences_are_evenly_spaced_from_first_to_last():
    names = [str(k) for k in range(10)]
    assert evenly_spaced(names, 4) == ["0", "3", "6", "9"]
    assert evenly_spaced(names, None) == evenly_spaced(names, 99) == names
    assert evenly_spaced(names, 1) == ["0"]
    with pytest.raises(InputError, match="sequences=0"):
        evenly_spaced(names, 0)
