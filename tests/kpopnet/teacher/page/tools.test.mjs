// What every view needs: times, colours, packed arrays, settings.
import assert from "node:assert/strict";
import { beforeEach, test } from "node:test";

let stored = {};
globalThis.localStorage = {
  getItem: (name) => (name in stored ? stored[name] : null),
  setItem: (name, value) => { stored[name] = String(value); },
};
const { ask, clamp, clock, followed, keepLatency, keyOf, latencyOf, milliseconds, remember, remembered, shade, unpacked } =
  await import("../../../../kpopnet/teacher/page/tools.js");

beforeEach(() => { stored = {}; });

test("a program that is not running is told in the page's words", async () => {
  globalThis.fetch = async () => { throw new TypeError("Failed to fetch"); };
  for (const asked of [ask("/api/dances"), followed("/api/film", new AbortController().signal, () => {})])
    await assert.rejects(asked, { message: "the teacher's program does not answer; is it still running?" });
});

test("a time is minutes and seconds", () => {
  assert.deepEqual([0, 5.4, 59.6, 61, 95, 600, -0.4, -3, -64.6].map(clock), ["0:00", "0:05", "1:00", "1:01", "1:35", "10:00", "0:00", "-0:03", "-1:05"]);
});

test("a number is kept between two others", () => {
  assert.deepEqual([-1, 0.5, 3].map((value) => clamp(value, 0, 1)), [0, 0.5, 1]);
});

test("a letter is itself with Caps Lock, on a Korean layout, and where layouts of Latin letters have it elsewhere", () => {
  const keys = [["p", "KeyP"], ["P", "KeyP"], ["ㅔ", "KeyP"], ["Process", "KeyP"], ["p", "KeyR"], [" ", "Space"], ["ArrowLeft", "ArrowLeft"], ["p"]];
  assert.deepEqual(keys.map(([key, code]) => keyOf({ key, code })), ["p", "p", "p", "p", "p", " ", "ArrowLeft", "p"]);
});

test("where letters are no shortcuts an input method's keys are none either", () => {
  remember("letters", false);
  assert.deepEqual([["p", "KeyP"], ["ㅔ", "KeyP"], ["Process", "KeyP"], [" ", "Space"], ["ArrowLeft", "ArrowLeft"]].map(([key, code]) => keyOf({ key, code })), ["", "", "", " ", "ArrowLeft"]);
});

test("what is right is brighter, and in the other palette bluer", () => {
  const channels = (value) => shade(value).match(/\d+/g).map(Number);
  assert.ok(channels(90)[0] > channels(40)[0] && channels(40)[0] > channels(0)[0]);
  assert.deepEqual(channels(150), channels(100));
  remember("palette", "safe");
  assert.ok(channels(0)[0] > channels(0)[2] && channels(100)[2] > channels(100)[0]);
  assert.equal(shade(null), shade(undefined));
});

test("arrays of the server are little-endian bytes in base64", () => {
  const values = new Float32Array([1.5, -2, 0.25]);
  const text = btoa(String.fromCharCode(...new Uint8Array(values.buffer)));
  assert.deepEqual([...unpacked(text, Float32Array)], [1.5, -2, 0.25]);
});

test("settings are remembered, and nothing breaks where they cannot be", () => {
  assert.equal(remembered("speed", 100), 100);
  remember("speed", 50);
  assert.equal(remembered("speed", 100), 50);
  stored["teach.speed"] = "not JSON";
  assert.equal(remembered("speed", 100), 100);
  const { setItem } = localStorage;
  localStorage.setItem = () => { throw new Error("full"); };
  remember("speed", 75);
  localStorage.setItem = setItem;
});

test("a latency belongs to a source of depth", () => {
  assert.equal(latencyOf("realsense"), null);
  keepLatency("realsense", 0.12);
  keepLatency("recording", 7);
  assert.deepEqual([latencyOf("realsense"), latencyOf("recording"), latencyOf("simulated")], [0.12, 1, null]);
  keepLatency("realsense", null);
  assert.equal(latencyOf("realsense"), null);
  assert.equal(milliseconds(0.1234), "123 ms");
});

// A server that tells these texts, whatever lines they are cut into.
const telling = (texts, status = 200) => {
  const body = new ReadableStream({ start(stream) {
    for (const text of texts) stream.enqueue(new TextEncoder().encode(text));
    stream.close();
  } });
  globalThis.fetch = async () => new Response(body, { status });
};

test("a refusal in plain text, and a connection that is cut, are told in the page's words", async () => {
  globalThis.fetch = async () => new Response("open the address\n", { status: 403 });
  const follow = (signal = new AbortController().signal) => followed("/api/film", signal, () => {});
  for (const asked of [ask("/api/dances"), follow()]) await assert.rejects(asked, { message: "open the address" });
  globalThis.fetch = async () => new Response(new ReadableStream({ pull(stream) { stream.error(new TypeError("network error")); } }));
  await assert.rejects(follow(), { message: "the teacher's program does not answer; is it still running?" });
  await assert.rejects(follow(AbortSignal.abort()), { message: "network error" }); // who ended it knows
});

test("work on the server is followed line by line to its end", async () => {
  telling(['{"fraction": 0}\n{"fra', 'ction": 0.5}\n', '{"fraction": 1}\n']);
  const seen = [];
  await followed("/work", null, (fraction) => seen.push(fraction));
  assert.deepEqual(seen, [0, 0.5, 1]);
});

test("a letter of several bytes that is cut in two is read whole, and a refusal without words has its status", async () => {
  const bytes = new TextEncoder().encode('{"error": "춤"}\n');
  globalThis.fetch = async () => new Response(new ReadableStream({ start(stream) {
    for (const part of [bytes.slice(0, 12), bytes.slice(12)]) stream.enqueue(part);
    stream.close();
  } }));
  await assert.rejects(followed("/work", null, () => {}), { message: "춤" });
  globalThis.fetch = async () => new Response("", { status: 502, statusText: "Bad Gateway" });
  await assert.rejects(ask("/api/dances"), { message: "Bad Gateway" });
});

test("work that goes wrong, is refused or is broken off is told", async () => {
  telling(['{"fraction": 0.5}\n{"error": "no space"}\n']);
  await assert.rejects(followed("/work", null, () => {}), /no space/);
  telling(['{"error": "there is no such try"}'], 400);
  await assert.rejects(followed("/work", null, () => {}), /no such try/);
  telling(['{"fraction": 0.5}\n']);
  await assert.rejects(followed("/work", null, () => {}), /does not answer/);
});
