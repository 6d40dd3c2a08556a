// Record and dance: a dance before a camera that the test plays.
import assert from "node:assert/strict";
import { beforeEach, mock, test } from "node:test";
import { allOf } from "./dom.mjs";

let still = false, now_ms, video, track, stopped, begun = 0, listeners, view, leave, socket, animate;
const anything = new Proxy(() => {}, { get: (_, name) => (name === Symbol.toPrimitive ? () => 0 : anything), apply: () => anything });
const { createElement } = document, settled = () => new Promise((go) => { setTimeout(go, 5); });
const OFFER = { sources: { simulated: "a simulated learner", realsense: "a RealSense", webcam: "the webcam of this browser" } };
Object.assign(globalThis, {
  devicePixelRatio: 1, location: { hash: "" }, matchMedia: () => ({ matches: still }), getComputedStyle: () => ({}), requestAnimationFrame(draw) { animate = draw; },
  AudioContext: function AudioContext() { return anything; },
  OfflineAudioContext: class { decodeAudioData = () => new Promise(() => {}); }, // a song that is read for as long as the test lasts
  createImageBitmap: async () => ({}),
  Worker: class extends EventTarget {
    postMessage({ anew }) {
      begun += Number(Boolean(anew));
      const found = { poseLandmarks: Array(33).fill({ x: 0.5, y: 0.5, visibility: 1 }), poseWorldLandmarks: Array(33).fill({ x: 0, y: 0, z: 0 }) };
      queueMicrotask(() => this.dispatchEvent(Object.assign(new Event("message"), { data: { found } })));
    }
  },
  WebSocket: class {
    static OPEN = 1;

    constructor() {
      Object.assign(this, { readyState: 1, sent: [], listeners: {} });
      socket = this;
    }

    addEventListener(kind, listener) {
      this.listeners[kind] = listener;
    }

    // The lesson's process answers each of a webcam's pictures.
    send(text) {
      this.sent.push(JSON.parse(text));
      if (this.sent.at(-1).do === "see") this.see(this.sent.at(-1).points.length > 0);
    }

    say(message) {
      this.listeners.message({ data: JSON.stringify(message) });
    }

    // Of an image of a moment ago, by default 20 ms, with a person or without, whether the page draws it or not.
    see(person, drawn = true, age_ms = 20) {
      const timed = { taken_ms: now_ms - age_ms, sent_ms: now_ms, heard_ms: null };
      if (person) this.say({ kind: "joints", taken_ms: timed.taken_ms, joints: Array(15).fill([0.1, 0.2, now_ms / 1000, 0.9]) });
      const content = { kind: "frame", ...timed, guidance: "step back", joints: person ? Array(15).fill([0.5, 0.5, 2, 0.9]) : null };
      const text = new TextEncoder().encode(JSON.stringify(content)), data = new Uint8Array(4 + text.length + 5);
      new DataView(data.buffer).setUint32(0, text.length, true);
      data.set(text, 4);
      data.set([1, 0, 1, 0, 0], 4 + text.length);
      if (drawn) this.listeners.message({ data: data.buffer });
    }
  },
});
Object.assign(document, {
  addEventListener: (kind, listener) => { listeners[kind] = listener; },
  removeEventListener: (kind, listener) => { if (listeners[kind] === listener) delete listeners[kind]; },
  createElement: (tag) => Object.assign(createElement(tag), tag === "audio" && { pause() {} }, tag === "video" && {
    videoWidth: 640, videoHeight: 480, async play() {}, requestVideoFrameCallback(take) { video = take; },
  }),
});
Object.assign(URL, { createObjectURL: () => "", revokeObjectURL() {} });
Object.defineProperty(globalThis, "navigator", { value: { mediaDevices: { getUserMedia: async () => ({ getTracks: () => [track] }) } } });
mock.method(performance, "now", () => now_ms);
mock.method(Date, "now", () => now_ms);

