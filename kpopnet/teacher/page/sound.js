// What is heard: the metronome, or the user's own music, which never leaves the browser.

export class Sound {
  constructor() {
    this.context = null;
    this.music = null;
    this.clicks = [];
  }

  // A browser lets a page make sound only after a click or a key: call it from there.
  wake() {
    if (this.context === null) this.context = new AudioContext();
    this.context.resume();
  }

  choose(file) {
    this.forget();
    if (!file) return;
    this.music = new Audio(URL.createObjectURL(file));
    this.music.preservesPitch = true;
  }

  forget() {
    if (this.music) {
      this.music.pause();
      URL.revokeObjectURL(this.music.src);
    }
    this.music = null;
  }

  // Plays from `in_s` seconds from now on; beats before that are the count-in, which is always heard.
  play({ in_s, from_s, to_s, beat_s, speed, counts, metronome, offset_s }) {
    this.stop();
    const now = this.context.currentTime, beats = [];
    for (let beat = counts; beat > 0; beat--) beats.push([in_s - beat * beat_s / speed, beat === counts]);
    const first = Math.ceil(from_s / beat_s - 1e-6);
    const clicking = metronome && !this.music;
    for (let beat = first; clicking && beat * beat_s < to_s; beat++) {
      beats.push([in_s + (beat * beat_s - from_s) / speed, beat % 8 === 0]);
    }
    for (const [at, strong] of beats) if (at >= 0) this.click(now + at, strong);
    if (this.music) {
      this.music.playbackRate = speed;
      this.music.currentTime = Math.max(from_s + offset_s, 0);
      this.timer = setTimeout(() => this.music && this.music.play(), 1000 * in_s);
    }
  }

  click(at, strong) {
    const tone = this.context.createOscillator(), loudness = this.context.createGain();
    tone.frequency.value = strong ? 1568 : 1047;
    loudness.gain.setValueAtTime(strong ? 0.25 : 0.14, at);
    loudness.gain.exponentialRampToValueAtTime(0.001, at + 0.06);
    tone.connect(loudness).connect(this.context.destination);
    tone.start(at);
    tone.stop(at + 0.07);
    this.clicks.push(tone);
  }

  stop() {
    clearTimeout(this.timer);
    for (const tone of this.clicks) tone.stop();
    this.clicks = [];
    if (this.music) this.music.pause();
  }
}
