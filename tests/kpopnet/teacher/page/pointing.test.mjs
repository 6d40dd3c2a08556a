// Point and hold: where a raised hand points, and when it has chosen.
import assert from "node:assert/strict";
import { test } from "node:test";
import { Dwell, pointed } from "../../../../kpopnet/teacher/page/pointing.js";

const NECK = [0.5, 0.3, 2, 1], HIP = [0.5, 0.6, 2, 1], HANGING = 0.62;

// A learner in the middle of the picture, whose right and left hands are at places in it.
function learner(right, left) {
  const joints = Array.from({ length: 15 }, () => [0.5, 0.45, 2, 1]);
  return Object.assign(joints, { 1: NECK, 6: [...right, 2, 1], 7: [...left, 2, 1], 9: HIP, 10: HIP });
}

test("a raised hand points, as in a mirror or not; a hanging one, an unsure one and no person do not", () => {
  const down = [0.35, HANGING], up = learner([0.4, 0.3], down); // 0.4 of a length from neck to hips to the picture's left
  const right = pointed(up, true), left = pointed(up, false);
  assert.ok(right.hand === 6 && right.x > 0.6 && Math.abs(right.x + left.x - 1) < 1e-9 && right.y > 0.4 && right.y < 0.6);
  assert.equal(pointed(learner(down, down), true), null);
  assert.equal(pointed(null, true), null);
  assert.equal(pointed(up.with(6, [0.4, 0.3, 2, 0.1]), true), null);
  assert.equal(pointed(up.with(9, [null, null, null, 0]), true), null);
  const near = learner([0.35, 0.3], down).map(([u, v, ...rest]) => [0.5 + 2 * (u - 0.5), 0.3 + 2 * (v - 0.3), ...rest]);
  assert.ok(Math.abs(pointed(near, true).x - pointed(learner([0.35, 0.3], down), true).x) < 1e-9); // how far away a person stands is nothing
});

test("of two raised hands the higher points, or the one that did", () => {
  const both = learner([0.4, 0.3], [0.6, 0.2]);
  assert.equal(pointed(both, true).hand, 7);
  assert.equal(pointed(both, true, 6).hand, 6);
});

// What is chosen while one thing after the other is pointed at, each for some milliseconds, 30 images a second.
function chosen(dwell, ...held) {
  const found = [];
  for (const [over, lasts_ms] of held) {
    for (const end_ms = chosen.now_ms + lasts_ms; chosen.now_ms < end_ms; chosen.now_ms += 33) {
      const one = dwell.see(over, chosen.now_ms);
      if (one !== null) found.push(one);
    }
  }
  return found;
}
chosen.now_ms = 0;

test("what is held is chosen once; passing over it, and holding first what was under the hand, is not enough", () => {
  const dwell = new Dwell();
  assert.deepEqual(chosen(dwell, ["a", 5000]), []); // it appeared under the hand
  assert.deepEqual(chosen(dwell, ["b", 900], ["a", 900], ["b", 900]), []);
  assert.equal(dwell.progress > 0.6, true);
  assert.deepEqual(chosen(dwell, ["b", 5000]), ["b"]);
  assert.equal(dwell.progress, 0);
  assert.deepEqual(chosen(dwell, ["a", 2000], ["b", 2000]), ["a", "b"]);
  dwell.renew();
  assert.deepEqual(chosen(dwell, ["c", 3000], [null, 500], ["c", 1500]), ["c"]);
});

test("a gap between images is no holding", () => {
  const dwell = new Dwell();
  dwell.see(null, 0);
  assert.deepEqual([100, 140, 5000].map((at_ms) => dwell.see("a", at_ms)), [null, null, null]);
  assert.ok(dwell.progress < 0.3);
});

test("a hand that is lost for a moment goes on, one that is gone begins again", () => {
  const dwell = new Dwell();
  assert.deepEqual(chosen(dwell, [null, 500], ["a", 800], [null, 200], ["a", 700]), ["a"]);
  dwell.renew();
  assert.deepEqual(chosen(dwell, [null, 500], ["a", 500], [null, 200], ["a", 500], [null, 200], ["a", 500]), ["a"]);
  dwell.renew();
  assert.deepEqual(chosen(dwell, [null, 500], ["a", 800], [null, 600], ["a", 800]), []);
  assert.deepEqual(chosen(dwell, [null, 5000]), []); // no person is there
});
