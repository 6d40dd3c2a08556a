// When the metronome ticks, and what else is heard, in step with the dance.
import assert from "node:assert/strict";
import { test } from "node:test";

class Context {
  currentTime = 10;
  destination = {};
  sampleRate = 4000;
  ticks = [];
  loops = [];

  resume() {}

  createOscillator() {
    const tone = { frequency: {}, connect: (next) => next, stop() {} };
    tone.start = (at) => this.ticks.push([Number((at - this.currentTime).toFixed(6)), tone.frequency.value]);
    return tone;
  }

  createBuffer(_, length, rate) {
    return { duration: length / rate, copyToChannel() {} };
  }

  createBufferSource() {
    const source = { connect: (next) => next };
    for (const what of ["start", "stop"]) source[what] = (...at) => this.loops.push([what, source.buffer.duration, ...at]);
    return source;
  }

  createGain() {
    return { gain: { setValueAtTime() {}, exponentialRampToValueAtTime() {} }, connect: (next) => next };
  }
}
globalThis.AudioContext = Context;
const { Sound } = await import("../../../../kpopnet/teacher/page/sound.js");

function ticks(how) {
  const sound = new Sound();
  sound.wake();
  sound.play({ in_s: 2.3, from_s: 0, to_s: 2, beat_s: 0.5, speed: 1, counts: 4, music: "tick", ...how });
  return sound.context.ticks;
}

test("four counts lead in, and the first beat is at the start", () => {
  assert.deepEqual(ticks({}).map(([at]) => at), [0.3, 0.8, 1.3, 1.8, 2.3, 2.8, 3.3, 3.8]);
  assert.deepEqual(ticks({ to_s: 5 }).flatMap(([, hz], k) => (hz > 1500 ? [k] : [])), [0, 4, 12]); // the first count, and each phrase
});

test("a song that plays already is heard from where the dance begins on", () => {
  const sound = new Sound(), heard = [];
  const audio = { paused: false, currentTime: 30, pause() { heard.push("paused"); }, play: async () => heard.push("played") };
  sound.wake();
  sound.play({ in_s: 2.3, from_s: 0, to_s: 2, beat_s: 0.5, speed: 1, counts: 4, music: { audio, at_s: 0.5, rate: 1 } });
  assert.deepEqual([heard, audio.currentTime], [["paused"], 0]); // it begins 1.8 s later
  sound.stop();
});

test("a song plays as fast as the dance, from where it meets the dance's first beat, and one that is behind or ahead catches up", async (t) => {
  t.mock.timers.enable({ apis: ["setTimeout", "setInterval"] });
  let now_ms = 0;
  t.mock.method(performance, "now", () => now_ms);
  const sound = new Sound(), heard = [], audio = { pause() { heard.push("paused"); }, async play() { heard.push("played"); throw new Error("not before a click"); } };
  const later = async (ms) => { t.mock.timers.tick(ms); now_ms += ms; await null; await null; await null; };
  const play = (at_s) => sound.play({ in_s: 4.3, from_s: 0, to_s: 9, beat_s: 0.5, speed: 0.5, counts: 4, music: { audio, at_s, rate: 0.5 } });
  sound.wake();
  play(5); // it has begun before the counts
  assert.ok(Math.abs(audio.currentTime - 2.85) < 1e-9 && audio.playbackRate === 0.5);
  play(1); // its begin is 2 s of the slowed dance before the dance's
  assert.equal(audio.currentTime, 0);
  await later(2299);
  assert.deepEqual(heard, ["paused", "paused", "paused"]);
  await later(1);
  assert.equal(heard.at(-1), "played");
  for (const [behind_s, rate] of [[0.05, 0.55], [0.3, 0.625], [-0.05, 0.45], [0.01, 0.5]]) {
    audio.currentTime = 0.5 * (now_ms + 100 - 2300) / 1000 - behind_s;
    now_ms += 100;
    t.mock.timers.tick(100);
    assert.ok(Math.abs(audio.playbackRate - rate) < 1e-9, `${behind_s}: ${audio.playbackRate}`);
  }
  sound.stop();
  await later(1000);
  assert.deepEqual([heard.at(-1), audio.playbackRate], ["paused", 1]); // its beats are tapped next
  play(1);
  t.mock.timers.tick(2300);
  sound.stop(); // before the browser has begun to play
  await later(1000);
  assert.equal(audio.playbackRate, 1);
});