const PAGE = "../../../../kpopnet/teacher/page/";
const { cutOut, record } = await import(`${PAGE}record.js`);
const { recordable, watch } = await import(`${PAGE}hands.js`), { remember } = await import(`${PAGE}tools.js`);
const { songTempo } = await import(`${PAGE}song.js`);
const { Webcam } = await import(`${PAGE}webcam.js`), { Sound } = await import(`${PAGE}sound.js`);
const part = (id) => view.querySelector(`#${id}`);

beforeEach(async () => {
  [now_ms, listeners, location.hash, stopped, track] = [1000, {}, "", 0, Object.assign(createElement("track"), { stop() { stopped += 1; } })];
  globalThis.fetch = async (path) => Response.json(path === "/api/offer" ? OFFER : [{ identity: "x", broken: "damaged" }, { identity: "d", seconds: 60 }]);
  view = createElement("main");
  leave = await record(view);
  part("music").value = "none";
});

async function image(at_s, person = true, drawn = true) {
  now_ms = 1000 * at_s;
  if (part("source").value === "webcam") {
    video(now_ms, {});
    await settled();
  } else socket.see(person, drawn);
  animate(now_ms);
}

// Seen first at second 1; the four counts end at 3.3.
async function dance(until_s, source = "realsense") {
  part("source").value = source;
  part("start").listeners.click();
  await settled();
  for (let at_s = 1; at_s <= until_s; at_s += 0.5) await image(at_s);
}

function drop(name) {
  listeners.drop({ type: "drop", dataTransfer: { files: [{ name, arrayBuffer: async () => new ArrayBuffer(0) }] }, preventDefault() {} });
}

const save = () => part("editor").listeners.submit({ preventDefault() {} });

// What is saved of a recording.
async function saved() {
  let sent;
  globalThis.fetch = async (path, { body }) => { sent = JSON.parse(body); return Response.json({ identity: "mine" }); };
  await save();
  assert.equal(location.hash, "#/dance/mine");
  return sent.frames;
}

test("cameras can record, a simulated learner and a recording cannot, and nothing but a camera is offered", () => {
  assert.deepEqual(recordable({ simulated: "", recording: "", webcam: "w", realsense: "r" }), { webcam: "w", realsense: "r" });
  assert.deepEqual(part("source").options.map(({ value }) => value), ["realsense", "webcam"]);
});

test("the joints of every image from the one on are kept with their times, drawn or not, and the rest is told", async () => {
  part("start").listeners.click();
  const asked = socket.sent.at(-1);
  assert.deepEqual([asked.do, asked.lesson.dance, asked.lesson.source, asked.lesson.record], ["prepare", "d", "realsense", true]);
  socket.say({ kind: "preparing", text: "opening the camera" });
  assert.equal(part("told").textContent, "opening the camera");
  await image(1, false);
  assert.equal(part("told").textContent, "opening the camera");
  await image(2);
  assert.equal(part("told").textContent, "dance from the one on"); // at 4.3
  assert.ok(part("source").disabled);
  for (const [at_s, person, drawn] of [[4.3, true, true], [4.4, true, true], [4.5, true, false], [4.6, false, true], [9.6, true, true]]) await image(at_s, person, drawn);
  socket.say({ kind: "joints", taken_ms: now_ms - 500, joints: [] }); // a clock that went back
  part("start").listeners.click();
  assert.deepEqual([socket.sent.at(-1).do, part("source").disabled], ["stop", false]);
  const frames = await saved();
  assert.ok(!leave.stays()); // for the lesson that was made
  assert.deepEqual(frames.map(({ time_s }) => time_s), [0, 0.08, 0.18, 5]);
  assert.deepEqual(frames[2].joints[3], [0.1, 0.2, 4.5, 0.9]);
});

