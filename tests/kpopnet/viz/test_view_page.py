"""The page in 3D: complete in itself, small, and its program shows the joints that it was given."""

import base64
import json
import re
import shutil
import subprocess

import numpy as np
import pytest
from capsule_people import CAMERA, draw_depth, draw_joints

from kpopnet.skeleton import Joint
from kpopnet.viz.view_page import Cloud, Shown, cloud_frames, sampled_cloud, view_page

BROWSER = """
const calls = {arc: [], fillRect: 0, fillText: []};
const painter = new Proxy({}, {get: (kept, name) => name in kept ? kept[name] : (...given) => {
  if (name === "arc") calls.arc.push(given);
  if (name === "fillRect") calls.fillRect++;
  if (name === "fillText") calls.fillText.push(given[0]);
}});
const elements = {};
const element = () => ({
  clientWidth: 800, clientHeight: 600, checked: false, value: "1", dataset: {view: "side"}, style: {}, listeners: {},
  getContext: () => painter, setAttribute() {}, append() {}, setPointerCapture() {}, click() { this.checked = !this.checked; },
  addEventListener(name, listener) { this.listeners[name] = listener; },
});
const document = Object.assign(element(), {
  documentElement: {}, getElementById: id => elements[id] ??= element(), querySelectorAll: () => [element()],
});
const window = {devicePixelRatio: 1};
const matchMedia = () => ({matches: true, addEventListener() {}});
const getComputedStyle = () => ({getPropertyValue: () => "1, 2, 3"});
class ResizeObserver { observe() {} }
const requestAnimationFrame = draw => draw(0);
const performance = {now: () => 0};
const key = name => document.listeners.keydown({key: name, target: {tagName: "BODY"}, preventDefault() {}});
"""
"""What the page's program needs of a browser."""


def recording(frames=5, people=1):
    joints_m = np.stack([draw_joints(np.random.default_rng(number)) for number in range(frames)])
    depth_m = [draw_depth(one) for one in joints_m]
    joints_m[3, Joint.LEFT_HAND] = np.nan
    shown = [Shown(joints_m + np.array([person, 0, 0]), np.full((frames, 15), 0.5)) for person in range(people)]
    clouds = [sampled_cloud(k, depth_m[k], CAMERA, [joints_m[k]], frames) for k in cloud_frames(frames)]
    return 2 + np.arange(frames) / 30, shown, clouds


