// A dance as the page holds it, with a server that the test plays and without pictures in 3D.
import assert from "node:assert/strict";
import { register } from "node:module";
import { beforeEach, mock, test } from "node:test";
import { allOf } from "./dom.mjs";

const script = (text) => `data:text/javascript,${encodeURIComponent(text)}`;
const WITHOUT_3D = script(`
export const loadBody = async () => ({}), movementOf = (one) => one;
export class View {
  add = () => ({ group: { position: {} }, mesh: { material: {} } });
  fit() {} mirror() {} turn() {} draw() {} close() {}
}`);
register(script(`export const resolve = async (name, context, next) =>
  (name.endsWith("/body.js") ? { url: ${JSON.stringify(WITHOUT_3D)}, shortCircuit: true } : next(name, context));`));

const anything = new Proxy(() => {}, { get: (_, name) => (name === Symbol.toPrimitive ? () => 0 : anything), apply: () => anything });
const dance = { identity: "own_001", name: "Trio", seconds: 20, bpm: 120, phrase_s: 4, difficulty: 2, own: true, free_s: [], place_m: [0, 0], moves: [] };
const REPLIES = {
  "/api/dances/own_001": { ...dance, others: [dance, dance] }, "/api/dances": [dance],
  "/api/offer": { sources: { realsense: "a RealSense camera", webcam: "the webcam of this browser" }, skills: ["good"], faults: [""] },
};
const heard = {};
let listeners, sent, draw, closed;
Object.assign(globalThis, {
  devicePixelRatio: 1, location: { hash: "", protocol: "http:", host: "127.0.0.1:1" }, history: { replaceState() {} }, requestAnimationFrame: (call) => { draw = call; },
  getComputedStyle: () => ({ getPropertyValue: () => "" }),
  AudioContext: class { constructor() { return new Proxy(this, { get: (_, name) => (name === "close" ? () => closed++ : anything) }); } },
  fetch: async (path) => Response.json(REPLIES[path]),
  WebSocket: class {
    static OPEN = 1;

    readyState = 1;

    addEventListener(kind, listener) { heard[kind] = listener; }

    send(text) { sent.push(JSON.parse(text)); }
  },
});
Object.assign(document, { addEventListener: (kind, listener) => { listeners[kind] = listener; }, removeEventListener() {}, fullscreenElement: null });
Object.assign(document.documentElement, { clientWidth: 400, clientHeight: 800 });
Object.assign(URL, { createObjectURL: () => "", revokeObjectURL() {} });

const PAGE = "../../../../kpopnet/teacher/page/";
const { stage } = await import(`${PAGE}stage.js`), { calibrate } = await import(`${PAGE}calibrate.js`), { remember } = await import(`${PAGE}tools.js`);
const { handsSwitch, letChoose, watch } = await import(`${PAGE}hands.js`);
const told = (message) => heard.message({ data: JSON.stringify(message) });
const DONE = { kind: "done", total: 95, session: "20261126-101010-000", hints: [] };

beforeEach(() => {
  mock.timers.reset();
  [listeners, sent, closed] = [{}, [], 0];
  remember("source", "realsense");
});

// The page of the dance, and its elements by their id.
async function opened(query = "") {
  const main = document.createElement("main"), leave = await stage(main, "own_001", new URLSearchParams(query));
  return { leave, get: (id) => allOf(main).find((one) => one.id === id) };
}

function begin(get) {
  get("start").click();
  told({ kind: "ready" });
  get("begin").click();
}

const asked = () => sent.map((one) => (one.lesson ? `${one.do} ${one.lesson.speed} ${one.lesson.from_s}` : one.do));

test("who is danced, by how many, before which camera and to which song stays as it is until the dance ends", async () => {
  const { get, leave } = await opened("dancer=1"), held = ["dancer", "people", "source", "mirrored", "song-file"];
  begin(get);
  assert.deepEqual(held.map((id) => get(id).disabled), held.map(() => true));
  listeners.drop({ type: "drop", dataTransfer: { files: [{ name: "other.mp3" }] }, preventDefault() {} });
  assert.notEqual(get("music").value, "song");
  get("people").value = "2";
  get("start").click();
  assert.deepEqual(held.map((id) => get(id).disabled), held.map(() => false));
  leave();
  assert.equal(closed, 1);
  get("source").value = "webcam"; // which follows one
  const alone = await opened();
  alone.get("source").value = "webcam";
  begin(alone.get);
  alone.get("start").click();
  assert.deepEqual([alone.get("people").disabled, sent.findLast(({ lesson }) => lesson).lesson.people], [true, 1]);
  alone.leave();
});