test("a song that is stopped and played anew before the browser has begun it is corrected by the new one alone", async (t) => {
  t.mock.timers.enable({ apis: ["setTimeout", "setInterval"] });
  const sound = new Sound(), begun = [], audio = { pause() {}, play: () => new Promise((go) => { begun.push(go); }) };
  const play = () => sound.play({ in_s: 1, from_s: 0, to_s: 9, beat_s: 0.5, speed: 1, counts: 0, music: { audio, at_s: 1, rate: 1 } });
  sound.wake();
  for (let k = 0; k < 2; k++) {
    play();
    t.mock.timers.tick(0);
  }
  for (const go of begun) go();
  for (let k = 0; k < 5; k++) await null;
  sound.stop();
  Object.assign(audio, { playbackRate: 1, currentTime: -5 });
  t.mock.timers.tick(1000);
  assert.equal(audio.playbackRate, 1);
});

test("a song that has ended where the dance begins is not heard from its begin", async (t) => {
  t.mock.timers.enable({ apis: ["setTimeout", "setInterval"] });
  const sound = new Sound(), heard = [];
  sound.wake();
  for (const [at_s, duration] of [[40, 30], [40, NaN], [20, 30]]) {
    const audio = { duration, pause() {}, play: async () => heard.push(`${at_s} of ${duration}`) };
    sound.play({ in_s: 2.3, from_s: 28, to_s: 40, beat_s: 0.5, speed: 1, counts: 4, music: { audio, at_s, rate: 1 } });
    t.mock.timers.tick(3000);
  }
  assert.deepEqual(heard, ["40 of NaN", "20 of 30"]);
  sound.stop();
});

test("a loop is as fast as the dance, begins where the excerpt does, and ends with it", () => {
  const sound = new Sound();
  sound.wake();
  sound.play({ in_s: 2.3, from_s: 3, to_s: 7, beat_s: 0.5, speed: 0.5, counts: 4, music: "house" });
  assert.deepEqual(sound.context.loops, [["start", 8, 12.3, 6], ["stop", 8, 20.3]]);
});

test("ticks and loops are heard, the first count louder, and a slowed song keeps its pitch", (t) => {
  t.mock.timers.enable({ apis: ["setTimeout"] });
  const sound = new Sound(), audio = { pause() {} }, loud = [], gain = { setValueAtTime: (value) => loud.push(value), exponentialRampToValueAtTime() {} };
  sound.wake();
  sound.context.createGain = () => ({ gain, connect: (next) => next });
  const play = (music) => sound.play({ in_s: 2.3, from_s: 0, to_s: 2, beat_s: 0.5, speed: 0.5, counts: 2, music });
  play("house");
  assert.ok(loud[0] > loud[1] && loud[1] > 0 && gain.value > 0 && gain.value < 1, `${loud} ${gain.value}`);
  play({ audio, at_s: 1, rate: 0.5 });
  assert.equal(audio.preservesPitch, true);
  sound.stop();
});

test("a view that is left stops its sound for good", () => {
  const sound = new Sound(), done = [];
  sound.close(); // before it made any
  sound.wake();
  Object.assign(sound.context, { close: async () => done.push("closed") });
  sound.play({ in_s: 2.3, from_s: 0, to_s: 2, beat_s: 0.5, speed: 1, counts: 4, music: "none" });
  for (const source of sound.sources) source.stop = () => done.push("stopped");
  sound.close();
  assert.deepEqual([done, sound.context], [[...Array(4).fill("stopped"), "closed"], null]);
});

test("at half the speed beats are twice as far apart", () => {
  assert.deepEqual(ticks({ in_s: 4.3, speed: 0.5 }).map(([at]) => at), [0.3, 1.3, 2.3, 3.3, 4.3, 5.3, 6.3, 7.3]);
});

test("an excerpt begins on the beats of the dance, and every eighth is strong", () => {
  const heard = ticks({ from_s: 3.75, to_s: 5 }).slice(4);
  assert.deepEqual(heard.map(([at]) => at), [2.55, 3.05]);
  assert.ok(heard[0][1] > heard[1][1]);
});

test("without the metronome only the counts are heard, and never in the past", () => {
  assert.equal(ticks({ music: "none" }).length, 4);
  assert.deepEqual(ticks({ music: "none", in_s: 1.2 }).map(([at]) => at), [0.2, 0.7]);
});
