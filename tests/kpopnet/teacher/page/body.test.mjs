// Movements of the server on the bones of a body.
import assert from "node:assert/strict";
import { mock, test } from "node:test";

import { Dancer, DrawingLoad, View, distanceOf, movementOf } from "../../../../kpopnet/teacher/page/body.js";
import { Figure, JOINTS } from "../../../../kpopnet/teacher/page/figure.js";
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
  assert.ok(Math.abs(at(0.1).bend - Math.PI / 10) < 1e-3);
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

test("hair is dark above the brow and behind the ears, and neither on a face nor on a neck", () => {
  const places = [[0, -0.1, 1.72], [0, 0, 1.78], [0, -0.1, 1.65], [0, 0.1, 1.65], [0, 0.1, 1.5]]; // brow, crown, face, back of the head, nape
  const body = {
    ...BODY, names: ["Hips", "Head"], heads_m: [[0, 0, 1], [0, 0, 1.6]],
    vertices: new Float32Array(places.flat()), bones: new Uint16Array(20).fill(1), weights: new Float32Array(20).fill(0.25),
  };
  const shown = new Dancer(body, "teacher").mesh.geometry.attributes.color.array;
  assert.deepEqual(places.map((_, vertex) => shown[3 * vertex] < 0.2), [true, true, false, true, false]);
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

// A canvas of a browser without WebGL, and the lines that are drawn on it: their ends, width and colour.
function flatCanvas() {
  const drawings = [], pen = {
    clearRect: () => drawings.push([]), beginPath() {}, stroke() {},
    moveTo(...from) { this.from = from; }, lineTo(...to) { drawings.at(-1).push({ from: this.from, to, wide: this.lineWidth, ink: this.strokeStyle, opacity: this.globalAlpha }); },
  };
  const canvas = { clientWidth: 400, clientHeight: 300, style: {}, addEventListener() {}, removeEventListener() {}, getContext: (kind) => (kind === "2d" ? pen : null) };
  return [Object.assign(canvas, { ownerDocument: canvas, getRootNode: () => canvas }), drawings];
}

test("without WebGL bones are lines where WebGL would draw them, the nearest last, and what stands still is drawn twice", () => {
  globalThis.devicePixelRatio = 1;
  mock.method(globalThis.console, "error", () => {}); // three.js tells what the browser lacks
  const [canvas, drawings] = flatCanvas(), view = new View(canvas), near = view.add(BODY, "teacher", 0.5), far = view.add(BODY, "learner", -0.5);
  [near.movement, far.movement, far.group.position.z] = [MOVEMENT, MOVEMENT, -1];
  for (let k = 0; k < 4; k++) view.draw(0);
  assert.equal(drawings.length, 2);
  assert.deepEqual(drawings[0], drawings[1]);
  const upright = drawings[0].filter(({ wide }) => wide > 5), seen = (x, y, z) => {
    const place = new Vector3(x, y, z).project(view.camera);
    return [200 * (1 + place.x), 150 * (1 - place.y)];
  };
  assert.deepEqual(upright.map(({ ink }) => ink), ["#56606b", "#3d4b78"]); // hips to spine, of the learner and of the teacher
  for (const [{ from, to }, x, z] of [[upright[0], -0.5, -1], [upright[1], 0.5, 0]]) {
    for (const [found, y] of [[from, 1], [to, 1.5]]) seen(x, y, z).forEach((expected, axis) => assert.ok(Math.abs(found[axis] - expected) < 0.01));
  }
  assert.ok(upright[0].wide < upright[1].wide);
  view.mirror(true);
  view.draw(0);
  const mirrored = drawings[2].filter(({ wide }) => wide > 5);
  assert.ok(Math.abs(mirrored[1].from[0] + upright[1].from[0] - 400) < 0.01);
  view.draw(0.5);
  assert.equal(drawings.length, 4);
  const done = [];
  for (const what of ["dispose", "forceContextLoss"]) view.renderer[what] = () => done.push(what);
  view.close(); // a browser has but few contexts
  assert.deepEqual(done, ["dispose", "forceContextLoss"]);
});

test("without WebGL a body has a head", () => {
  const [canvas, drawings] = flatCanvas(), view = new View(canvas);
  view.add({ ...BODY, names: ["Hips", "Head"] }, "teacher", 0).movement = MOVEMENT;
  view.draw(0);
  assert.deepEqual(drawings[0].filter(({ from, to, wide }) => from[0] === to[0] && from[1] === to[1] && wide > 5).map(({ ink }) => ink), ["#d9a57e"]);
  view.close();
});

test("a group that is zoomed stays so until the picture has another shape", () => {
  const [canvas] = flatCanvas(), view = new View(canvas), far_m = () => view.camera.position.length();
  view.fit([{ x: -2, z: 0 }, { x: 2, z: 0 }]);
  view.draw(0);
  const fitted_m = far_m();
  view.back(2);
  canvas.clientWidth = 800;
  canvas.clientHeight = 600;
  view.draw(0);
  assert.ok(far_m() < 3 && fitted_m > 4);
  canvas.clientWidth = 300;
  view.draw(0);
  assert.ok(far_m() > fitted_m);
  view.close();
});

test("without WebGL a figure's bones and joints are drawn in their colours, but for missing ones", () => {
  const [canvas, drawings] = flatCanvas(), view = new View(canvas), figure = new Figure((part) => (part === "torso" ? "#112233" : "#445566"));
  view.stage.add(figure.group);
  figure.place(Array.from({ length: JOINTS }, (_, joint) => (joint === 14 ? null : [joint / 20, 1, 0])), Array(JOINTS).fill(0.4));
  view.draw(0);
  const drawn = drawings[0].filter(({ ink }) => ink !== "#777286"), count = (ink, ball) => drawn.filter((one) => one.ink === ink && ball === (one.from[0] === one.to[0])).length;
  assert.deepEqual([count("#112233", false), count("#112233", true), count("#445566", false), count("#445566", true)], [6, 7, 7, 7]);
  assert.ok(drawn.every(({ opacity }) => opacity === 0.4));
});

test("a bone is as pale as the less sure of its joints, and the head is the largest joint", () => {
  const figure = new Figure(() => "#112233"), sure = Array(JOINTS).fill(1).with(6, 0.3); // the right hand is not
  figure.place(Array.from({ length: JOINTS }, (_, joint) => [joint / 20, 1, 0]), sure);
  assert.deepEqual(figure.bones.filter(({ material }) => material.opacity === 0.3).length, 1);
  assert.ok(figure.joints.every(({ scale }, joint) => joint === 0 || scale.x < figure.joints[0].scale.x / 2));
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

// Where the second bone's head, and a point a metre along x of it, are in the world of the movements.
function shown(turn, hips_m, t_pose = [EYE, EYE]) {
  const body = {
    names: ["Hips", "Spine"], parents: [-1, 0], heads_m: [[0, 0, 1], [0, 0.2, 1.5]], t_pose,
    vertices: new Float32Array([0, 0, 1, 0, 0, 1.5, 0.1, 0, 1.5]), faces: new Uint16Array([0, 1, 2]),
    bones: new Uint16Array(12), weights: new Float32Array([1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0]),
  };
  const dancer = new Dancer(body, "teacher");
  dancer.movement = movementOf({ fps: 1, hips_m: packed(new Float32Array(hips_m)), quats: packed(new Int16Array([...turn, 32767, 0, 0, 0])) });
  dancer.show(0);
  dancer.mesh.updateMatrixWorld(true);
  const at = (place) => dancer.mesh.worldToLocal(dancer.bones[1].localToWorld(new Vector3(...place))).toArray().map((v) => Number(v.toFixed(3)) + 0);
  return [at([0, 0, 0]), at([1, 0, 0])];
}

test("a quarter turn about each axis, and a place, are those of the movement", () => {
  assert.deepEqual(shown([32767, 0, 0, 0], [0.3, 0.7, 1]), [[0.3, 0.9, 1.5], [1.3, 0.9, 1.5]]);
  assert.deepEqual(shown([HALF, 0, 0, HALF], [0, 0, 1]), [[-0.2, 0, 1.5], [-0.2, 1, 1.5]]); // about z: x goes to y
  assert.deepEqual(shown([HALF, 0, HALF, 0], [0, 0, 1]), [[0.5, 0.2, 1], [0.5, 0.2, 0]]); // about y: z goes to x
});

test("a bone begins where the T-pose of its parent has it", () => {
  const quarter = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]; // about z
  assert.deepEqual(shown([32767, 0, 0, 0], [0, 0, 1], [quarter, EYE])[0], [-0.2, 0, 1.5]);
});
