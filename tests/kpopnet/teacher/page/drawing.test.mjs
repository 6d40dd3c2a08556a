// What is drawn of the learner, of the coming moves and of small figures, by a pen that keeps where it was.
import assert from "node:assert/strict";
import { mock, test } from "node:test";
import "./dom.mjs";

const PAGE = "../../../../kpopnet/teacher/page/";
const { LearnerView } = await import(`${PAGE}learner.js`);
const { Lane } = await import(`${PAGE}lane.js`);
const { sketch } = await import(`${PAGE}sketch.js`);
const { remember } = await import(`${PAGE}tools.js`);
Object.assign(globalThis, { devicePixelRatio: 1, getComputedStyle: () => ({ getPropertyValue: (name) => name }) });

// A canvas of a size, and its pen: lines in pixels with their ink, cards with their middle, and pictures.
function canvasOf(clientWidth, clientHeight) {
  let scale, x0, y0;
  const pen = {
    lines: [], cards: [], balls: [], pictures: [], drawings: 0,
    setTransform(a, b, c, d, e, f) { [scale, x0, y0] = [a, e, f]; },
    translate(x, y) { [x0, y0] = [x0 + x, y0 + y]; },
    transform(a, b, c, d, e) { [x0, scale] = [x0 + e, a]; },
    clearRect() { pen.drawings += 1; },
    moveTo() {},
    lineTo(x, y) { pen.lines.push({ to: [x0 + scale * x, y0 + y], ink: pen.strokeStyle, wide: pen.lineWidth, opacity: pen.globalAlpha }); },
    arc(x, y) { pen.balls.push([x0 + scale * x, y0 + y]); },
    roundRect(x, y, width) { pen.cards.push({ x: x + width / 2, opacity: pen.globalAlpha }); },
    fill() { if (pen.cards.length) pen.cards.at(-1).ink ??= pen.fillStyle; },
    createImageData: (width, height) => ({ data: new Uint8ClampedArray(4 * width * height) }),
    putImageData({ data }) { pen.pictures.push(data); },
    drawImage() {}, beginPath() {}, stroke() {}, fillRect() {}, fillText() {},
  };
  pen.setTransform(1, 0, 0, 1, 0, 0);
  return [Object.assign(document.createElement("canvas"), { clientWidth, clientHeight, getContext: () => pen }), pen];
}

const near = (a, b) => a.every((value, axis) => Math.abs(value - b[axis]) < 0.01);
const JOINTS = Array.from({ length: 15 }, () => [0.5, 0.5, 2, 1]);

test("the skeleton lies on the whole picture, in a mirror on its other side, bright where it is right, pale where it is unsure", () => {
  const [canvas, pen] = canvasOf(400, 400), picture = Object.assign(document.createElement("canvas"), { width: 640, height: 480 }); // 50 pixels above it are free
  const joints = Object.assign([...JOINTS], { 6: [0.25, 0.4, 2, 1], 7: [0.8, 0.4, 2, 0.1], 14: [null, null, null, 0] });
  const parts = { "right arm": 100, "left arm": 0, torso: 50 }, view = new LearnerView(canvas);
  const drawn = (mirrored) => {
    pen.lines.length = 0;
    view.show(picture, { joints, parts }, mirrored);
    return pen.lines;
  };
  for (const [mirrored, right, left] of [[false, 100, 320], [true, 300, 80]]) {
    const lines = drawn(mirrored), [right_hand, left_hand] = [right, left].map((x) => lines.findLast(({ to }) => near(to, [x, 170])));
    assert.deepEqual([right_hand, left_hand].map(({ ink, opacity }) => [ink, opacity]), [["rgb(255 255 235)", 1], ["rgb(60 60 55)", 0.45]]);
    assert.equal(lines.length, 2 * 13); // of fourteen bones, each with an outline
    assert.equal(right_hand.wide, left_hand.wide);
  }
  remember("palette", "safe");
  const [right_hand, left_hand] = [100, 320].map((x) => drawn(false).findLast(({ to }) => near(to, [x, 170])));
  assert.ok(left_hand.wide > right_hand.wide); // what is wrong does not rest on colour alone
  remember("palette", "brightness");
});

test("of a depth image the people stand out, and what has no depth is left out", () => {
  const [canvas] = canvasOf(30, 10), [small, pen] = canvasOf(), view = Object.assign(new LearnerView(canvas), { small });
  const pixels = [2, 4].map((depth_m) => 1 + Math.round((depth_m - 0.5) / 5 * 254)); // the learner's torso is 2 m away
  view.show(new Uint8Array([3, 0, 1, 0, ...pixels, 0]), { joints: JOINTS, parts: {} }, false);
  const [[...colours]] = pen.pictures, [person, wall, nothing] = [0, 4, 8].map((k) => colours.slice(k, k + 4));
  assert.ok(near(person.map((value) => value / 100), [1.1, 1.14, 1.4, 2.55]), person);
  assert.ok(wall[2] < 40 && wall[3] === 255 && nothing[3] === 0);
});