test("another round takes up a speed and a phrase that were changed, and is not prepared anew otherwise", async () => {
  mock.timers.enable({ apis: ["setTimeout"] });
  const { get, leave } = await opened();
  get("loop").checked = true;
  begin(get);
  told(DONE);
  mock.timers.tick(3000);
  assert.deepEqual(asked(), ["prepare 1 0", "go", "go"]);
  [get("speed").value, get("phrase").value] = ["50", "3"];
  told(DONE);
  mock.timers.tick(3000);
  told({ kind: "ready" });
  assert.deepEqual(asked().slice(3), ["prepare 0.5 12", "go"]);
  leave();
});

test("what was on its way when the dance was stopped changes nothing", async () => {
  const { get, leave } = await opened();
  begin(get);
  get("start").click();
  location.hash = "#/dance/own_001";
  told(DONE);
  told({ kind: "paused", from_s: 3 });
  assert.deepEqual([location.hash, get("words").textContent, get("start").textContent], ["#/dance/own_001", "", "Start"]);
  leave();
});

test("what a pause says to do goes when the dance is stopped, and so does what was said of the camera", async () => {
  const { get, leave } = await opened();
  begin(get);
  told({ kind: "paused", from_s: 3 });
  told({ kind: "away", text: "the camera sends no images; look at its cable" });
  const said = () => ["words", "guide"].map((id) => get(id).textContent !== "");
  assert.deepEqual(said(), [true, true]);
  get("start").click();
  assert.deepEqual(said(), [false, false]);
  leave();
});

test("from a phrase that was practised a link leads to the whole dance of the same dancer", async () => {
  mock.timers.enable({ apis: ["setTimeout"] });
  const { get, leave } = await opened("phrase=1&practise=80&dancer=2&mirrored=0");
  begin(get);
  for (let round = 0; round < 3; round++) {
    told(DONE);
    mock.timers.tick(3000);
    told({ kind: "ready" });
  }
  assert.equal(get("practice").children.find(({ href }) => href).href, "#/dance/own_001?dancer=2&mirrored=0");
  leave();
});

test("a camera that is away interrupts the dance, which goes on with it", async () => {
  const { get, leave } = await opened();
  begin(get);
  told({ kind: "away", text: "plug the camera in" });
  assert.deepEqual([get("guide").textContent, get("start").textContent, get("error").textContent], ["plug the camera in", "Stop", ""]);
  told({ kind: "back", from_s: 1 });
  assert.deepEqual([asked().at(-1), get("guide").textContent], ["resume", ""]);
  leave();
});

test("shortcuts work with Caps Lock and on a Korean layout", async () => {
  const { get, leave } = await opened();
  begin(get);
  const press = (key, code) => listeners.keydown({ key, code, target: { closest: () => null }, preventDefault() {} });
  sent.length = 0;
  for (const [key, code] of [["P", "KeyP"], ["ㅔ", "KeyP"], ["x", "KeyX"]]) press(key, code);
  assert.deepEqual(asked(), ["pause", "pause"]);
  press(" ", "Space");
  assert.equal(get("start").textContent, "Start");
  leave();
});

test("shortcuts of a letter can be switched off, and those of other keys stay", async () => {
  const { get, leave } = await opened(), box = get("letters");
  box.checked = false;
  box.listeners.change();
  begin(get);
  sent.length = 0;
  const press = (key, code) => listeners.keydown({ key, code, target: { closest: () => null }, preventDefault() {} });
  for (const [key, code] of [["p", "KeyP"], ["ㅔ", "KeyP"]]) press(key, code);
  assert.deepEqual(asked(), []);
  press(" ", "Space");
  assert.equal(get("start").textContent, "Start");
  leave();
  remember("letters", true);
});

test("the latency is kept for the camera that was measured", async () => {
  const main = document.createElement("main"), leave = await calibrate(main), get = (id) => allOf(main).find((one) => one.id === id);
  get("start").click();
  told({ kind: "ready" });
  assert.equal(get("source").disabled, true);
  told({ kind: "done", latency_s: 0.12, hints: [] });
  assert.deepEqual([get("source").disabled, localStorage.getItem("teach.latency.realsense")], [false, "0.12"]);
  get("start").click();
  get("start").click();
  told({ kind: "ready" }); // both of a measurement that was stopped
  told({ kind: "done", latency_s: 0.5, hints: [] });
  assert.deepEqual([localStorage.getItem("teach.latency.realsense"), asked().at(-1)], ["0.12", "stop"]);
  leave();
});