test("where less motion is wished the cut shows where it begins, or ends while the end is chosen", async () => {
  await dance(9.5);
  for (const [k, at_s] of [10, 11, 12].entries()) { // the head is further to one side in each
    now_ms = 1000 * at_s;
    socket.say({ kind: "joints", taken_ms: now_ms, joints: Array.from({ length: 15 }, (_, joint) => [joint ? 0 : k + 1, 0, 2, 1]) });
  }
  part("start").listeners.click();
  const heads = [], pen = new Proxy({}, { get: (_, name) => (name === "arc" ? (x) => heads.push(x) : () => {}) });
  Object.assign(part("preview"), { getContext: () => pen });
  still = true;
  for (const focused of [null, part("to")]) {
    document.activeElement = focused;
    for (const at_ms of [0, 3000]) animate(at_ms);
  }
  [still, document.activeElement] = [false, null];
  assert.ok(heads[0] === heads[1] && heads[2] === heads[3] && heads[1] !== heads[2], heads.join());
  animate(0);
  animate(8400);
  assert.notEqual(heads[4], heads.at(-1));
});

test("a recording ends by itself after five minutes, also where no person is seen any more", async () => {
  await dance(12);
  for (const at_s of [300, 303.4]) await image(at_s, false);
  assert.deepEqual([socket.sent.at(-2).do, part("editor").hidden, part("start").textContent], ["stop", false, "Record"]); // then it was drawn
  await image(305);
  assert.ok((await saved()).at(-1).time_s < 12);
});

test("a cut recording begins and ends with its excerpt, and keeps the times in between", () => {
  const frames = [0.5, 1.2, 1.3, 2.5, 3.5].map((time_s) => [time_s, [[time_s, 0, 2, 0.9]]]);
  const cut = cutOut(frames, 1, 3).frames.map(({ time_s, joints: [[x, , , sure]] }) => [time_s, x, sure]);
  assert.deepEqual(cut, [[0, 1.2, 0.9], [0.2, 1.2, 0.9], [0.3, 1.3, 0.9], [1.5, 2.5, 0.9], [2, 2.5, 0.9]]);
  assert.deepEqual(cutOut(frames, 4, 9).frames, []);
  assert.deepEqual(cutOut([1, 1.004, 2.996, 3].map((time_s) => [time_s, []]), 1, 3).frames.map(({ time_s }) => time_s), [0, 2]); // none twice
});

test("of a dance that was recorded to a song and cut it is kept where in the song it begins", async () => {
  globalThis.OfflineAudioContext = class { decodeAudioData = async () => null; };
  localStorage.setItem("teach.song.mine.mp3", JSON.stringify({ bpm: 120, one_s: 1 }));
  drop("mine.mp3");
  await settled();
  await dance(12);
  part("start").listeners.click();
  part("from").value = "4";
  await saved();
  assert.deepEqual(JSON.parse(localStorage.getItem("teach.begins.mine")), { name: "mine.mp3", from_s: 2 });
  globalThis.OfflineAudioContext = class { decodeAudioData = () => new Promise(() => {}); };
});

test("a song that is dropped while a dance is recorded is taken, and the recording goes on", async () => {
  await dance(5);
  drop("new.mp3");
  assert.equal(part("music").value, "song");
  assert.match(part("song-told").textContent, /new\.mp3/);
  assert.equal(part("song-panel").hidden, false);
  for (const at_s of [8, 12]) await image(at_s);
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
  assert.deepEqual([songTempo(), part("bpm").disabled, part("bpm").value], [0, false, 120]);
});

test("a dance to a song keeps the song's own beats, also slow ones", async () => {
  localStorage.setItem("teach.song.slow.mp3", JSON.stringify({ bpm: 31.26, one_s: 0 }));
  const { OfflineAudioContext } = globalThis;
  globalThis.OfflineAudioContext = class { decodeAudioData = async () => null; };
  drop("slow.mp3");
  await settled();
  globalThis.OfflineAudioContext = OfflineAudioContext;
  await dance(20);
  part("start").listeners.click();
  let asked;
  globalThis.fetch = async (path) => { asked = path; return Response.json({ identity: "mine" }); };
  await save();
  assert.equal(Number(new URLSearchParams(asked.split("?")[1]).get("bpm")).toFixed(4), "31.2600");
  assert.equal(part("song").playbackRate, 1);
});

