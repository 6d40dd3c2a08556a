"""Fits the thickness of people of cones with known thickness."""

import numpy as np
import pytest
import torch
from cone_people import cone_body, cone_joints, draw_cones
from fitted_people import CAMERA, POSES

from kpopnet.geometry.body import PARTS, RADII_M
from kpopnet.geometry.cones import extend_joints, nearest_parts, part_segments
from kpopnet.geometry.depth_grid import build_depth_grid
from kpopnet.skeleton import Joint
from kpopnet.training.body_shape import BodySurface, fit_surface, observe, program

THICKER = 1.25


@pytest.fixture(scope="module")
def frames():
    """People from the front and from behind, thicker than the initial body."""
    found = []
    for person, (pose, behind) in enumerate((pose, behind) for pose in POSES.values() for behind in (0, 180)):
        joints = cone_joints(**{**pose, "yaw_deg": pose.get("yaw_deg", 0) + behind})
        body = cone_body(joints)
        depth = draw_cones(joints, body._replace(radii_m=THICKER * body.radii_m), CAMERA)
        found.append(observe(person % 2, joints, depth, CAMERA))
    return found


def test_distances_agree_with_the_trackers() -> None:
    joints = cone_joints(**POSES["elbows bent"])
    body = cone_body(joints)
    depth = draw_cones(joints, body, CAMERA)
    with torch.no_grad():
        distance = BodySurface(1).signed_distance_m(observe(0, joints, depth, CAMERA)).numpy()
    axes = part_segments(extend_joints(joints, body.trunk_offsets_m), PARTS, body.radii_m)
    np.testing.assert_allclose(distance, nearest_parts(axes, build_depth_grid(depth, CAMERA).points_m, 1)[1], atol=1e-5)


def test_a_larger_thickness_is_recovered(frames) -> None:
    surface = fit_surface(frames, steps=150)
    mean_radii = surface.radii_m + surface.thickness_offset_m.mean(dim=0)[:, None]
    ratio = dict(zip(RADII_M, (mean_radii.detach().numpy() / np.array(list(RADII_M.values()))).tolist(), strict=True))
    uncovered = ((Joint.NECK, Joint.HEAD, 1), (Joint.RIGHT_HIP, Joint.RIGHT_KNEE, 1), (Joint.RIGHT_ELBOW, Joint.RIGHT_HAND, 0))
    for first, last, end in uncovered:
        assert ratio[first, last][end] == pytest.approx(THICKER, abs=0.1)
    with torch.no_grad():
        distance = torch.cat([surface.signed_distance_m(frame) for frame in frames]).abs().mean()
        initial = torch.cat([BodySurface(2).signed_distance_m(frame) for frame in frames]).abs().mean()
    assert distance < 0.4 * initial


def test_an_empty_image_gives_no_frame() -> None:
    assert observe(0, cone_joints(), np.zeros((CAMERA.height, CAMERA.width), np.float32), CAMERA) is None


def test_a_folder_without_people_is_refused(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.setattr("sys.argv", ["body_shape", str(tmp_path)])
    with pytest.raises(SystemExit):
        program()
    assert "no shards" in capsys.readouterr().err