test("the lane has a card for each move of the excerpt but for those in free parts; the one that is due stands out, passed ones fade", () => {
  let now_ms = 0;
  mock.method(performance, "now", () => now_ms);
  const moves = [0.5, 1.1, 2, 3, 4.5].map((at_s) => ({ at_s, points_cm: Array(30).fill(0) }));
  const [canvas, pen] = canvasOf(1000, 100), lane = new Lane(canvas, moves, 0.5, [[2.8, 3.5]]);
  const draw = (time_s, ms) => {
    now_ms += ms;
    lane.draw(time_s, 0, 4, true);
    return pen.drawings;
  };
  assert.equal(draw(1, 0), 1);
  const cards = pen.cards.map(({ x, ink, opacity }) => [Number(x.toFixed(3)), ink, Number(opacity.toFixed(3))]);
  assert.deepEqual(cards, [[36, "--bar", 0.333], [136.8, "--accent", 1], [288, "--bar", 1]]);
  assert.deepEqual([draw(1, 100), draw(1.1, 10), draw(1.2, 100)], [1, 2, 3]); // what stands still is not drawn again
  mock.restoreAll();
});

test("each limb has the colour of its own part, and a finer screen a finer picture", () => {
  const [canvas, pen] = canvasOf(400, 300), picture = Object.assign(document.createElement("canvas"), { width: 400, height: 300 });
  const joints = JOINTS.map((_, k) => [0.05 * k, 0.5, 2, 1]), ends = { "right arm": [4, 6], "left arm": [5, 7], "right leg": [11, 13], "left leg": [12, 14] };
  for (const [part, limb] of Object.entries(ends)) {
    pen.lines.length = 0;
    new LearnerView(canvas).show(picture, { joints, parts: { [part]: 100 } }, false);
    const bright = pen.lines.filter(({ ink }) => ink === "rgb(255 255 235)").map(({ to: [x] }) => Math.round(x / 20));
    assert.deepEqual(bright, limb, part);
  }
  globalThis.devicePixelRatio = 2;
  new LearnerView(canvas).show(picture, { joints: null }, false);
  assert.deepEqual([canvas.width, canvas.height], [800, 600]);
  globalThis.devicePixelRatio = 1;
});

test("people beside each other are told apart by outline and head; one colour is the whole skeleton's; an unseen head is not drawn", () => {
  const [canvas, pen] = canvasOf(400, 300), picture = Object.assign(document.createElement("canvas"), { width: 400, height: 300 }), heads = [];
  pen.fill = () => heads.push(pen.fillStyle);
  const drawn = (frame) => {
    [pen.lines.length, heads.length] = [0, 0];
    new LearnerView(canvas).show(picture, frame, false);
    return [[...new Set(pen.lines.map(({ ink }) => ink))], [...heads]];
  };
  const parts = { torso: 100 }, beside = ["red", "blue"].map((outline) => ({ joints: JOINTS, parts, outline }));
  const [inks, seen] = drawn({ people: [beside[0], { joints: null }, beside[1]] });
  assert.deepEqual([["red", "blue"].every((ink) => inks.includes(ink)), seen], [true, ["red", "blue"]]);
  assert.deepEqual(drawn({ joints: JOINTS, colour: "white" }), [["#0009", "white"], ["white"]]);
  assert.deepEqual(drawn({ joints: JOINTS.with(0, [null, null, null, 0]), parts })[1], []);
});

test("the lane marks each beat and the begin of each phrase, what is now, and a free part as far as the excerpt has it", () => {
  const [canvas, pen] = canvasOf(1000, 100), marks = {}, names = [];
  pen.fillRect = (x, _, wide) => (marks[pen.fillStyle] ||= []).push([x, wide]);
  pen.fillText = (text, x) => names.push([text, x]);
  new Lane(canvas, [], 0.5, [[1, 9]]).draw(0, 0, 5, true);
  assert.deepEqual(marks["--quiet"].map(([x, wide]) => x + wide - 2), [120, 792]); // eight beats apart
  assert.deepEqual(marks["--line"].map(([x]) => x + 1), [1, 2, 3, 4, 5, 6, 7, 9, 10].map((beat) => 120 + 84 * beat));
  assert.deepEqual([marks["--bar"], names, marks["--accent"].map(([x, wide]) => x + wide / 2)], [[[288, 672]], [["free", 624]], [120]]);
});

test("the lane's figures turn with the mirror, and it is drawn anew with that and with the theme", () => {
  let now_ms = 0, ink = "dark";
  mock.method(performance, "now", () => now_ms);
  mock.method(globalThis, "getComputedStyle", () => ({ getPropertyValue: () => ink }));
  const points_cm = Array(30).fill(0), [canvas, pen] = canvasOf(1000, 100), lane = new Lane(canvas, [{ at_s: 2, points_cm }], 0.5, []);
  points_cm[12] = 30; // the right hand
  const hand = (mirrored) => {
    pen.lines.length = 0;
    lane.draw(1, 0, 4, mirrored);
    now_ms += 100;
    return pen.lines.length ? [Math.sign(pen.lines[5].to[0] - 288), pen.lines[5].ink] : null;
  };
  assert.deepEqual([hand(true), hand(false), hand(false)], [[-1, "dark"], [1, "dark"], null]);
  ink = "light";
  assert.deepEqual(hand(false), [1, "light"]);
  mock.restoreAll();
});

test("a small figure stands upright, in a mirror with its right hand on the other side", () => {
  for (const [mirrored, hand_x] of [[false, 115], [true, 85]]) {
    const [, pen] = canvasOf(), points = Array(30).fill(0);
    [points[1], points[12], points[13]] = [80, 30, 40]; // the head above, the right hand to the right
    sketch(pen, points, { x: 100, y: 50, scale: 0.5, ink: "black", mirrored });
    assert.deepEqual([pen.balls, pen.lines[5].to], [[[100, 10]], [hand_x, 30]]);
  }
});