for (const [what, fail, told] of [
  ["fails", () => socket.say({ kind: "error", text: "the camera broke" }), /camera broke/],
  ["is unplugged", () => socket.say({ kind: "away", text: "plug it in" }), /plug it in/],
  ["is lost with the program", () => socket.listeners.close(), /does not answer/],
]) {
  test(`a camera that ${what} leaves what it has seen to be saved`, async () => {
    await dance(12);
    fail();
    assert.match(part("error").textContent, told);
    assert.equal(part("editor").hidden, false);
    const frames = await saved();
    assert.ok(frames.length > 10 && frames.at(-1).time_s >= 8);
  });
}

test("a webcam's pictures are asked about like a camera's images, and one that ends leaves what it has seen", async () => {
  await dance(12, "webcam");
  assert.equal(stopped, 0);
  track.listeners.ended();
  assert.match(part("error").textContent, /no webcam was found/);
  assert.ok(stopped > 0);
  const frames = await saved();
  assert.ok(frames.length > 10 && frames.at(-1).time_s >= 8);
});

test("how old a webcam's picture is is told with its points", async () => {
  await dance(2, "webcam");
  video(now_ms, { captureTime: now_ms - 40 });
  await settled();
  const { points, age_ms } = socket.sent.findLast((one) => one.do === "see");
  assert.deepEqual([points.length, age_ms], [33, 40]);
});

test("a picture of before the computer slept is not told, and the next one is", async () => {
  const ages_ms = [], webcam = new Webcam((points, age_ms) => ages_ms.push(age_ms), assert.fail);
  for (const age_ms of [70000, 20]) {
    await settled();
    video(now_ms - age_ms, {});
  }
  await settled();
  webcam.close();
  assert.deepEqual(ages_ms, [20]);
});

test("a dance that is not saved yet is not lost by a reload, a link or the Back key without a question, one that was left is", async () => {
  const kept = (unload) => { let stays = false; unload({ preventDefault() { stays = true; } }); return stays; };
  const link = (answer) => { globalThis.confirm = () => answer; return leave.stays(); };
  assert.ok(!link(false)); // nothing is lost yet
  await dance(12);
  assert.ok(kept(globalThis.onbeforeunload) && link(false) && !link(true));
  part("start").listeners.click();
  assert.ok(kept(globalThis.onbeforeunload) && link(false) && !part("editor").hidden);
  part("editor").hidden = true;
  assert.ok(!kept(globalThis.onbeforeunload) && !link(false));
});

test("a dance that is not saved yet is not lost by recording another without a question", async () => {
  const asked = [], again = (answer) => { globalThis.confirm = (text) => { asked.push(text); return answer; }; part("start").listeners.click(); };
  await dance(12);
  again(false); // this one is stopped
  assert.deepEqual([asked.length, part("editor").hidden], [0, false]);
  again(false);
  assert.deepEqual([asked.length, part("editor").hidden, part("start").textContent, socket.sent.at(-1).do], [1, false, "Record", "stop"]);
  assert.ok((await saved()).length > 10);
  part("editor").hidden = false;
  again(true);
  assert.deepEqual([asked.length, part("editor").hidden, part("start").textContent, socket.sent.at(-1).do], [2, true, "Stop", "prepare"]);
});

test("who points and holds with a webcam lets go of it when the program has ended", async () => {
  remember("hands", true);
  const unwatch = watch({ identity: "d", seconds: 60 }, "webcam");
  await settled();
  socket.listeners.close();
  assert.equal(stopped, 1);
  unwatch();
  remember("hands", false);
});