// An image of a learner whose right hand is raised, and what else it tells.
function pointing(more = {}) {
  const joints = Array.from({ length: 15 }, () => [0.5, 0.5, 2, 1]), hip = [0.5, 0.6, 2, 1];
  Object.assign(joints, { 1: [0.5, 0.4, 2, 1], 6: [0.45, 0.4, 2, 1], 9: hip, 10: hip });
  const content = { sent_ms: 0, taken_ms: 0, joints, guidance: "", words: "", time_s: null, parts: {}, ...more };
  const text = new TextEncoder().encode(JSON.stringify(content)), data = new Uint8Array(9 + text.length);
  new DataView(data.buffer).setUint32(0, text.length, true);
  data.set(text, 4);
  data[4 + text.length] = data[6 + text.length] = 1; // a picture of one pixel
  heard.message({ data: data.buffer });
  draw(0);
}

test("a screen reader reads where to stand once, how a pause ends, and while one dances the verdicts alone", async () => {
  const { get, leave } = await opened(), guide = get("guide"), written = [];
  get("start").click();
  told({ kind: "ready" });
  Object.defineProperty(guide, "textContent", { get: () => written.at(-1) ?? "", set: (text) => written.push(text) });
  for (let k = 0; k < 3; k++) pointing({ guidance: "step back" });
  assert.deepEqual(written, ["step back"]);
  const read = () => [get("words").role, get("words").ariaLive];
  get("begin").click();
  assert.deepEqual(read(), ["status", "off"]);
  told({ kind: "paused", from_s: 3 });
  assert.deepEqual(read(), ["status", "polite"]);
  leave();
});

test("learners beside each other are waited for, and have their own colour and score", async () => {
  const { get, leave } = await opened(), second = { joints: null, parts: {}, so_far: null, time_s: null };
  get("people").value = "2";
  get("start").click();
  told({ kind: "ready" });
  pointing({ others: [second] });
  assert.match(get("words").textContent, /^stand before/);
  get("begin").click();
  pointing({ time_s: 1, so_far: 82, others: [{ ...second, joints: Array(15).fill([0.7, 0.5, 2, 1]), so_far: 61.4, time_s: 1 }] });
  told({ kind: "verdict", member: 1, number: 1, end_s: 1, total: 95, words: "" });
  const rows = get("members").children.map(({ children: [swatch, score, , , , verdict] }) => [swatch.style.background, score.textContent, verdict.textContent]);
  assert.deepEqual(rows.map(([, ...row]) => row), [["82", ""], ["61", "perfect"]]);
  assert.notEqual(rows[0][0], rows[1][0]);
  leave();
  remember("people", 1);
});

// The overlay and its hint, for who points and holds.
function byHand() {
  remember("hands", true);
  document.body.children = [];
  handsSwitch(() => {});
  return ["hands", "hands-hint"].map((id) => allOf(document.body).find((one) => one.id === id));
}

test("what a hand may choose in a pause is hidden while the camera is away, and after an error", async () => {
  const [panel] = byHand(), { get, leave } = await opened();
  begin(get);
  told({ kind: "paused", from_s: 2 });
  for (const kind of ["away", "error"]) {
    pointing();
    assert.equal(panel.hidden, false);
    told({ kind, text: "the camera sends no images; look at its cable" });
    assert.equal(panel.hidden, true);
  }
  leave();
  letChoose([]);
  remember("hands", false);
});

test("a camera that is away or fails, and a program that has ended, hide what a hand could choose, and are told", async () => {
  const [panel, hint] = byHand();
  letChoose([{ id: "x", text: "x", act() {} }]);
  const unwatch = watch(dance, "realsense"), shown = () => [panel.hidden, hint.hidden, hint.textContent];
  for (const text of ["the camera sends no images; look at its cable", "there is no dance nothing"]) {
    pointing();
    assert.deepEqual(shown().slice(0, 2), [false, true]);
    told({ kind: text.startsWith("the camera") ? "away" : "error", text });
    assert.deepEqual(shown(), [true, false, text]);
  }
  pointing();
  heard.close();
  assert.deepEqual(shown().slice(0, 2), [true, false]);
  unwatch();
  letChoose([]);
  remember("hands", false);
});

test("a program that has ended hides what a hand could choose before a dance, and is told", async () => {
  const [panel, hint] = byHand(), { leave } = await opened();
  pointing();
  assert.equal(panel.hidden, false);
  heard.close();
  assert.deepEqual([panel.hidden, hint.hidden], [true, false]);
  assert.match(hint.textContent, /does not answer/);
  leave();
  letChoose([]);
  remember("hands", false);
});

test("what a hand chooses is what is offered now, also where it looks as before", () => {
  byHand();
  const chosen = [], [panel] = document.body.children;
  for (const name of ["before", "now"]) letChoose([{ id: "more", text: "More dances", act: () => chosen.push(name) }]);
  panel.children[0].children[0].click();
  assert.deepEqual(chosen, ["now"]);
  letChoose([]);
  remember("hands", false);
});
