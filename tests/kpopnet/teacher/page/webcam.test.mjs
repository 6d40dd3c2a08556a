// What the page sends of a picture.
import assert from "node:assert/strict";
import { test } from "node:test";
import "./dom.mjs";

const { loadPose, pointsOf, Webcam, withoutDepth } = await import("../../../../kpopnet/teacher/page/webcam.js");

const at = (x, y) => ({ poseLandmarks: [{ x, y, z: 0, visibility: 0.8 }], poseWorldLandmarks: [{ x: 0.123456, y: -1, z: 2 }] });

test("a point has its place in metres, in the picture, and how visible it is", () => {
  assert.deepEqual(pointsOf(at(0.5, 0.25)), [[0.1235, -1, 2, 0.5, 0.25, 0.8]]);
});

test("without a person there are no points", () => {
  assert.deepEqual(pointsOf({}), []);
});

test("a point outside the picture, or in the bars beside a wide one, is not visible", () => {
  for (const [x, y] of [[-0.01, 0.5], [1.01, 0.5], [0.5, 1.2]]) assert.equal(pointsOf(at(x, y))[0][5], 0);
  assert.equal(pointsOf(at(0.5, 0.95))[0][5], 0.8);
  for (const y of [0.05, 0.95]) assert.equal(pointsOf(at(0.5, y), [0, 0.25])[0][5], 0);
});

test("a webcam that is refused or missing is told, whatever the button of the view is called", async () => {
  for (const [name, told] of [["NotAllowedError", /allow it beside the address.* try again$/], ["NotFoundError", /choose another camera$/], ["Odd", /failed: odd/]]) {
    const mediaDevices = { getUserMedia: () => Promise.reject(Object.assign(new Error("odd"), { name })) };
    Object.defineProperty(globalThis, "navigator", { value: { mediaDevices }, configurable: true });
    assert.match(await new Promise((failed) => { new Webcam(assert.fail, failed); }), told);
  }
});

test("the whole of a wide picture is seen, between bars whose share is told", () => {
  let drawn;
  const canvas = { getContext: () => ({ drawImage: (_, ...place) => { drawn = place; } }) };
  const webcam = Object.assign(Object.create(Webcam.prototype), { pictures: [{ canvas }], video: { videoWidth: 1280, videoHeight: 720 } });
  assert.deepEqual([webcam.draw(5), drawn, webcam.pictures[0].taken], [[0, 0.25], [0, 60, 640, 360], 5]);
});

// Workers of which each answers every message as `answers` says: not at all because it did not load, or by a message.
function workers(answers) {
  const made = [];
  globalThis.Worker = class extends EventTarget {
    constructor() {
      super();
      this.answer = answers[made.length];
      made.push(this);
    }

    postMessage(message) {
      queueMicrotask(() => {
        if (this.ended) return;
        this.dispatchEvent(this.answer ? Object.assign(new Event("message"), { data: this.answer(message) }) : new Event("error"));
      });
    }

    terminate() {
      this.ended = true;
    }
  };
  return made;
}

test("a network that did not load, or does not begin, is loaded again by the next lesson", async () => {
  const made = workers([null, () => ({ error: "no graphics" }), () => ({ found: {} })]);
  await assert.rejects(loadPose, /does not answer/);
  await assert.rejects(loadPose, /no graphics/);
  assert.equal(await loadPose(), await loadPose());
  assert.deepEqual(made.map(({ ended }) => ended), [true, true, undefined]);
});

test("a picture is handed to the thread, and what it says of it comes back, also that it failed", async () => {
  globalThis.createImageBitmap = async (canvas) => ({ of: canvas });
  workers([() => ({ found: {} }), () => ({ found: {} })]);
  const pose = await loadPose(), said = [{ found: at(0.5, 0.5) }, { error: "out of memory" }];
  pose.worker.answer = ({ picture, at_ms }) => Object.assign(said.shift(), { picture, at_ms });
  assert.deepEqual(await pose.find("canvas", 40), at(0.5, 0.5));
  await Promise.all([pose.find("canvas", 80), pose.anew()].map((one) => assert.rejects(one, /out of memory/)));
  assert.notEqual(await loadPose(), pose);
});

test("a webcam that is closed is let go of, also one that the user allows after that", async () => {
  for (const early of [true, false]) {
    let allow, stopped = 0;
    const mediaDevices = { getUserMedia: () => new Promise((take) => { allow = take; }) };
    Object.defineProperty(globalThis, "navigator", { value: { mediaDevices }, configurable: true });
    workers([() => ({ found: {} })]);
    const webcam = new Webcam(assert.fail, assert.fail);
    Object.assign(webcam.video, { play: () => new Promise(() => {}) });
    if (early) webcam.close();
    allow({ getTracks: () => [{ addEventListener() {}, stop() { stopped += 1; } }] });
    await new Promise(globalThis.setImmediate);
    if (!early) webcam.close();
    assert.equal(stopped, 1, early);
  }
});

test("of a webcam no sound is asked for; what happens after it was closed is not told; a page that gets none says where it would", async () => {
  const asked = [], track = { addEventListener(_, listener) { this.end = listener; }, stop() {} };
  let refuse, told;
  const mediaDevices = { getUserMedia: (wanted) => { asked.push(wanted.audio); return new Promise((_, fail) => { refuse = fail; }); } };
  Object.defineProperty(globalThis, "navigator", { value: { mediaDevices }, configurable: true });
  new Webcam(assert.fail, assert.fail).close();
  refuse(new Error("odd"));
  workers([() => ({ found: {} })]);
  mediaDevices.getUserMedia = async () => ({ getTracks: () => [track] });
  const closed = new Webcam(assert.fail, assert.fail);
  closed.video.play = () => new Promise(() => {});
  await new Promise(globalThis.setImmediate);
  closed.close();
  track.end();
  assert.deepEqual(asked, [false]);
  Object.defineProperty(globalThis, "navigator", { value: {}, configurable: true });
  new Webcam(assert.fail, (text) => { told = text; });
  await new Promise(globalThis.setImmediate);
  assert.match(told, /127\.0\.0\.1/);
});

test("what depth would add is said where a webcam is chosen, and there alone", () => {
  const source = Object.assign(document.createElement("select"), { value: "webcam" }), line = withoutDepth(source);
  assert.equal(line.hidden, false);
  Object.assign(source, { value: "realsense" }).listeners.change();
  assert.equal(line.hidden, true);
});
