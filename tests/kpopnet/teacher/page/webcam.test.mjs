// What the page sends of a picture.
import assert from "node:assert/strict";
import { test } from "node:test";
import "./dom.mjs";

const { cutOut, joined, loadPose, pointsOf } = await import("../../../../kpopnet/teacher/page/webcam.js");

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
  assert.equal(pointsOf(at(0.5, 0.95), [0, 0.25])[0][5], 0);
});

test("a cut recording begins and ends with its excerpt, and keeps the times in between", () => {
  const frames = [0.5, 1.2, 1.3, 2.5, 3.5].map((time_s) => [time_s, [[time_s, 0, 0, 0.5, 0.5, 1]]]);
  const cut = cutOut(frames, 1, 3).frames.map(({ time_s, points: [[x, , , , , visibility]] }) => [time_s, x, visibility]);
  assert.deepEqual(cut, [[0, 1.2, 1], [0.2, 1.2, 1], [0.3, 1.3, 1], [1.5, 2.5, 1], [2, 2.5, 1]]);
  assert.deepEqual(cutOut(frames, 4, 9).frames, []);
});

test("a joint is the mean of its points", () => {
  const joints = joined(Array.from({ length: 33 }, (_, k) => [k, 0, 0, 0, 0, 1]));
  assert.deepEqual(joints.map(([x]) => x), [7.5, 11.5, 12, 11, 14, 13, 18, 17, 17.5, 24, 23, 26, 25, 30, 29]);
});

test("a network that did not load, or does not begin, is loaded again by the next lesson", async () => {
  let answers = ["error", "load", "load", "load"], asked = 0;
  document.head = { append: (script) => { asked++; script.listeners[answers.shift()](); } };
  globalThis.Pose = class {
    setOptions() {
      if (asked === 2) throw new Error("no memory");
    }

    async initialize() {
      if (asked === 3) throw new Error("no graphics");
    }
  };
  await assert.rejects(loadPose, /does not answer/);
  await assert.rejects(loadPose, /no memory/);
  await assert.rejects(loadPose, /no graphics/);
  assert.equal(await loadPose(), await loadPose());
  assert.equal(asked, 4);
});
