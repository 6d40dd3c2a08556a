// Loops of two bars, made here: kick, snare, hat and bass at any tempo. A letter of a pattern is a sixteenth.
const BEATS = 8, STEPS = 4;
export const LOOPS = {
  house: { kick: "x...x...x...x...", snare: "....x.......x...", hat: "..x...x...x...x.", bass: "..a.a.a...a.a.c." },
  bounce: { kick: "x.....x...x.....", snare: "....x.......x..x", hat: "x.x.x.x.x.x.x.xx", bass: "a.....a.c...d..." },
  slow: { kick: "x.........x.....", snare: "........x.......", hat: "x...x...x...x.x.", bass: "a.........c..d.." },
};
const ROOTS_HZ = [55, 43.65], NOTES = { a: 1, c: 6 / 5, d: 4 / 3 }; // a bar on a, one on f

const DRUMS = {
  kick: { lasts_s: 0.22, wave: (t) => Math.sin(2 * Math.PI * (48 * t + 5 * (1 - Math.exp(-t / 0.03)))) * Math.exp(-t / 0.07) },
  snare: { lasts_s: 0.2, wave: (t, noise) => (0.5 * noise + 0.3 * Math.sin(2 * Math.PI * 190 * t)) * Math.exp(-t / 0.05) },
  hat: { lasts_s: 0.05, wave: (t, noise, before) => 0.22 * (noise - before) * Math.exp(-t / 0.012) },
};

// Mono samples of a loop.
export function loopOf(name, bpm, rate) {
  const step = 60 / bpm / STEPS * rate, samples = new Float32Array(Math.round(BEATS * STEPS * step));
  let noise = 0, seed = 1;
  const next = () => {
    seed = (1103515245 * seed + 12345) % 2147483648;
    return seed / 1073741824 - 1;
  };
  const add = (at, lasts_s, wave) => {
    for (let i = 0; i < lasts_s * rate; i++) {
      const before = noise;
      noise = next();
      samples[(at + i) % samples.length] += 0.5 * wave(i / rate, noise, before);
    }
  };
  for (let k = 0; k < BEATS * STEPS; k++) {
    const at = Math.round(k * step), letter = (voice) => LOOPS[name][voice][k % 16];
    for (const [voice, { lasts_s, wave }] of Object.entries(DRUMS)) if (letter(voice) === "x") add(at, lasts_s, wave);
    const hz = NOTES[letter("bass")] * ROOTS_HZ[Math.floor(k / 16)];
    if (hz) add(at, 0.25, (t) => 0.45 * Math.min(t / 0.01, 1) * Math.exp(-t / 0.12) * (Math.sin(2 * Math.PI * hz * t) + 0.4 * Math.sin(4 * Math.PI * hz * t)));
  }
  return samples;
}
