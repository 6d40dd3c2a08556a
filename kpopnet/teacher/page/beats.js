// The beats of a song, found in its samples: tempo, where the beats lie, and which of four is the one.
//
// Onsets are rises of the logarithm of the energy in three bands. The tempo is the best lag of their autocorrelation, weighted
// towards 120 beats a minute, then the frequency near it that the whole song has most of; it is taken for constant.

const RATE_HZ = 200, CUTS_HZ = [150, 2000];
const RISE = 4; // frames before and after, 20 ms: a period of the lowest notes
const LEAST_BPM = 60, MOST_BPM = 200, USUAL_BPM = 120, OCTAVES = 0.8;
const NEAR = 0.03, NEAR_STEPS = 150;
const QUIET = 0.1; // of the mean energy: the music begins above it
export const BAR_BEATS = 4;

// What rises in each band, and the energy, at RATE_HZ.
function onsets(samples, rate) {
  const hop = rate / RATE_HZ, frames = Math.floor(samples.length / hop), energy = new Float32Array(frames);
  const bands = [0, 1, 2].map(() => new Float32Array(frames));
  const [slow, fast] = CUTS_HZ.map((hz) => 1 - Math.exp(-2 * Math.PI * hz / rate));
  let once = 0, low = 0, below = 0;
  for (let i = 0; i < samples.length; i++) {
    once += slow * (samples[i] - once);
    low += slow * (once - low);
    below += fast * (samples[i] - below);
    const frame = Math.floor(i / hop), middle = below - once, high = samples[i] - below;
    if (frame >= frames) break;
    bands[0][frame] += low * low;
    bands[1][frame] += middle * middle;
    bands[2][frame] += high * high;
  }
  for (let i = 0; i < frames; i++) energy[i] = bands[0][i] + bands[1][i] + bands[2][i];
  return { frames, energy, rises: bands.map(rises) };
}

function rises(energy) {
  const sums = new Float64Array(energy.length + 1), found = new Float32Array(energy.length);
  energy.forEach((value, i) => { sums[i + 1] = sums[i] + value; });
  const floor = 1e-3 * RISE * sums[energy.length] / energy.length + 1e-12;
  for (let i = RISE; i + RISE <= energy.length; i++) {
    found[i] = Math.max(Math.log((floor + sums[i + RISE] - sums[i]) / (floor + sums[i] - sums[i - RISE])), 0);
  }
  return found;
}

function correlation(curve, lag) {
  let sum = 0;
  for (let i = lag; i < curve.length; i++) sum += curve[i] * curve[i - lag];
  return sum / (curve.length - lag);
}

// How much of a curve beats at a tempo, once and twice a beat, or as many times as are given: its Fourier transform, by Goertzel's
// recurrence, which needs the cosine of one angle alone.
function strength(curve, bpm, harmonics = [1, 2]) {
  return harmonics.reduce((found, times) => {
    const angle = 2 * Math.PI * times * bpm / 60 / RATE_HZ, twice = 2 * Math.cos(angle);
    let last = 0, before = 0;
    for (let i = 0; i < curve.length; i++) {
      const now = curve[i] + twice * last - before;
      before = last;
      last = now;
    }
    return found + Math.hypot(last - before * Math.cos(angle), before * Math.sin(angle));
  }, 0);
}

function best(values, worth) {
  return values.reduce(([top, kept], value) => (worth(value) > top ? [worth(value), value] : [top, kept]), [-Infinity, values[0]])[1];
}

const range = (count, of) => Array.from({ length: count }, (_, i) => of(i));

