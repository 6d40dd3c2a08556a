// What is heard: a metronome, a loop, or the user's own song, which never leaves the browser.
import { LOOPS, loopOf } from "./loops.js";
import { clamp } from "./tools.js";

const LOUDNESS = 0.5;
const EVERY_MS = 100, OFF_S = 0.015, CATCH_UP_S = 0.5, MOST = 0.25;

export class Sound {
  constructor() {
    this.context = this.song = this.timer = null;
    this.sources = [];
  }

  // A browser lets a page make sound only after a click or a key: call it from there.
  wake() {
    if (this.context === null) this.context = new AudioContext();
    this.context.resume()?.catch(() => {}); // the view may be left before
  }

  // Plays from `in_s` seconds from now on; the beats before that are the count-in, which is always heard. `music` is "tick",
  // "none", one of LOOPS, or a song: its audio element, and where in it the dance's excerpt begins and how fast it plays.
  play({ in_s, from_s, to_s, beat_s, speed, counts, music }) {
    this.stop();
    const now = this.context.currentTime, beats = [];
    for (let beat = counts; beat > 0; beat--) beats.push([in_s - beat * beat_s / speed, beat === counts]);
    const first = Math.ceil(from_s / beat_s - 1e-6);
    for (let beat = first; music === "tick" && beat * beat_s < to_s; beat++) {
      beats.push([in_s + (beat * beat_s - from_s) / speed, beat % 8 === 0]);
    }
    for (const [at, strong] of beats) if (at >= 0) this.click(now + at, strong);
    if (music in LOOPS) this.loop(music, 60 / beat_s * speed, now + in_s, from_s / speed, (to_s - from_s) / speed);
    if (music.audio) this.follow(music, in_s);
  }

  loop(name, bpm, at, from_s, lasts_s) {
    const samples = loopOf(name, bpm, this.context.sampleRate), buffer = this.context.createBuffer(1, samples.length, this.context.sampleRate);
    buffer.copyToChannel(samples, 0);
    const source = Object.assign(this.context.createBufferSource(), { buffer, loop: true }), loudness = this.context.createGain();
    loudness.gain.value = LOUDNESS;
    source.connect(loudness).connect(this.context.destination);
    source.start(at, from_s % buffer.duration);
    source.stop(at + lasts_s);
    this.sources.push(source);
  }

  // The song leads in where it has begun before the dance. How long a browser takes to begin is corrected once it plays.
  follow({ audio, at_s, rate }, in_s) {
    audio.pause(); // it may play since its beats were tapped
    const wait_s = Math.max(in_s - at_s / rate, 0), from_s = at_s - (in_s - wait_s) * rate, start = performance.now() + 1000 * wait_s;
    if (from_s >= audio.duration) return; // a browser would play it from its begin; the duration is NaN until it is known
    this.song = Object.assign(audio, { playbackRate: rate, preservesPitch: true, currentTime: from_s });
    const due_s = () => from_s + rate * (performance.now() - start) / 1000;
    const begun = this.timer = setTimeout(async () => {
      await audio.play().catch(() => {}); // a page that was opened to begin at once may not make sound
      if (this.timer !== begun) return; // stopped, and perhaps played anew
      // Seeking would take as long again: a song that is behind plays a little faster until it is not.
      this.timer = setInterval(() => {
        const behind_s = due_s() - audio.currentTime;
        audio.playbackRate = rate * (1 + (Math.abs(behind_s) > OFF_S ? clamp(behind_s / CATCH_UP_S, -MOST, MOST) : 0));
      }, EVERY_MS);
    }, 1000 * wait_s);
  }

  click(at, strong) {
    const tone = this.context.createOscillator(), loudness = this.context.createGain();
    tone.frequency.value = strong ? 1568 : 1047;
    loudness.gain.setValueAtTime(strong ? 0.25 : 0.14, at);
    loudness.gain.exponentialRampToValueAtTime(0.001, at + 0.06);
    tone.connect(loudness).connect(this.context.destination);
    tone.start(at);
    tone.stop(at + 0.07);
    this.sources.push(tone);
  }

  // Stops for good: a browser gives a page but few contexts at a time.
  close() {
    this.stop();
    this.context?.close();
    this.context = null;
  }

  stop() {
    clearTimeout(this.timer);
    this.timer = null;
    for (const source of this.sources) source.stop();
    this.sources = [];
    if (this.song) Object.assign(this.song, { playbackRate: 1 }).pause(); // it may be heard by itself, while its beats are tapped
    this.song = null;
  }
}
