// Movements of the server on the bones of a body.
import assert from "node:assert/strict";
import { mock, test } from "node:test";

import { Dancer, DrawingLoad, distanceOf, movementOf } from "../../../../kpopnet/teacher/page/body.js";
import { PerspectiveCamera, Vector3 } from "../../../../kpopnet/teacher/page/vendor/three.js";

const packed = (array) => btoa(String.fromCharCode(...new Uint8Array(array.buffer)));
const EYE = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
const BODY = {
  names: ["Hips", "Spine"], parents: [-1, 0], heads_m: [[0, 0, 1], [0, 0, 1.5]], t_pose: [EYE, EYE],
  vertices: new Float32Array([0, 0, 1, 0, 0, 1.5, 0.1, 0, 1.5]), faces: new Uint16Array([0, 1, 2]),
  bones: new Uint16Array(12), weights: new Float32Array([1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0]),
};
// Two frames a second: the spine turns by a right angle about x while the hips rise by 2 m.
const HALF = Math.round(32767 * Math.SQRT1_2);
const MOVEMENT = movementOf({
  fps: 2, hips_m: packed(new Float32Array([0, 0, 1, 0, 0, 3])),
  quats: packed(new Int16Array([32767, 0, 0, 0, 32767, 0, 0, 0, 32767, 0, 0, 0, HALF, HALF, 0, 0])),
});

function at(time_s) {
  const dancer = new Dancer(BODY, "teacher");
  dancer.movement = MOVEMENT;
  dancer.show(time_s);
  return { height_m: dancer.bones[0].position.z, bend: 2 * Math.acos(dancer.bones[1].quaternion.w) };
}

test("between two frames rotations and places are interpolated", () => {
  const between = at(0.25);
  assert.ok(Math.abs(between.height_m - 2) < 1e-6 && Math.abs(between.bend - Math.PI / 4) < 1e-3);
});

test("before the begin and after the end a body stands still", () => {
  assert.ok(Math.abs(at(-1).height_m - 1) < 1e-6 && Math.abs(at(9).bend - Math.PI / 2) < 1e-3);
});

test("a movement that begins later is shown later", () => {
  const dancer = new Dancer(BODY, "learner");
  dancer.movement = { ...MOVEMENT, begin_s: 4 };
  dancer.show(4.25);
  assert.ok(Math.abs(dancer.bones[0].position.z - 2) < 1e-6);
});

test("a group is seen from its left to its right, in a wide picture and on a phone", () => {
  for (const [aspect, least_m] of [[1.5, 3.8], [187 / 248, 6]]) {
    for (const half_m of [0, 1.2, 4.8]) {
      const places = [{ x: -half_m, z: 0 }, { x: half_m, z: 1 }], camera = new PerspectiveCamera(38, aspect, 0.1, 60);
      camera.position.set(0, 1, distanceOf(places, aspect));
      camera.updateMatrixWorld();
      for (const { x, z } of places) assert.ok(Math.abs(new Vector3(x, 1, z).project(camera).x) < 0.9, `${half_m} m at ${aspect}`);
      assert.ok(distanceOf(places, aspect) >= 3.8 && (half_m < 4 || distanceOf(places, aspect) > least_m));
    }
  }
});

// Draws for ten seconds on a screen of 60 images a second by a machine that takes took_ms(ratio, drawing) for a drawing: the share
// of the screen's images that were drawn, the pixels for each of the page's in the end, and the longest wait for a drawing.
function drawnBy(took_ms, density = 1) {
  let now_ms = 0, done_ms = 0, drawings = 0, last_ms = 0, longest_ms = 0;
  mock.method(performance, "now", () => now_ms);
  const load = new DrawingLoad({
    UNSIGNALED: 0, fenceSync: () => ({}), deleteSync() {}, flush() {},
    getSyncParameter: () => (now_ms >= done_ms ? 1 : 0),
    readPixels() { now_ms = Math.max(now_ms, done_ms); },
  }, density);
  for (let image = 0; image < 600; image++) {
    now_ms = Math.max(now_ms, image * 1000 / 60);
    if (!load.allows(now_ms)) continue;
    longest_ms = Math.max(longest_ms, now_ms - last_ms);
    last_ms = now_ms;
    done_ms = now_ms + took_ms(load.ratio, drawings++);
    load.drawn(last_ms);
  }
  mock.restoreAll();
  return { share: drawings / 600, ratio: load.ratio, longest_ms };
}

test("a fast machine draws every time, and finer than the screen where it can", () => {
  for (const fine_ms of [0.5, 2, 3, 5]) assert.equal(drawnBy((ratio) => fine_ms * ratio ** 2).share, 1, fine_ms);
  assert.equal(drawnBy((ratio) => 0.5 * ratio ** 2).ratio, 2);
  assert.ok(drawnBy((ratio) => 0.2 * ratio ** 2, 2).ratio > 2.8); // a screen of twice the density
  assert.equal(drawnBy(() => 0.1, 3).ratio, 2 * Math.SQRT2);
});

test("a slow machine draws a third of the time at most, and coarser where it is very slow", () => {
  const { share, ratio } = drawnBy(() => 12);
  assert.ok(Math.abs(share - 1 / 3) < 0.1 && ratio === 1);
  for (const density of [1, 2, 3]) {
    const slow = drawnBy((fine) => 20 + 40 * fine ** 2, density);
    assert.ok(Math.abs(slow.ratio - Math.min(density, 2) / Math.SQRT2) < 1e-9 && slow.share < 0.2);
  }
  assert.ok(drawnBy(() => 200).share < 0.04);
});

test("one stall of the machine is over with it", () => {
  for (const at of [1, 21, 30, 41]) {
    const { share, ratio, longest_ms } = drawnBy((_, drawing) => (drawing === at ? 2000 : 12));
    assert.ok(longest_ms < 2100 && ratio === 1 && share > 0.2, `${at} ${longest_ms} ${ratio} ${share}`);
  }
});