test("four counts are shown, and the latency of the camera is taken off", async () => {
  remember("latency.realsense", 0.1);
  await dance(1);
  const counts = [1000, 1310, 3200, 3300].map((at_ms) => { animate(at_ms); return allOf(view).find(({ className }) => className === "count").textContent; });
  assert.deepEqual(counts, ["", "1", "4", ""]);
  for (const at_s of [5, 12]) await image(at_s);
  part("start").listeners.click();
  assert.deepEqual((await saved()).map(({ time_s }) => time_s), [0, 1.58, 8.5]);
  remember("latency.realsense", null);
});

test("the space bar records and stops, but does not discard a dance that waits to be saved; a view that is left hears nothing", async () => {
  const space = () => listeners.keydown({ key: " ", target: { closest: () => null }, preventDefault() {} });
  part("source").value = "realsense";
  part("start").click = part("start").listeners.click;
  space();
  assert.equal(part("start").textContent, "Stop");
  for (let at_s = 1; at_s <= 12; at_s++) await image(at_s);
  space();
  space();
  assert.deepEqual([part("editor").hidden, part("start").textContent], [false, "Record"]);
  let answer;
  globalThis.fetch = () => new Promise((take) => { answer = take; });
  const saving = save();
  leave();
  answer(Response.json({ identity: "mine" }));
  await saving;
  assert.deepEqual([location.hash, globalThis.onbeforeunload, listeners], ["", null, {}]);
});

