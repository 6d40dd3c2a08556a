// A dance as the page holds it, with a server that the test plays and without pictures in 3D.
import assert from "node:assert/strict";
import { beforeEach, mock, test } from "node:test";
import { allOf } from "./dom.mjs";
import "./without_3d.mjs";

const anything = new Proxy(() => {}, { get: (_, name) => (name === Symbol.toPrimitive ? () => 0 : anything), apply: () => anything });
const dance = { identity: "own_001", name: "Trio", seconds: 19, bpm: 120, phrase_s: 4, difficulty: 2, own: true, free_s: [], place_m: [0, 0], moves: [] };
const REPLIES = {
  "/api/dances/own_001": { ...dance, others: [{ ...dance, place_m: [1, 0.5], moves: [{ at_s: 1, points_cm: Array(30).fill(0) }] }, dance] }, "/api/dances": [dance],
  "/api/dances/lib_001": { ...dance, own: false, others: [] },
  "/api/offer": { sources: { realsense: "a RealSense camera", webcam: "the webcam of this browser" }, skills: ["good"], faults: [""] },
};
const heard = {};
let listeners, sent, draw, closed;
Object.assign(globalThis, {
  devicePixelRatio: 1, location: { hash: "", protocol: "http:", host: "127.0.0.1:1" }, history: { replaceState(_, __, hash) { location.hash = hash; } },
  requestAnimationFrame: (call) => { draw = call; },
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
Object.assign(document, { addEventListener: (kind, listener) => { listeners[kind] = listener; }, fullscreenElement: null });
document.removeEventListener = (kind, listener) => { if (listeners[kind] === listener) delete listeners[kind]; };
Object.assign(document.documentElement, { clientWidth: 400, clientHeight: 800 });
Object.assign(URL, { createObjectURL: () => "", revokeObjectURL() {} });

const PAGE = "../../../../kpopnet/teacher/page/";
const { views } = await import(`${PAGE}body.js`), { stage } = await import(`${PAGE}stage.js`), { calibrate } = await import(`${PAGE}calibrate.js`);
const { latencyOf, remember } = await import(`${PAGE}tools.js`);
const { chosenSource, follow, handsSwitch, letChoose, watch } = await import(`${PAGE}hands.js`);
const told = (message) => heard.message({ data: JSON.stringify(message) });
const DONE = { kind: "done", total: 95, session: "20261126-101010-000", hints: [] };

beforeEach(() => {
  mock.timers.reset();
  mock.restoreAll();
  [listeners, sent, closed] = [{}, [], 0];
  remember("source", "realsense");
});

// The page of the dance, and its elements by their id or class.
async function opened(query = "", identity = "own_001") {
  const main = document.createElement("main"), leave = await stage(main, identity, new URLSearchParams(query));
  return { leave, get: (id) => allOf(main).find((one) => [one.id, one.className].includes(id)) };
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
  remember("source", "webcam"); // which follows one
  const alone = await opened();
  assert.equal(alone.get("people").disabled, true);
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
  mock.timers.tick(1900);
  assert.deepEqual(asked(), ["prepare 1 0", "go"]);
  mock.timers.tick(100);
  assert.deepEqual(asked(), ["prepare 1 0", "go", "go"]);
  [get("speed").value, get("phrase").value] = ["50", "3"];
  told(DONE);
  mock.timers.tick(3000);
  told({ kind: "ready" });
  assert.deepEqual(asked().slice(3), ["prepare 0.5 12", "go"]);
  told(DONE);
  get("start").click();
  begin(get);
  sent.length = 0;
  mock.timers.tick(3000); // the round that was to come was stopped
  assert.deepEqual(asked(), []);
  leave();
  assert.deepEqual([sent.at(-1).do, listeners], ["stop", {}]);
  remember("speed", 100);
});

// Time that the test makes; the page draws at a moment of it.
function clocked() {
  let now_ms = 10000;
  mock.method(performance, "now", () => now_ms);
  return (at_ms) => {
    now_ms = 10000 + at_ms;
    draw(now_ms);
  };
}

test("four counts lead in at the speed of the dance, then the teacher dances, to the end of a last phrase that is cut short", async () => {
  const at = clocked(), { get, leave } = await opened("phrase=4&speed=50");
  remember("latency.realsense", 0.12);
  begin(get);
  const { speed, from_s, to_s, latency_s } = sent[0].lesson, begun_ms = 1000 * sent.at(-1).in_s;
  assert.deepEqual([speed, from_s, to_s, latency_s, begun_ms], [0.5, 16, 19, 0.12, 4300]);
  const counts = [-4200, -3999, -2999, -1, 1].map((after_ms) => { at(begun_ms + after_ms); return get("count").textContent; });
  assert.deepEqual(counts, ["", "1", "2", "4", ""]);
  const shown = [-1000, 1000, 9000].map((after_ms) => { at(begun_ms + after_ms); return views.at(-1).time_s; });
  assert.deepEqual(shown, [16, 16.5, 19]);
  leave();
  remember("latency.realsense", null);
  remember("speed", 100);
});

test("what was paused goes on from the beat before, and not by itself when the camera is back", async () => {
  clocked();
  const { get, leave } = await opened();
  begin(get);
  told({ kind: "paused", from_s: 5.2 });
  told({ kind: "away", text: "plug the camera in" });
  told({ kind: "back", from_s: 5.2 });
  assert.deepEqual(asked(), ["prepare 1 0", "go"]);
  listeners.keydown({ key: "p", target: { closest: () => null }, preventDefault() {} });
  assert.deepEqual([sent.at(-1).do, Number(sent.at(-1).in_s.toFixed(6))], ["resume", 2.5]);
  leave();
});

test("a dance of the library follows a song's beats, one's own keeps its tempo", async () => {
  globalThis.OfflineAudioContext = class { decodeAudioData = async () => null; };
  localStorage.setItem("teach.song.fast.mp3", JSON.stringify({ bpm: 150, one_s: 2 }));
  for (const [identity, speed, at_s, rate] of [["lib_001", 0.75, 3.42, 0.6], ["own_001", 0.6, 3.82, 0.6]]) {
    clocked();
    const { get, leave } = await opened("phrase=1&speed=60", identity), audio = get("song");
    Object.assign(audio, { pause() {}, async play() {} });
    sent.length = 0;
    listeners.drop({ type: "drop", dataTransfer: { files: [{ name: "fast.mp3", arrayBuffer: async () => new ArrayBuffer(0) }] }, preventDefault() {} });
    await new Promise(globalThis.setImmediate);
    assert.equal(get("follows").textContent, speed === 0.75 ? "The dance follows it, at 125 % of its own tempo." : "");
    begin(get);
    assert.deepEqual([sent[0].lesson.speed, audio.currentTime, audio.playbackRate].map((one) => Number(one.toFixed(6))), [speed, at_s, rate]);
    leave();
  }
  localStorage.setItem("teach.begins.own_001", JSON.stringify({ name: "fast.mp3", from_s: 3 })); // of the song that is chosen
  const { get, leave } = await opened("phrase=1&speed=60"), audio = get("song");
  get("music").value = "song";
  begin(get);
  assert.ok(Math.abs(audio.currentTime - 6.82) < 1e-6, audio.currentTime);
  leave();
  localStorage.setItem("teach.begins.own_001", "null");
  remember("speed", 100);
});

test("of a group the chosen dancer stands out, and the lane has that one's moves", async () => {
  clocked();
  const { get, leave } = await opened("dancer=1"), cards = [];
  assert.deepEqual(views.at(-1).dancers.map(({ mesh }) => mesh.material.opacity), [0.35, 1, 0.35]);
  const pen = new Proxy({}, { get: (_, name) => (name === "roundRect" ? (x) => cards.push(x) : () => {}) });
  Object.assign(get("lane"), { clientWidth: 400, clientHeight: 80, getContext: () => pen });
  draw(0);
  assert.equal(cards.length, 1);
  leave();
});

test("the dancers of a group stand in their rows, and the left key turns them to the left", async () => {
  const { leave } = await opened(), view = views.at(-1);
  assert.deepEqual(view.dancers.map(({ group }) => group.position.z), [-0, -0.5, -0]);
  listeners.keydown({ key: "ArrowLeft", target: { closest: () => null }, preventDefault() {} });
  assert.ok(view.turned < 0);
  listeners.keydown({ key: "ArrowRight", target: { closest: () => null }, preventDefault() {} });
  assert.equal(view.turned, 0);
  leave();
  assert.ok(view.closed);
});

test("what is told while a dance is prepared, and how it is begun, stands in what full screen shows", async () => {
  const { get, leave } = await opened(), inside = allOf(get("stage")).map(({ id }) => id);
  assert.deepEqual(["preparing", "error", "begin", "guide", "words"].filter((id) => !inside.includes(id)), []);
  assert.equal(get("full").hidden, true); // this browser has no full screen
  listeners.keydown({ key: "f", code: "KeyF", target: { closest: () => null }, preventDefault() {} });
  assert.equal(get("error").textContent, "");
  leave();
});

test("a practice that was stopped leaves the learner's own speed, and does not begin again by itself", async () => {
  remember("speed", 90);
  location.hash = "#/dance/own_001?phrase=1&practise=80&go&dancer=0";
  const { get, leave } = await opened("phrase=1&practise=80&go&dancer=0");
  assert.equal(sent[0].lesson.speed, 0.75);
  get("start").click();
  assert.deepEqual([get("speed").value, location.hash], [90, "#/dance/own_001?phrase=1&practise=80&dancer=0"]);
  leave();
  remember("speed", 100);
});

test("what was on its way when the dance was stopped changes nothing", async () => {
  const { get, leave } = await opened();
  begin(get);
  get("start").click();
  location.hash = "#/dance/own_001";
  told(DONE);
  told({ kind: "paused", from_s: 3 });
  pointing({ guidance: "step back", words: "left arm too low", time_s: 3 });
  assert.deepEqual([location.hash, get("words").textContent, get("guide").textContent, get("start").textContent], ["#/dance/own_001", "", "", "Start"]);
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
  remember("who", "p_1");
  const { get, leave } = await opened("phrase=1&practise=80&dancer=2&mirrored=0");
  begin(get);
  const { dancer, mirrored, who } = sent[0].lesson;
  assert.deepEqual([dancer, mirrored, who], [2, false, "p_1"]);
  remember("who", "");
  for (let round = 0; round < 3; round++) {
    told(DONE);
    mock.timers.tick(3000);
    told({ kind: "ready" });
  }
  assert.equal(get("practice").children.find(({ href }) => href).href, "#/dance/own_001?dancer=2&mirrored=0");
  leave();
});

test("a camera that is away interrupts the dance, which goes on with it", async () => {
  const at = clocked(), { get, leave } = await opened();
  begin(get);
  const shown = [3000, 9000].map((after_ms) => {
    at(1000 * sent[1].in_s + after_ms);
    told({ kind: "away", text: "plug the camera in" });
    at(1000 * sent[1].in_s + 9000);
    return views.at(-1).time_s;
  });
  assert.deepEqual(shown, [3, 3]); // the teacher waits
  assert.deepEqual([get("guide").textContent, get("start").textContent, get("error").textContent], ["plug the camera in", "Stop", ""]);
  told({ kind: "back", from_s: 1 });
  assert.deepEqual([asked().at(-1), get("guide").textContent], ["resume", ""]);
  leave();
});

test("a dance begins when it is prepared and the learner is in place, and ends with what is the matter where no person was seen", async () => {
  const at = clocked();
  for (const query of ["loop", "phrase=0&practise=80"]) {
    const { get, leave } = await opened(query), waits = (from_ms) => {
      for (let at_ms = from_ms; at_ms < from_ms + 2000; at_ms += 100) { at(at_ms); pointing(); }
      return asked().filter((one) => one !== "drawn").length;
    };
    sent.length = 0;
    get("start").click();
    assert.equal(waits(0), 1);
    told({ kind: "ready" });
    assert.equal(waits(2000), 2);
    told({ kind: "done", total: null, hints: ["no person was seen"] });
    assert.deepEqual([get("error").textContent, get("start").textContent, get("score").textContent], ["no person was seen", "Start", "–"]);
    leave();
  }
  remember("speed", 100);
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

test("a dance is paused and goes on by a button that is there while one dances", async () => {
  const { get, leave } = await opened(), shown = () => { draw(performance.now()); return [get("pause").hidden, get("pause").textContent]; };
  assert.equal(shown()[0], true);
  begin(get);
  assert.deepEqual(shown(), [false, "Pause"]);
  get("pause").click();
  told({ kind: "paused", from_s: 3 });
  assert.deepEqual([asked().at(-1), ...shown()], ["pause", false, "Go on"]);
  get("pause").click();
  assert.deepEqual([asked().at(-1), ...shown()], ["resume", false, "Pause"]);
  told({ kind: "away", text: "plug the camera in" });
  assert.equal(shown()[0], true);
  get("start").click();
  assert.equal(shown()[0], true);
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

test("an arm is counted in and out by ticks, in a dance that is long enough", async () => {
  const at = clocked(), main = document.createElement("main"), get = (name) => allOf(main).find((one) => [one.id, one.className].includes(name));
  REPLIES["/api/dances"] = [{ identity: "x", broken: "damaged" }, { ...dance, identity: "short", seconds: 11 }, dance];
  const leave = await calibrate(main);
  get("start").click();
  told({ kind: "ready" });
  assert.deepEqual([sent[0].lesson.dance, sent[1]], ["own_001", { do: "go", in_s: 4.3 }]);
  const counts = [0, 301, 4299, 4301, 16299, 16301].map((at_ms) => { at(at_ms); return get("count").textContent; });
  assert.deepEqual(counts, ["", "1", "4", "1", "12", ""]);
  remember("latency.realsense", 0.05);
  told({ kind: "done", latency_s: null, hints: ["raise it higher"] });
  assert.deepEqual([get("error").textContent, latencyOf("realsense")], ["raise it higher", 0.05]);
  leave();
  remember("latency.realsense", null);
  REPLIES["/api/dances"] = [dance];
});

test("the latency is kept for the camera that was measured, until it is forgotten", async () => {
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
  get("forget").listeners.click();
  assert.deepEqual([get("kept").textContent, latencyOf("realsense")], ["Nothing is taken off yet.", null]);
  assert.equal(document.activeElement, get("start")); // the button that was pressed is gone
  leave();
});

// The step that measures the latency, and its elements by their id or class.
async function calibrating() {
  const main = document.createElement("main"), leave = await calibrate(main);
  return { main, leave, get: (name) => allOf(main).find((one) => [one.id, one.className].includes(name)) };
}

// Counts the tones of the page, and those that are cut off.
function countedTones() {
  const count = { begun: 0, cut: 0 }, { AudioContext } = globalThis;
  const tone = () => Object.assign(Object.create(null), { frequency: {}, connect: () => anything, start() { count.begun++; }, stop(at) { count.cut += Number(at === undefined); } });
  globalThis.AudioContext = function Counted() { return new Proxy({}, { get: (_, name) => (name === "createOscillator" ? tone : name === "close" ? () => closed++ : anything) }); };
  return Object.assign(count, { end() { globalThis.AudioContext = AudioContext; } });
}

test("a measurement is of the camera that is chosen, to sixteen ticks, with words of what to do, and ends when it is left", async () => {
  remember("source", "webcam");
  const tones = countedTones(), { main, get, leave } = await calibrating(), turned = [];
  assert.ok("busy" in main.dataset); // nothing is chosen by hand meanwhile
  get("source").value = "realsense";
  get("start").click();
  told({ kind: "preparing", text: "opening the camera" });
  assert.equal(get("told").textContent, "opening the camera");
  assert.deepEqual(sent[0].lesson, { dance: "own_001", source: "realsense", to_s: 12, calibrate: true });
  assert.equal(localStorage.getItem("teach.source"), '"realsense"');
  told({ kind: "ready" });
  assert.deepEqual([get("told").textContent, tones.begun], ["an arm up at each tick", 4 + 12]);
  get("learner").getContext = () => new Proxy({}, { get: (_, name) => (name === "transform" ? (x) => turned.push(x) : anything) });
  pointing({ guidance: "step back" });
  assert.deepEqual([get("guide").textContent, turned], ["step back", [-1]]); // as in a mirror
  leave();
  const drawn = draw;
  draw = null;
  drawn(0);
  assert.deepEqual([closed, sent.at(-1).do, draw], [1, "stop", null]);
  tones.end();
});

test("a camera that is away or fails, and a program that has ended, end a measurement and its ticks, and are told until the next", async () => {
  const tones = countedTones(), { get, leave } = await calibrating();
  for (const [what, fail] of [
    [/was away/, () => {
      told({ kind: "away", text: "plug it in" });
      assert.deepEqual([get("guide").textContent, tones.cut], ["plug it in", 16]);
      told({ kind: "back", from_s: null });
    }],
    [/camera broke/, () => told({ kind: "error", text: "the camera broke" })],
    [/does not answer/, () => heard.close()],
  ]) {
    get("start").click();
    assert.equal(get("error").textContent, "");
    told({ kind: "ready" });
    fail();
    assert.match(get("error").textContent, what);
    assert.deepEqual([get("start").textContent, get("source").disabled], ["Start", false]);
  }
  leave();
  tones.end();
});

test("what was measured is told, and what is taken off is that of the camera that is chosen", async () => {
  const { get, leave } = await calibrating();
  get("start").click();
  told({ kind: "ready" });
  told({ kind: "done", latency_s: 0.12, hints: [] });
  assert.match(get("told").textContent, /measured 120 ms after the tick/);
  for (const [source, text] of [["webcam", /^Nothing is taken off/], ["realsense", /^120 ms are taken off for a RealSense camera/]]) {
    get("source").value = source;
    get("source").listeners.change();
    assert.match(get("kept").textContent, text);
  }
  leave();
  remember("latency.realsense", null);
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
  assert.equal(sent[0].lesson.people, 2);
  const at = clocked();
  for (let at_ms = 0; at_ms < 3000; at_ms += 100) {
    at(at_ms);
    pointing({ others: [second] });
  }
  assert.match(get("words").textContent, /^stand before/);
  assert.ok(!asked().includes("go"));
  get("begin").click();
  pointing({ time_s: 1, so_far: 82, others: [{ ...second, joints: Array(15).fill([0.7, 0.5, 2, 1]), so_far: 61.4, time_s: 1 }] });
  for (let number = 1; number < 3; number++) told({ kind: "verdict", number, end_s: number, total: 80, words: "late" });
  told({ kind: "verdict", member: 1, number: 1, end_s: 1, total: 95, words: "" });
  assert.equal(get("streak").textContent, "2 in a row");
  pointing({ time_s: 2, so_far: 82, words: "late", others: [{ ...second, so_far: 61.4, time_s: 2 }] });
  assert.equal(get("words").textContent, ""); // the verdict says it already
  const rows = get("members").children.map(({ children: [swatch, score, , , , verdict] }) => [swatch.style.background, score.textContent, verdict.textContent]);
  assert.deepEqual(rows.map(([, ...row]) => row), [["82", "great, late"], ["61", "perfect"]]);
  assert.notEqual(rows[0][0], rows[1][0]);
  leave();
  remember("people", 1);
});

test("what was said of a measurement goes with it, nothing is counted while the camera is away, and what was on its way is not told", async () => {
  const at = clocked(), main = document.createElement("main"), leave = await calibrate(main), get = (name) => allOf(main).find((one) => [one.id, one.className].includes(name));
  const said = () => ["guide", "told", "count"].map((name) => get(name).textContent);
  get("start").click();
  told({ kind: "ready" });
  pointing({ guidance: "step back" });
  told({ kind: "away", text: "plug it in" });
  at(5000);
  assert.deepEqual(said(), ["plug it in", "an arm up at each tick", ""]);
  told({ kind: "back", from_s: null });
  assert.deepEqual(said(), ["", "", ""]);
  for (const kind of ["preparing", "away"]) told({ kind, text: "opening the camera" });
  assert.deepEqual(said(), ["", "", ""]);
  leave();
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
  assert.equal(sent.at(-1).do, "stop"); // a webcam would be asked about on and on
  pointing();
  heard.close();
  assert.deepEqual(shown().slice(0, 2), [true, false]);
  const drawn = draw;
  unwatch();
  draw = null;
  drawn();
  assert.equal(draw, null); // nothing is drawn any more
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

test("a cursor follows the hand without its trembling, and the field that it stays on is pressed, but for one that appeared under it", () => {
  const [panel, hint] = byHand(), [fields, cursor] = panel.children, chosen = [];
  const offer = (name) => {
    letChoose([{ id: name, text: name, act: () => chosen.push(name) }]);
    fields.children[0].getBoundingClientRect = () => ({ left: 200, right: 400, top: 0, bottom: 400 }); // the upper right of the page
  };
  // The right hand of a learner, seen as in a mirror, at a place of the page in its widths and heights; or no hand.
  let now_ms = 5000;
  const at = (place, lasts_ms) => {
    const [x, y] = place || [0.5, 9], hip = [0.5, 0.6, 2, 1];
    const joints = Array.from({ length: 15 }, () => [0.5, 0.9, 2, 1]);
    Object.assign(joints, { 1: [0.5, 0.4, 2, 1], 6: [0.5 - 2 * 0.2 / (4 / 3) * (x - 0.5), 0.4 + 0.2 * (1.4 * y - 0.75), 2, 1], 9: hip, 10: hip });
    for (const end_ms = now_ms + lasts_ms; now_ms < end_ms; now_ms += 40) follow(joints, true, now_ms);
    return [cursor.style.left, cursor.style.top].map(parseFloat);
  };
  offer("first");
  assert.ok(at([0.9, 0.2], 3000).every((found, axis) => Math.abs(found - [90, 20][axis]) < 0.01));
  assert.deepEqual(chosen, []); // it appeared under the hand
  const [x, y] = at([0.4, 0.7], 40);
  assert.ok(x > 60 && x < 90 && y > 20 && y < 50, `${x} ${y}`);
  at([0.7, 0.8], 3000); // below the field
  at([0.9, 0.2], 1000);
  assert.deepEqual(chosen, []);
  at([0.9, 0.2], 600);
  assert.deepEqual(chosen, ["first"]);
  at([0.1, 0.2], 1000);
  at([0.9, 0.2], 800);
  offer("second");
  at([0.9, 0.2], 3000);
  assert.deepEqual(chosen, ["first"]);
  at(null, 1000);
  assert.deepEqual([panel.hidden, cursor.hidden, hint.hidden], [false, true, false]);
  at(null, 800);
  assert.equal(panel.hidden, true);
  at([0.5, 0.5], 40);
  assert.equal(panel.hidden, false);
  letChoose([]);
  assert.equal(panel.hidden, true);
  offer("third");
  at([0.5, 0.5], 40);
  const [box] = handsSwitch(() => {}).children;
  Object.assign(box, { checked: false }).listeners.change();
  assert.equal(panel.hidden, true);
  remember("hands", true);
  at(null, 40);
  assert.equal(hint.hidden, false);
  follow(null, true, now_ms); // no person is seen
  assert.equal(hint.hidden, true);
  letChoose([]);
  remember("hands", false);
});

test("the switch of pointing and holding is remembered, and what is shown is shown anew with it", () => {
  let changed = 0;
  const [box] = handsSwitch(() => { changed++; }).children, kept = () => handsSwitch(() => {}).children[0].checked;
  assert.deepEqual([box.checked, kept()], [false, false]);
  for (const on of [true, false]) {
    Object.assign(box, { checked: on }).listeners.change();
    assert.equal(kept(), on);
  }
  assert.equal(changed, 2);
});

test("the field under the hand is marked, and the cursor fills up while it is held", () => {
  const [{ children: [fields, cursor] }] = byHand(), marked = {};
  let filled;
  cursor.style.setProperty = (_, value) => { filled = parseFloat(value) / 360; };
  letChoose(["left", "right"].map((id) => ({ id, text: id, act() {} })));
  fields.children.forEach((field, k) => Object.assign(field, {
    getBoundingClientRect: () => ({ left: 200 * k, right: 200 * k + 199, top: 0, bottom: 800 }), classList: { toggle: (_, on) => { marked[field["data-target"]] = on; } },
  }));
  const joints = Array.from({ length: 15 }, () => [0.5, 0.9, 2, 1]);
  const hold = (x, from_ms, to_ms) => {
    Object.assign(joints, { 1: [0.5, 0.4, 2, 1], 6: [0.5 - 0.3 * (x - 0.5), 0.4, 2, 1], 9: [0.5, 0.6, 2, 1], 10: [0.5, 0.6, 2, 1] });
    for (let now_ms = from_ms; now_ms <= to_ms; now_ms += 20) follow(joints, true, now_ms);
  };
  hold(0.2, 100000, 101000);
  assert.deepEqual([marked, filled], [{ left: true, right: false }, 0]); // it appeared under the hand
  hold(0.8, 101020, 101820);
  assert.deepEqual(marked, { left: false, right: true });
  assert.ok(filled > 0.4 && filled < 0.7, filled);
  letChoose([]);
  remember("hands", false);
});

test("in full screen a hand still has what it may choose", () => {
  const both = byHand(), shown = document.createElement("div");
  for (const [element, place] of [[shown, shown], [null, document.body]]) {
    document.body.children = [];
    document.fullscreenElement = element;
    listeners.fullscreenchange();
    assert.deepEqual(place.children, both);
  }
  remember("hands", false);
});

test("to watch for a hand no dance is scored, of a short one no more than there is, and who is seen is mirrored; it ends with the view", () => {
  const [{ children: [, cursor] }] = byHand();
  letChoose([{ id: "x", text: "x", act() {} }]);
  for (const [seconds, to_s] of [[19, 5], [3, 3]]) {
    const unwatch = watch({ ...dance, seconds }, "realsense");
    assert.deepEqual(sent.at(-1).lesson, { dance: "own_001", source: "realsense", to_s, calibrate: true });
    follow(null, true, performance.now()); // where it pointed before is nothing
    pointing(); // the right hand, which is on the left of the picture
    assert.ok(parseFloat(cursor.style.left) > 50, cursor.style.left);
    unwatch();
    assert.equal(sent.at(-1).do, "stop");
  }
  letChoose([]);
  remember("hands", false);
});

test("the source that was used last is used again while there is one", () => {
  const sources = { simulated: "", realsense: "" };
  for (const [kept, chosen] of [["realsense", "realsense"], ["gone", "simulated"]]) {
    remember("source", kept);
    assert.equal(chosenSource(sources), chosen);
  }
});
