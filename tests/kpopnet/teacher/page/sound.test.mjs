// When the metronome ticks.
import assert from "node:assert/strict";
import { test } from "node:test";

class Context {
  currentTime = 10;
  destination = {};
  ticks = [];

  resume() {}

  createOscillator() {
    const tone = { frequency: {}, connect: (next) => next, stop() {} };
    tone.start = (at) => this.ticks.push([Number((at - this.currentTime).toFixed(6)), tone.frequency.value]);
    return tone;
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
});

test("a song that plays already is heard from where the dance begins on", () => {
  const sound = new Sound(), heard = [];
  const audio = { paused: false, currentTime: 30, pause() { heard.push("paused"); }, play: async () => heard.push("played") };
  sound.wake();
  sound.play({ in_s: 2.3, from_s: 0, to_s: 2, beat_s: 0.5, speed: 1, counts: 4, music: { audio, at_s: 0.5, rate: 1 } });
  assert.deepEqual([heard, audio.currentTime], [["paused"], 0]); // it begins 1.8 s later
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
