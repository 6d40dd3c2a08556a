// What the page sends of a picture.
import assert from "node:assert/strict";
import { test } from "node:test";
import { pointsOf } from "../../../../kpopnet/teacher/page/webcam.js";

const at = (x, y) => ({ poseLandmarks: [{ x, y, z: 0, visibility: 0.8 }], poseWorldLandmarks: [{ x: 0.123456, y: -1, z: 2 }] });

test("a point has its place in metres, in the picture, and how visible it is", () => {
  assert.deepEqual(pointsOf(at(0.5, 0.25)), [[0.1235, -1, 2, 0.5, 0.25, 0.8]]);
});

test("nobody has no points", () => {
  assert.deepEqual(pointsOf({}), []);
});

test("a point outside the picture, or in the bars beside a wide one, is not visible", () => {
  for (const [x, y] of [[-0.01, 0.5], [1.01, 0.5], [0.5, 1.2]]) assert.equal(pointsOf(at(x, y))[0][5], 0);
  assert.equal(pointsOf(at(0.5, 0.95))[0][5], 0.8);
  assert.equal(pointsOf(at(0.5, 0.95), [0, 0.25])[0][5], 0);
});