// The tempo of mono samples in beats a minute, and the time of the first one in seconds. Throws where nothing beats.
export function beatsOf(samples, rate) {
  const { frames, energy, rises: [low, middle, high] } = onsets(samples, rate);
  const all = low.map((value, i) => value + middle[i] + high[i]), mean = all.reduce((a, b) => a + b, 0) / frames;
  if (!(mean > 0) || frames < 4 * RATE_HZ) throw new Error("no beats were found in it; tap them");
  const centred = all.map((value) => value - mean), lags = range(RATE_HZ * 60 / LEAST_BPM - RATE_HZ * 60 / MOST_BPM + 1, (i) => i + RATE_HZ * 60 / MOST_BPM);
  const usual = (lag) => Math.exp(-0.5 * (Math.log2(60 * RATE_HZ / lag / USUAL_BPM) / OCTAVES) ** 2);
  const weighted = new Map(lags.map((lag) => [lag, usual(lag) * (correlation(centred, lag) + correlation(centred, 2 * lag))]));
  const repeats = 60 * RATE_HZ / best(lags, (lag) => weighted.get(lag));
  const near = (bpm) => range(2 * NEAR_STEPS + 1, (i) => bpm * (1 + NEAR * (i - NEAR_STEPS) / NEAR_STEPS));
  const strongest = (bpm, harmonics) => Math.max(...near(bpm).map((one) => strength(all, one, harmonics)));
  // A fast song repeats after one and a half beats as well, but beats more at its own tempo, with half and quarter beats or without.
  const about = [1.5 * repeats, repeats / 1.5].find((bpm) => bpm >= LEAST_BPM && bpm <= MOST_BPM
    && [[1], [1, 2], [1, 2, 4]].every((harmonics) => strongest(bpm, harmonics) > strongest(repeats, harmonics))) ?? repeats;
  const strengths = new Map(near(about).map((bpm) => [bpm, strength(all, bpm)])), bpm = best(near(about), (one) => strengths.get(one));

  const period = 60 * RATE_HZ / bpm, bins = Math.round(period), folded = new Float64Array(bins);
  const bin = (frame) => Math.floor(frame % period / period * bins) % bins;
  for (let i = 0; i < frames; i++) folded[bin(i)] += all[i] + low[i];
  const around = (at) => range(2 * RISE + 1, (i) => (RISE + 1 - Math.abs(i - RISE)) * folded[(at + i - RISE + bins) % bins]).reduce((a, b) => a + b);
  const phase = (best(range(bins, (at) => at), around) + 0.5) / bins * period;

  // Kicks are on the one and the three, the stronger ones on the one; snares are on the two and the four.
  const kicks = [0, 0, 0, 0], snares = [0, 0, 0, 0], beats = Math.floor((frames - phase) / period);
  const most = (curve, at) => curve.slice(Math.max(at - 2 * RISE, 0), at + 2 * RISE).reduce((a, b) => Math.max(a, b), 0);
  for (let beat = 0; beat < beats; beat++) {
    kicks[beat % BAR_BEATS] += most(low, Math.round(phase + beat * period));
    snares[beat % BAR_BEATS] += most(middle, Math.round(phase + beat * period)) + most(high, Math.round(phase + beat * period));
  }
  const one = best([0, 1, 2, 3], (k) => 2 * kicks[k] + kicks[(k + 2) % 4] + snares[(k + 1) % 4] + snares[(k + 3) % 4]);
  const loud = QUIET * energy.reduce((a, b) => a + b, 0) / frames, begin = energy.findIndex((value) => value > loud);
  const bars = Math.max(Math.ceil((begin - phase - one * period) / (BAR_BEATS * period) - 0.1), 0);
  return { bpm, one_s: (phase + (one + BAR_BEATS * bars) * period) / RATE_HZ };
}

// What taps on the beats say, the first of them on the one: a straight line through them. A tempo that was found is kept where
// they are near it: it is the more exact one. null for fewer than four.
export function tapped(taps_s, found_bpm) {
  const count = taps_s.length, middle = (count - 1) / 2, mean_s = taps_s.reduce((a, b) => a + b, 0) / count;
  if (count < BAR_BEATS) return null;
  const slope = taps_s.reduce((sum, tap_s, k) => sum + (k - middle) * (tap_s - mean_s), 0) / taps_s.reduce((sum, _, k) => sum + (k - middle) ** 2, 0);
  const bpm = Math.abs(60 / slope / found_bpm - 1) < NEAR ? found_bpm : 60 / slope;
  return { bpm, one_s: mean_s - middle * 60 / bpm };
}

// How much faster than at its own tempo a dance follows a song's beats, of which it may take every second one or half ones.
export function tempoRatio(song_bpm, dance_bpm) {
  const octaves = Math.log2(song_bpm / dance_bpm);
  return 2 ** (octaves - Math.round(octaves));
}
