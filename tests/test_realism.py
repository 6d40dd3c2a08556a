"""tools/realism.py: what a line of its table says of a statistic."""

import numpy as np
import pytest
from programs import tool

from kpopnet.camera import CAMERAS

realism = tool("realism")


def test_only_what_is_true_or_false_of_a_frame_is_told_as_a_share() -> None:
    depth_m = np.zeros((240, 320), np.float32)
    depth_m[60:200, 140:180] = 2.5
    frames = []
    for holes in range(5):
        holed_m = depth_m.copy()
        holed_m[100 : 100 + 2 * holes : 2, 160] = 0
        frames.append(realism.Frame(str(holes), holed_m, CAMERAS["eval"], np.full((15, 3), np.nan)))
    values = realism.Source("made", frames).values()
    lines = {line["statistic"]: line["synthetic"] for line in realism.compare({}, values)}
    assert lines["share of silhouettes cut by the border"] == pytest.approx([0, 0, 0.434, 5], abs=1e-3)  # Wilson's interval
    of_silhouette = np.arange(5) / (140 * 40)
    assert lines["holes, share of the silhouette"] == pytest.approx([*np.percentile(of_silhouette, (50, 25, 75)), 5])
    assert lines["ridge, share of the silhouette"][1] > 0, "quartiles, not Wilson's interval of a few frames"