test("of a song it is kept where the lesson that was saved begins, wherever the cut is moved meanwhile, and no other is recorded then", async () => {
  globalThis.OfflineAudioContext = class { decodeAudioData = async () => null; };
  localStorage.setItem("teach.song.mine.mp3", JSON.stringify({ bpm: 120, one_s: 1 }));
  drop("mine.mp3");
  await settled();
  await dance(14);
  part("start").listeners.click();
  let answer;
  globalThis.fetch = () => new Promise((take) => { answer = take; });
  part("from").value = "4";
  const saving = save();
  part("from").value = "8";
  part("from").listeners.input();
  socket.say({ kind: "preparing", text: "opening the camera" }); // of the recording that was stopped
  assert.deepEqual([part("start").disabled, part("told").textContent], [true, "adding  …"]);
  answer(Response.json({ identity: "moved" }));
  await saving;
  assert.deepEqual(JSON.parse(localStorage.getItem("teach.begins.moved")), { name: "mine.mp3", from_s: 2 });
  globalThis.OfflineAudioContext = class { decodeAudioData = () => new Promise(() => {}); };
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

test("the camera is remembered; without one it is told that there is none", async () => {
  remember("source", "webcam");
  await dance(1);
  assert.equal(localStorage.getItem("teach.source"), '"realsense"');
  assert.ok("busy" in view.dataset); // nothing is chosen by hand meanwhile
  leave();
  assert.equal(socket.sent.at(-1).do, "stop");
  globalThis.fetch = async (path) => Response.json(path === "/api/offer" ? { sources: { simulated: "" } } : [{ identity: "d", seconds: 60 }]);
  await assert.rejects(record(createElement("main")), /no camera/);
});

test("a lesson of less than five seconds is not made: why is told, of a recording and of a cut", async () => {
  await dance(7);
  part("start").listeners.click();
  assert.deepEqual([part("error").textContent, part("editor").hidden], ["a lesson lasts at least 5 s; you were seen up to second 3.7", true]);
  await dance(12);
  part("start").listeners.click();
  for (const [from, told, refused] of [["7", "0:04 to 0:09, 5.0 s", false], ["8", "0:04 to 0:09, 4.5 s: at least 5 s, please", true]]) {
    part("from").value = from;
    part("from").listeners.input();
    assert.deepEqual([part("excerpt").textContent, part("save").disabled], [told, refused]);
  }
});

test("the space bar of a control, or one that is held, records nothing; where to stand is told while one records", async () => {
  const guide = () => allOf(view).find(({ className }) => className === "guide").textContent, press = (more) =>
    listeners.keydown({ key: " ", target: { closest: () => null }, preventDefault() {}, ...more });
  for (const more of [{ repeat: true }, { ctrlKey: true }, { target: { closest: (kinds) => kinds.includes("select") } }]) press(more);
  assert.equal(part("start").textContent, "Record");
  await dance(5);
  assert.equal(guide(), "step back");
  press({});
  assert.deepEqual([part("start").textContent, guide()], ["Record", ""]);
});

test("four counts lead in to the music that is chosen, a metronome for a song without beats, for as long as one may record", async () => {
  const heard = [], closed = [];
  mock.method(Sound.prototype, "play", (how) => heard.push(how));
  mock.method(Sound.prototype, "close", () => closed.push("closed"));
  localStorage.setItem("teach.begins.mine", "null");
  drop("new.mp3"); // whose beats are being looked for
  part("bpm").value = "120";
  for (const music of ["house", "song"]) {
    part("music").value = music;
    part("music").listeners.change();
    assert.equal(part("song-panel").hidden, music !== "song");
    await dance(12);
    part("start").listeners.click();
  }
  const played = { from_s: 0, to_s: 300, beat_s: 0.5, speed: 1, counts: 4, in_s: 2.3 };
  assert.deepEqual(heard, [{ ...played, music: "house" }, { ...played, music: "tick" }]);
  part("music").value = "none";
  await dance(12);
  part("start").listeners.click();
  await saved();
  assert.equal(localStorage.getItem("teach.begins.mine"), "null"); // no song was heard
  leave();
  assert.deepEqual(closed, ["closed"]);
  Sound.prototype.play.mock.restore();
  Sound.prototype.close.mock.restore();
});

test("what was recorded is shown upright, and as in a mirror", async () => {
  await dance(12);
  now_ms = 13000;
  socket.say({ kind: "joints", taken_ms: now_ms, joints: Array.from({ length: 15 }, (_, joint) => [joint ? 0 : 0.2, joint ? 0 : -0.5, 2, 1]) });
  part("start").listeners.click();
  const heads = [], pen = new Proxy({}, { get: (_, name) => (name === "arc" ? (x, y) => heads.push([x, y]) : () => {}) });
  Object.assign(part("preview"), { getContext: () => pen });
  document.activeElement = part("to");
  still = true;
  animate(0);
  [still, document.activeElement] = [false, null];
  assert.ok(heads[0][0] < 160 && heads[0][1] < 120, `${heads[0]}`);
});

test("joints are drawn over the picture in which they were found, not over the newest", async () => {
  const told = [], webcam = new Webcam((points, age_ms) => told.push([now_ms - age_ms, webcam.picture]), assert.fail);
  await settled();
  for (const at_s of [1, 1.1, 1.2]) {
    now_ms = 1000 * at_s;
    video(now_ms, { captureTime: now_ms - 40 });
    await settled();
  }
  webcam.close();
  const before = begun, another = new Webcam(assert.fail, assert.fail);
  await settled();
  another.close();
  assert.equal(begun, before + 1); // who was seen before is forgotten
  assert.deepEqual(told.map(([taken]) => taken), [960, 1060, 1160]);
  assert.equal(new Set(told.map(([, canvas]) => canvas)).size, 3);
  for (const [taken, canvas] of told) assert.equal(webcam.pictureOf(taken + 20), canvas);
});

test("of a webcam the picture is shown that an answer is about, not a newer one", async () => {
  const shown = [];
  part("learner").getContext = () => new Proxy({}, { get: (_, name) => (name === "drawImage" ? (picture) => shown.push(picture) : () => {}) });
  await dance(2, "webcam");
  shown.length = 0;
  for (const age_ms of [500, 0, 500]) {
    socket.see(true, true, age_ms);
    animate(now_ms);
  }
  assert.ok(shown[0] === shown[2] && shown[0] !== shown[1]);
  leave();
});
