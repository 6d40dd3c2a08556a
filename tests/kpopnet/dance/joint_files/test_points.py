"""Times of a recording's frames."""

import numpy as np
import pytest

from kpopnet.dance.joint_files.points import frame_times_s
from kpopnet.errors import InputError


def test_a_true_rate_stretches_the_files_times_and_keeps_their_begin_and_gaps():
    times_s = 3 + np.array([0, 1, 2, 5, 6, 7]) / 25
    stretched_s = frame_times_s(6, times_s, None, 30.0, "dance.json")
    np.testing.assert_allclose(stretched_s, 3 + np.array([0, 1, 2, 5, 6, 7]) / 30)
    np.testing.assert_array_equal(frame_times_s(6, times_s, None, None, "dance.json"), times_s)


def test_without_times_or_with_equal_ones_frames_are_as_far_apart_as_the_rate_says():
    for times_s in (None, np.full(4, 2.0)):
        np.testing.assert_allclose(frame_times_s(4, times_s, 25.0, 30.0, "dance.json"), np.arange(4) / 30)
    np.testing.assert_allclose(frame_times_s(4, None, 25.0, None, "dance.json"), np.arange(4) / 25)
    with pytest.raises(InputError, match=r"dance\.json: states neither times nor a frame rate"):
        frame_times_s(4, None, None, None, "dance.json")
