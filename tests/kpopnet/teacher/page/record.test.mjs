// Record and dance: a dance before a webcam that the test plays.
import assert from "node:assert/strict";
import { beforeEach, mock, test } from "node:test";
import "./dom.mjs";

let now_ms, video, track, listeners, view;
const anything = new Proxy(() => {}, { get: (_, name) => (name === Symbol.toPrimitive ? () => 0 : anything), apply: () => anything });
const { createElement } = document;
Object.assign(globalThis, {
  devicePixelRatio: 1, location: { hash: "" }, requestAnimationFrame() {}, getComputedStyle: () => ({}),
  AudioContext: function AudioContext() { return anything; },
  OfflineAudioContext: class { decodeAudioData = () => new Promise(() => {}); }, // a song that is read for as long as the test lasts
  createImageBitmap: async () => ({}),
  Worker: class extends EventTarget {
    postMessage() {
      const found = { poseLandmarks: Array(33).fill({ x: 0.5, y: 0.5, visibility: 1 }), poseWorldLandmarks: Array(33).fill({ x: 0, y: 0, z: 0 }) };
      queueMicrotask(() => this.dispatchEvent(Object.assign(new Event("message"), { data: { found } })));
    }
  },
});
Object.assign(document, {
  addEventListener: (kind, listener) => { listeners[kind] = listener; },
  removeEventListener() {},
  createElement: (tag) => Object.assign(createElement(tag), tag === "video" && {
    videoWidth: 640, videoHeight: 480, async play() {}, requestVideoFrameCallback(take) { video = take; },
  }),
});
Object.assign(URL, { createObjectURL: () => "", revokeObjectURL() {} });
Object.defineProperty(globalThis, "navigator", { value: { mediaDevices: { getUserMedia: async () => ({ getTracks: () => [track] }) } } });
mock.method(performance, "now", () => now_ms);

const PAGE = "../../../../kpopnet/teacher/page/";
const { record } = await import(`${PAGE}record.js`);
const { songTempo } = await import(`${PAGE}song.js`);
const { Webcam } = await import(`${PAGE}webcam.js`);
const part = (id) => view.querySelector(`#${id}`);
const settled = () => new Promise((go) => { setTimeout(go, 5); });

beforeEach(async () => {
  [now_ms, listeners, location.hash, track] = [1000, {}, "", Object.assign(createElement("track"), { stop() {} })];
  view = createElement("main");
  await record(view);
  part("music").value = "none";
});

async function picture(at_s) {
  now_ms = 1000 * at_s;
  video(now_ms, {});
  await settled();
}

// Seen first at second 1; the four counts end at 3.3.
async function dance(until_s) {
  part("start").listeners.click();
  await settled();
  for (let at_s = 1; at_s <= until_s; at_s += 0.5) await picture(at_s);
}

function drop(name) {
  listeners.drop({ type: "drop", dataTransfer: { files: [{ name, arrayBuffer: async () => new ArrayBuffer(0) }] }, preventDefault() {} });
}

const save = () => part("editor").listeners.submit({ preventDefault() {} });

test("a song that is dropped while a dance is recorded is taken, and the recording goes on", async () => {
  await dance(5);
  drop("new.mp3");
  assert.equal(part("music").value, "song");
  assert.match(part("song-told").textContent, /new\.mp3/);
  assert.equal(part("song-panel").hidden, false);
  for (const at_s of [8, 12]) await picture(at_s);
  part("start").listeners.click();
  assert.equal(part("editor").hidden, false);
  assert.match(part("excerpt").textContent, /8\.5 s/);
});

test("the tempo of a song does not stay when another is taken", async () => {
  localStorage.setItem("teach.song.known.mp3", JSON.stringify({ bpm: 100, one_s: 0 }));
  const { OfflineAudioContext } = globalThis;
  globalThis.OfflineAudioContext = class { decodeAudioData = async () => null; };
  drop("known.mp3");
  await settled();
  assert.deepEqual([songTempo(), part("bpm").disabled, part("bpm").value], [100, true, "100.0"]);
  globalThis.OfflineAudioContext = OfflineAudioContext;
  drop("unknown.mp3");
  await settled();
  assert.deepEqual([songTempo(), part("bpm").disabled], [0, false]);
});

test("a webcam that fails leaves what it has seen to be saved", async () => {
  await dance(12);
  track.listeners.ended();
  assert.match(part("error").textContent, /no webcam was found/);
  assert.equal(part("editor").hidden, false);
  let sent;
  globalThis.fetch = async (path, { body }) => { sent = JSON.parse(body); return Response.json({ identity: "mine" }); };
  await save();
  assert.equal(location.hash, "#/dance/mine");
  assert.ok(sent.frames.length > 10 && sent.frames.at(-1).time_s >= 8);
});

test("a lesson is saved once, and again if that failed", async () => {
  await dance(12);
  part("start").listeners.click();
  const asked = [];
  globalThis.fetch = (path) => new Promise((answer) => { asked.push([path, answer]); });
  part("name").value = " Ours ";
  const saving = save();
  save();
  part("from").listeners.input(); // the cut is moved meanwhile
  save();
  assert.equal(asked.length, 1);
  assert.match(asked[0][0], /title=Ours&bpm=120$/);
  asked[0][1](Response.json({ error: "the disk is full" }, { status: 500 }));
  await saving;
  assert.deepEqual([part("error").textContent, part("save").disabled], ["the disk is full", false]);
  const again = save();
  asked[1][1](Response.json({ identity: "ours" }));
  await again;
  assert.equal(location.hash, "#/dance/ours");
});

test("joints are drawn over the picture in which they were found, not over the newest", async () => {
  const told = [], webcam = new Webcam((points, age_ms) => told.push([now_ms - age_ms, webcam.picture]), assert.fail);
  await settled();
  for (const at_s of [1, 1.1, 1.2]) await picture(at_s);
  webcam.close();
  assert.deepEqual(told.map(([taken]) => taken), [1000, 1100, 1200]);
  assert.equal(new Set(told.map(([, canvas]) => canvas)).size, 3);
  for (const [taken, canvas] of told) assert.equal(webcam.pictureOf(taken + 20), canvas);
});