def run(page: str, program: str):
    """What a program after the page's own prints, as JSON, in node."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("node is not installed")
    script = re.search(r"<script>(.*)</script>", page, re.DOTALL)[1]
    done = subprocess.run([node, "-"], input=BROWSER + script + program, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_the_page_asks_for_nothing_and_texts_are_texts():
    times_s, (person,), clouds = recording()
    title, label = '</script><img onerror="x">\ud800 "DATA" TITLE', "</script>"
    page = view_page(title, CAMERA, times_s, [person._replace(label=label)], clouds)
    assert "default-src 'none'" in page and not re.search(r"https?:|src=|<link|@import|fetch\(|url\(", page)
    assert page.count("<script>") == page.count("</script>") == 1 and "<img" not in page
    assert run(page, "console.log(JSON.stringify([last, calls.fillText]))") == [4, [label]]


def test_the_program_holds_the_joints_and_the_points():
    times_s, people, clouds = recording()
    found = run(
        view_page("a", CAMERA, times_s, people, clouds),
        "console.log(JSON.stringify({times: [...times], start: data.start, joints: [...people[0].joints],"
        "confidence: [...people[0].confidence], points: [...points.slice(0, 3 * data.clouds.ends[0])]}))",
    )
    np.testing.assert_allclose(found["times"], times_s - 2, atol=1e-6)
    assert found["start"] == 2
    joints_m = np.reshape(found["joints"], (5, 15, 3)) / 1000
    assert (joints_m[3, Joint.LEFT_HAND] < -32).all()
    joints_m[3, Joint.LEFT_HAND] = np.nan
    np.testing.assert_allclose(joints_m, people[0].joints_camera_m, atol=6e-4)
    assert set(found["confidence"]) == {128}
    np.testing.assert_allclose(np.reshape(found["points"], (-1, 3)) / 1000, clouds[0].points_camera_m, atol=6e-4)


def test_keys_walk_through_frames_and_every_known_joint_is_drawn():
    page = view_page("a", CAMERA, *recording(people=2))
    drawn = run(
        page,
        """
        const shown = [];
        const look = name => { calls.arc = []; calls.fillRect = 0; calls.fillText = []; key(name);
          shown.push([elements.time.textContent, calls.arc.length, calls.fillRect > 0, calls.fillText]); };
        elements.points.checked = true;
        ["Home", "ArrowRight", "ArrowRight", "ArrowRight", "End", "ArrowRight", "2", "w", "+"].forEach(look);
        console.log(JSON.stringify(shown));
        """,
    )
    assert [one[0] for one in drawn[:6]] == [f"{2 + k / 30:.2f} s, {k + 1} of 5" for k in (0, 1, 2, 3, 4, 4)]
    assert [one[1] for one in drawn] == [30, 30, 30, 28, 30, 30, 30, 30, 30]
    assert all(one[2] and one[3] == ["1", "2"] for one in drawn)


def test_the_camera_view_shows_joints_as_the_camera_saw_them():
    """Up to a shift, as the view looks at the person: differences of columns and rows are those of the pinhole."""
    times_s, people, clouds = recording()
    found = run(
        view_page("a", CAMERA, times_s, people, clouds),
        "calls.arc = []; key('Home'); console.log(JSON.stringify([calls.arc, focal, target, view.distance]))",
    )
    places, focal, target, distance = np.array([arc[:2] for arc in found[0]]), found[1], np.array(found[2]), found[3]
    points = people[0].joints_camera_m[0] - target
    expected = [400, 300] + focal * points[:, :2] / (points[:, 2:] + distance)
    np.testing.assert_allclose(places, expected, atol=1.0)
    assert distance == pytest.approx(target[2]) and focal == pytest.approx(600 * CAMERA.fy / CAMERA.height)


def test_a_long_recording_of_two_people_stays_below_ten_megabytes():
    frames = 60_000
    clouds = [Cloud(k, np.zeros((2500, 3), np.float32)) for k in cloud_frames(frames)]
    people = [Shown(np.zeros((frames, 15, 3)), np.ones((frames, 15)))] * 2
    page = view_page("long", CAMERA, np.arange(frames) / 30, people, clouds)
    assert len(clouds) <= 300 and len(page) < 10_000_000
    (shown,) = re.findall(r'"clouds":\{"frames":(\[[0-9,]*\])', page)
    kept = len(base64.b64decode(re.search('"times":"([^"]*)"', page)[1])) // 4
    step = round(frames / kept)
    assert step > 1 and json.loads(shown) == [cloud.frame // step for cloud in clouds]


def test_a_cloud_is_denser_on_people_and_bounded():
    joints_m = draw_joints(np.random.default_rng(0))
    person_m = draw_depth(joints_m)
    depth_m = np.where(person_m > 0, person_m, 6.0).astype(np.float32)
    cloud = sampled_cloud(0, depth_m, CAMERA, [joints_m], 150)
    assert len(cloud.points_camera_m) == 5000
    on_person = (cloud.points_camera_m[:, 2] < 5).mean()
    assert on_person > 3 * (person_m > 0).mean() and (cloud.points_camera_m[:, 2] > 5).any()
    for nothing in (0, 40):  # m: not measured, or farther than the page can hold
        assert len(sampled_cloud(0, np.full_like(depth_m, nothing), CAMERA, [], 1).points_camera_m) == 0
