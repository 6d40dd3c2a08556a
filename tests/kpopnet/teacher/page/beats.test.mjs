// Tempo and the one, found in loops of known ones.
import assert from "node:assert/strict";
import { test } from "node:test";
import { beatsOf, tapped, tempoRatio } from "../../../../kpopnet/teacher/page/beats.js";
import { LOOPS, loopOf } from "../../../../kpopnet/teacher/page/loops.js";

const RATE = 22050;

// A loop again and again after a silence, with hiss.
function song(name, bpm, silence_s, seconds = 40) {
  const loop = loopOf(name, bpm, RATE), samples = new Float32Array(seconds * RATE), begin = Math.round(silence_s * RATE);
  let seed = 7;
  for (let i = 0; i < samples.length; i++) {
    seed = (1103515245 * seed + 12345) % 2147483648;
    samples[i] = (i < begin ? 0 : loop[(i - begin) % loop.length]) + 0.004 * (seed / 1073741824 - 1);
  }
  return samples;
}

test("tempo within 0.1 beats a minute and the one within 20 ms", () => {
  for (const [name, bpm, silence_s] of [["house", 124, 1.3], ["house", 98.6, 0.2], ["bounce", 108.5, 0.77], ["bounce", 140, 2.05], ["slow", 90, 0.5]]) {
    const found = beatsOf(song(name, bpm, silence_s), RATE);
    assert.ok(Math.abs(found.bpm - bpm) < 0.1, `${name}: ${found.bpm} instead of ${bpm}`);
    assert.ok(Math.abs(found.one_s - silence_s) < 0.02, `${name}, ${bpm}: the one at ${found.one_s} instead of ${silence_s}`);
  }
});

test("fast songs have their tempo, or half of it", () => {
  for (const [name, bpm] of [["house", 165], ["house", 172], ["house", 184], ["bounce", 150], ["bounce", 168], ["bounce", 180], ["slow", 170]]) {
    const octaves = Math.log2(beatsOf(song(name, bpm, 0), RATE).bpm / bpm);
    assert.ok(Math.abs(octaves - Math.round(octaves)) < 0.002, `${name}, ${bpm}`);
  }
});

test("silence and a single tone have no beats", () => {
  assert.throws(() => beatsOf(new Float32Array(10 * RATE), RATE), /tap them/);
});

test("taps say tempo and the one, and a tempo near them that was found is kept", () => {
  const taps_s = [2.01, 2.49, 3.0, 3.51, 4.0].map((tap) => tap);
  assert.equal(tapped(taps_s.slice(0, 3), 120), null);
  assert.equal(tapped(taps_s, 120.3).bpm, 120.3);
  const found = tapped(taps_s, 90);
  assert.ok(Math.abs(found.bpm - 120) < 1 && Math.abs(found.one_s - 2) < 0.02);
  assert.ok(Math.abs(tapped([2.08, 2.5, 3, 3.5, 4, 4.5, 5, 5.5], 120).one_s - 2) < 0.011); // a late first tap alone is no late one
});

test("a dance follows a song by the beats that are nearest to its own tempo", () => {
  assert.equal(tempoRatio(120, 120), 1);
  assert.equal(tempoRatio(180, 100), 0.9);
  assert.equal(tempoRatio(60, 100), 1.2);
});

test("a loop is two bars long and neither silent nor too loud", () => {
  for (const name of Object.keys(LOOPS)) {
    const samples = loopOf(name, 120, RATE), peak = samples.reduce((most, one) => Math.max(most, Math.abs(one)), 0);
    assert.ok(samples.length === 4 * RATE && peak > 0.3 && peak <= 1, `${name}: ${peak}`);
  }
});

test("the bass of a loop is on a in its first bar and on f in its second", () => {
  const samples = loopOf("house", 60, 4000), power = (hz, bar) => {
    const heard = samples.subarray(bar * samples.length / 2, (bar + 1) * samples.length / 2), angle = 2 * Math.PI * hz / 4000;
    return Math.hypot(...[Math.cos, Math.sin].map((wave) => heard.reduce((sum, one, i) => sum + one * wave(angle * i), 0)));
  };
  assert.ok(power(110, 0) > 2 * power(110, 1) && power(43.65, 1) > 2 * power(43.65, 0));
});
