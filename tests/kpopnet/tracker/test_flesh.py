"""How thick people are, found on people of cones whose thickness is known."""

import numpy as np
import pytest
import torch
from cone_people import cone_body, cone_joints, draw_cones
from fitted_people import CAMERA, POSES

from kpopnet.skeleton import Joint
from kpopnet.tracker.body import PARTS, RADII_M
from kpopnet.tracker.cells import cells_of
from kpopnet.tracker.cones import axes_of, extend, nearest_parts
from kpopnet.tracker.flesh import Flesh, fitted, picture_of, program

THICKER = 1.25


@pytest.fixture(scope="module")
def pictures():
    """People from the front and from behind, thicker than the body they are compared with."""
    found = []
    for person, (pose, behind) in enumerate((pose, behind) for pose in POSES.values() for behind in (0, 180)):
        joints = cone_joints(**{**pose, "yaw_deg": pose.get("yaw_deg", 0) + behind})
        body = cone_body(joints)
        depth = draw_cones(joints, body._replace(radii_m=THICKER * body.radii_m), CAMERA)
        found.append(picture_of(person % 2, joints, depth, CAMERA))
    return found


def test_distances_are_those_that_the_tracker_goes_by() -> None:
    joints = cone_joints(**POSES["elbows bent"])
    body = cone_body(joints)
    depth = draw_cones(joints, body, CAMERA)
    with torch.no_grad():
        off = Flesh(1).off_surface_m(picture_of(0, joints, depth, CAMERA)).numpy()
    axes = axes_of(extend(joints, body.places_m), PARTS, body.radii_m)
    np.testing.assert_allclose(off, nearest_parts(axes, cells_of(depth, CAMERA).points_m, 1)[1], atol=1e-5)


def test_thicker_people_are_found_thicker(pictures) -> None:
    flesh = fitted(pictures, steps=150)
    whole = flesh.radii_m + flesh.otherwise_m.mean(dim=0)[:, None]
    thicker = dict(zip(RADII_M, (whole.detach().numpy() / np.array(list(RADII_M.values()))).tolist(), strict=True))
    uncovered = ((Joint.NECK, Joint.HEAD, 1), (Joint.RIGHT_HIP, Joint.RIGHT_KNEE, 1), (Joint.RIGHT_ELBOW, Joint.RIGHT_HAND, 0))
    for first, last, end in uncovered:
        assert thicker[first, last][end] == pytest.approx(THICKER, abs=0.1)
    with torch.no_grad():
        off = torch.cat([flesh.off_surface_m(picture) for picture in pictures]).abs().mean()
        was = torch.cat([Flesh(2).off_surface_m(picture) for picture in pictures]).abs().mean()
    assert off < 0.4 * was


def test_nothing_seen_is_no_picture() -> None:
    assert picture_of(0, cone_joints(), np.zeros((CAMERA.height, CAMERA.width), np.float32), CAMERA) is None


def test_a_folder_without_people_is_refused(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.setattr("sys.argv", ["flesh", str(tmp_path)])
    with pytest.raises(SystemExit):
        program()
    assert "no shards" in capsys.readouterr().err
