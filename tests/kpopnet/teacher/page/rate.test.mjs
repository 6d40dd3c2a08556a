// The page of a rater, without pictures in 3D and with a server that the test plays.
import assert from "node:assert/strict";
import { mock, test } from "node:test";
import { allOf } from "./dom.mjs";
import "./without_3d.mjs";

const packed = (array) => btoa(String.fromCharCode(...new Uint8Array(array.buffer)));
// A movement of two frames half a second apart whose joints are at a place, the first one later beside it; the last one is missing.
const moving = (x_mm) => ({ fps: 2, begin_s: 3, joints_mm: packed(new Int16Array([0, 100].flatMap((later) => [x_mm + later, 1000, 0, ...Array(39).fill(x_mm), ...Array(3).fill(-32768)]))) });
const main = document.createElement("main"), sent = [], answers = [], listeners = {};
let now_ms = 1000, done = 0, draw, damaged = false;
mock.method(performance, "now", () => now_ms);
Object.assign(document, { getElementById: () => main, addEventListener: (kind, listener) => { listeners[kind] = listener; }, activeElement: null });
Object.assign(globalThis, {
  location: { hash: "#eve%201" }, addEventListener() {}, matchMedia: () => ({ matches: false }), requestAnimationFrame: (call) => { draw = call; },
  fetch: async (path, { body } = {}) => {
    if (!body && damaged) return Response.json({ error: "left.npz: damaged" }, { status: 400 });
    if (!body) return Response.json({ done, of: 3, from_s: 3, to_s: 4, left: moving(-500), teacher: moving(0), right: moving(700) });
    sent.push(JSON.parse(body));
    return new Promise((answer) => { answers.push(answer); });
  },
});
await import("../../../../kpopnet/teacher/page/rate.js");
const { views } = await import("../../../../kpopnet/teacher/page/body.js");
const get = (id) => allOf(main).find((one) => one.id === id), settled = () => new Promise((go) => { setTimeout(go, 5); });
const press = (key, more = {}) => listeners.keydown({ key, target: { closest: () => null }, preventDefault() {}, ...more });
const passes = (ms) => draw(now_ms += ms);

async function answered(reply, status = 200) {
  done += Number(status === 200);
  answers.pop()(Response.json(reply, { status }));
  await settled();
}

test("each of a pair is shown on their side of the teacher, at the speed that is chosen, and what is missing is not", async () => {
  await settled();
  passes(0);
  const heads = () => views.map(({ canvas, dancers: [{ joints }] }) => [canvas["aria-label"].match(/\w+/)[0], joints[0].position.x]);
  assert.deepEqual(heads(), [["left", -0.5], ["teacher", 0], ["right", 0.7]]);
  assert.deepEqual(views.map(({ dancers: [{ joints }] }) => [joints[0].visible, joints[14].visible]), Array(3).fill([true, false]));
  get("speed").value = "50";
  passes(400);
  assert.deepEqual([views[0].time_s, heads()[0][1]], [3.2, -0.5]);
  passes(200);
  assert.deepEqual(heads().map(([, x]) => Math.round(100 * x)), [-40, 10, 80]);
  passes(2000);
  assert.deepEqual([views[0].time_s, get("play").textContent], [4, "Play"]);
  press(" "); // from the start again
  passes(400);
  assert.ok(Math.abs(views[0].time_s - 3.2) < 1e-9 && get("play").textContent === "Pause");
  press("a");
  assert.ok(views[0].turned < 0);
});

test("an answer is what its key and its button say, is given once, and again if it was not kept", async () => {
  press("ArrowLeft", { repeat: true });
  press("Backspace"); // nothing was answered
  Object.assign(document.documentElement, { scrollHeight: 900, clientHeight: 400 });
  press("ArrowDown"); // the page moves
  Object.assign(document.documentElement, { scrollHeight: 400 });
  assert.deepEqual(sent, []);
  press("ArrowLeft");
  press("ArrowRight"); // it is on its way
  assert.deepEqual(sent.splice(0), [{ rater: "eve 1", done: 0, choice: "left" }]);
  await answered({ error: "the disk is full" }, 500);
  assert.equal(get("error").textContent, "the disk is full");
  for (const [choice, give] of [["right", () => press("ArrowRight")], ["equal", () => press("ArrowDown")]]) {
    give();
    assert.deepEqual(sent.splice(0), [{ rater: "eve 1", done, choice }]);
    await answered({});
  }
  press("Backspace");
  assert.equal(sent.pop().choice, "");
  done -= 2;
  damaged = true;
  await answered({});
  const shown = () => [get("error").textContent, get("retry").hidden, get("undo").disabled];
  assert.deepEqual(shown(), ["left.npz: damaged", false, true]);
  press("ArrowLeft");
  assert.deepEqual(sent, []); // no pair is shown
  damaged = false;
  get("retry").click();
  await settled();
  assert.deepEqual(shown(), ["", true, false]);
  assert.match(get("told").textContent, /^Pair 2 of 3/);
  for (const choice of ["left", "right"]) {
    get(choice).click();
    assert.equal(sent.pop().choice, choice);
    await answered({});
  }
  assert.match(get("told").textContent, /^All 3 pairs are rated/);
  press("ArrowLeft");
  assert.deepEqual(sent, []);
});

test("where less motion is wished a pair waits to be played; the slider chooses a moment and stops; keys of the browser are no answers", async () => {
  let left = 0;
  document.activeElement = { blur() { left++; } };
  globalThis.matchMedia = () => ({ matches: true });
  press("Backspace");
  assert.equal(sent.pop().choice, "");
  done -= 2;
  await answered({});
  passes(400);
  assert.deepEqual([left, views[0].time_s, get("play").textContent], [1, 3, "Play"]); // or space would press the button again
  press(" ");
  assert.deepEqual([get("scrub").min, get("scrub").max], [3, 4]);
  Object.assign(get("scrub"), { value: "3.5" }).listeners.input();
  passes(400);
  assert.deepEqual([views[0].time_s, get("play").textContent], [3.5, "Play"]);
  for (const held of ["ctrlKey", "metaKey", "altKey"]) press("ArrowLeft", { [held]: true });
  assert.deepEqual(sent, []);
});

test("an address that holds no name asks for one, which is not of spaces alone", async () => {
  main.replaceChildren();
  location.hash = "#%";
  await import("../../../../kpopnet/teacher/page/rate.js?anew");
  const { pattern } = get("name");
  assert.deepEqual(["  ", " eve "].map((name) => new RegExp(`^(?:${pattern})$`, "v").test(name)), [false, true]);
});
