"""A webcam as a learner's eye in a real browser: a film of a SIMULATED learner is its camera, and joints reach the scorer."""

import logging
import socket
import time
from contextlib import closing

import numpy as np
import pytest

pytest.importorskip("aiohttp", reason="the extra app is not installed")

from programs import tool
from teacher_page import chromium, served, skip_without_browser
from webcam_films import STAMP_BITS, STAMP_PX, FilmedLearner, write_film

from kpopnet.dance.joint_files.mediapipe import CAMERA
from kpopnet.skeleton import Joint
from kpopnet.teacher.live.webcam import WebcamEstimator, read_seen

skip_without_browser()

FRAMES, REPEATED = 24, 6
"""Frames of the film, and how often each is shown: slow machines drop fewer of them."""

NOTE_STAMPS = f"""
window.stamps = [];
let stamp = -1;
const draw = CanvasRenderingContext2D.prototype.drawImage, send = WebSocket.prototype.send;
CanvasRenderingContext2D.prototype.drawImage = function (image, ...rest) {{
  draw.call(this, image, ...rest);
  if (!(image instanceof HTMLVideoElement)) return;
  const row = this.getImageData(0, {STAMP_PX // 2}, {STAMP_BITS * STAMP_PX}, 1).data;
  stamp = 0;
  for (let bit = 0; bit < {STAMP_BITS}; bit++) if (row[4 * ({STAMP_PX} * bit + {STAMP_PX // 2})] > 128) stamp |= 1 << bit;
}};
WebSocket.prototype.send = function (text) {{
  if (JSON.parse(text).do === "see") stamps.push(stamp);
  return send.call(this, text);
}};
"""
"""Notes the number of the film's frame from which the points of each message were found."""

LEAVE = """
const [outside, done] = arguments, refused = [];
document.addEventListener("securitypolicyviolation", ({ effectiveDirective }) => refused.push(effectiveDirective));
const sent = fetch(outside, { mode: "no-cors" }).then(() => "sent", () => "not sent");
const thread = fetch("/page/pose_worker.js").then(({ headers }) => headers.get("Content-Security-Policy"));
Promise.all([sent, thread]).then(([sent, thread]) => setTimeout(() => done([sent, refused, thread]), 100));
"""
"""Tries to send something to another server: whether it was, what refused it, and the policy of MediaPipe's thread."""


def test_a_learner_before_a_webcam_is_scored_by_joints_near_the_true_ones(library, teaching, tmp_path, monkeypatch, caplog):
    caplog.set_level(logging.INFO, "aiohttp.access")
    dance, heard, film = library.dance("dance_001"), [], tmp_path / "film.mjpeg"
    learner = FilmedLearner(dance.quats, dance.hips_m, dance.fps, "perfect", seed=61)
    true_m = write_film(film, learner, range(FRAMES), REPEATED)

    def note(message):
        heard.append(read_seen(message))
        return heard[-1]

    monkeypatch.setattr("kpopnet.teacher.server.read_seen", note)
    with served(teaching) as address, chromium(webcam=film) as browser:
        browser.get(address)
        browser.execute_script("localStorage.setItem('teach.source', JSON.stringify('webcam'))")
        browser.get(f"{address}#/dance/dance_001?speed=25")
        start = browser.find("#start")
        assert "depth camera adds" in browser.find("#without-depth").text
        browser.execute_script(NOTE_STAMPS)
        start.click()
        browser.until(lambda one: one.find("#so-far").text.isdigit())
        stamps = browser.execute_script("return stamps")
        asked = browser.loaded
        start.click()
        asked_after = len(heard)
        time.sleep(1)
        assert len(heard) <= asked_after + 1  # a lesson that ends lets go of the webcam
        assert browser.find("#error").text == ""
        browser.execute_script("location.hash = '#/record'; window.asked = 0; window.confirm = () => asked++ > 0")
        browser.find("#bpm")
        browser.find("#start").click()
        browser.back()  # a dance that is recorded would be lost
        browser.until(lambda one: one.execute_script("return asked") == 1)
        assert browser.current_url.endswith("#/record") and browser.find("#start").text == "Stop"
        browser.back()
        browser.find("#practise")
        with closing(socket.create_server(("127.0.0.1", 0))) as other:
            left, refused, policy = browser.execute_async_script(LEAVE, f"http://127.0.0.1:{other.getsockname()[1]}/")
        assert (left, refused) == ("not sent", ["connect-src"])
        assert "default-src 'none'" in policy and "connect-src 'self'" in policy and "script-src 'self'" in policy
    assert asked and all(name.startswith(address) for name in asked)
    assert all(any(f"{end} HTTP" in line for line in caplog.messages) for end in (".wasm", ".tflite", ".binarypb", ".data"))
    errors_m = []
    for stamp, seen in zip(stamps, heard, strict=False):
        for person in WebcamEstimator().update(seen.person, CAMERA):
            # A webcam knows how far away a person is only by how large people are: about the torso.
            found_m, expected_m = person.joints_camera_m, true_m[stamp]
            errors_m.append(np.linalg.norm(found_m - found_m[Joint.TORSO] - expected_m + expected_m[Joint.TORSO], axis=1))
    assert len(errors_m) >= 10 and len(set(stamps)) >= 5
    assert np.mean(errors_m) < 0.1 and np.mean(np.array(errors_m) < 0.1) > 0.6


def test_the_measuring_tool_finds_the_points_of_a_picture(library):
    """Those of the page's own module, in a page of its own."""
    measure_webcam, dance = tool("measure_webcam"), library.dance("dance_001")
    bgr, true_m = FilmedLearner(dance.quats, dance.hips_m, dance.fps, "perfect", seed=62).picture(0)
    with measure_webcam.webcam_page() as browser:
        points = measure_webcam.points_in(browser, bgr, True, 33.0)
    (person,) = WebcamEstimator().update(read_seen({"points": points, "age_ms": 0.0}).person, CAMERA)
    found_m, expected_m = (one - one[Joint.TORSO] for one in (person.joints_camera_m, true_m))
    assert np.linalg.norm(found_m - expected_m, axis=1).mean() < 0.1
