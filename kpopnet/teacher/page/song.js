// The user's own song: dropped on the page, its beats found or tapped here. It stays in the browser, and there for other dances.
import { BAR_BEATS, tapped } from "./beats.js";
import { el, remember, remembered } from "./tools.js";
import { say } from "./words.js";

const ANALYSED_HZ = 22050, BPM = [20, 400], LOST_S = 2; // after this time without a tap another row of taps begins
const audio = el("audio", { id: "song", controls: true, preload: "auto" });
const song = { name: "", bpm: 0, one_s: 0 };
let turn = 0; // of the songs that were chosen: what becomes known of an earlier one is dropped
let newest = null; // panel, where it is told: the song may have been chosen in a view that was left

// Where a dance's excerpt begins in the song and how fast the song plays; null without a song. `song_s` are seconds of the song
// from where the dance begins in it, `speed` that of the song.
export const songAt = (song_s, speed, identity = "") =>
  (song.bpm ? { audio, at_s: Math.max(song.one_s + begins(identity) + song_s, 0), rate: speed } : null);
export const songTempo = () => song.bpm;
export const songName = () => song.name;

// A dance begins on the song's one, but for one that was recorded to this song and begins where it was cut.
export const keepBegin = (identity, name, from_s) => remember(`begins.${identity}`, { name, from_s });
const begins = (identity) => {
  const kept = remembered(`begins.${identity}`, null);
  return kept?.name === song.name ? kept.from_s : 0;
};

// The beats of mono samples, found beside the page, which would stand still for seconds: see `beatsOf`.
function beatsBeside(samples) {
  const finder = new Worker(new URL("beats_worker.js", import.meta.url), { type: "module" });
  return new Promise((take, fail) => {
    finder.addEventListener("message", ({ data: { found, error } }) => (found ? take(found) : fail(new Error(error))));
    finder.addEventListener("error", () => fail(new Error("no beats were found in it; tap them")));
    finder.postMessage({ samples, rate: ANALYSED_HZ });
  }).finally(() => finder.terminate());
}

// What is chosen and heard of a song; `changed` is called when its beats are known or corrected.
export function songPanel(changed) {
  const told = el("p", { id: "song-told", role: "status" }), taps_s = [];
  const file = el("input", { type: "file", accept: "audio/*", id: "song-file", onchange: () => {
    const [chosen] = file.files;
    file.value = ""; // so that the same file may be chosen again
    take(chosen);
  } });
  const correct = (id, text, how) => el("button", { type: "button", id, onclick: () => keep(how()) }, say(text));
  const beats = (count) => () => ({ one_s: song.one_s + count * 60 / song.bpm });
  const tools = el("details", {}, el("summary", {}, say("Correct its beats")), el("div", { class: "controls" }, audio,
    el("button", { type: "button", id: "tap", onclick: tap }, say("Tap the beats, from the one on")),
    correct("half", "half as fast", () => ({ bpm: song.bpm / 2 })), correct("double", "twice as fast", () => ({ bpm: 2 * song.bpm })),
    correct("earlier", "the one a beat earlier", beats(-1)), correct("later", "a beat later", beats(1)),
    correct("bar", "a bar later", beats(BAR_BEATS))));
  const panel = el("div", { id: "song-panel", class: "box" },
    el("label", {}, say("your song, or drop it on this page (it stays in this browser)"), " ", file), told, tools);
  newest = { told, show, changed };
  show();
  return { panel, take };

  function show() {
    tools.hidden = !song.name;
    if (!song.name) return;
    tools.open ||= !song.bpm;
    told.textContent = `${song.name}: ${song.bpm
      ? say("{bpm} beats a minute, the one at {seconds} s", { bpm: song.bpm.toFixed(1), seconds: song.one_s.toFixed(2) }) : ""}`;
  }

  // Whether a dance can follow these beats; not where there is nothing to correct yet.
  function canBeDanced({ bpm, one_s }) {
    return bpm >= BPM[0] && bpm <= BPM[1] && !(one_s > audio.duration); // which is NaN until it is known
  }

  function keep(corrected) {
    if (!canBeDanced({ ...song, ...corrected })) return;
    Object.assign(song, corrected);
    while (song.one_s < 0) song.one_s += BAR_BEATS * 60 / song.bpm; // a dance begins on a one that the song has
    remember(`song.${song.name}`, { bpm: song.bpm, one_s: song.one_s });
    newest.show();
    newest.changed();
  }

  async function take(chosen) {
    if (!chosen) return;
    const mine = ++turn;
    told.textContent = say("looking for the beats of {name} …", { name: chosen.name });
    URL.revokeObjectURL(audio.src);
    audio.src = URL.createObjectURL(chosen);
    Object.assign(song, { name: chosen.name, bpm: 0, one_s: 0 });
    changed(); // the beats of the song before are not this one's
    try {
      const context = new OfflineAudioContext(1, 1, ANALYSED_HZ), decoded = await context.decodeAudioData(await chosen.arrayBuffer());
      const kept = remembered(`song.${chosen.name}`, null), found = kept && canBeDanced(kept) ? kept : await beatsBeside(decoded.getChannelData(0));
      if (!canBeDanced(found)) throw new Error("no beats were found in it; tap them"); // its one lies after its end: it is loud there alone
      if (mine === turn) keep(found);
    } catch (error) {
      if (mine !== turn) return;
      if (error.name === "EncodingError") song.name = ""; // it has no beats to correct
      newest.show();
      newest.told.textContent = song.name ? say(error.message) : say("{name}: this browser cannot read it; choose an audio file", { name: chosen.name });
    }
  }

  function tap() {
    if (audio.paused || audio.currentTime - taps_s.at(-1) > LOST_S || audio.currentTime < taps_s.at(-1)) taps_s.length = 0;
    if (audio.paused) return void audio.play();
    taps_s.push(audio.currentTime);
    const found = tapped(taps_s, song.bpm);
    if (found) keep(found);
    else told.textContent = say("{count} of {all} taps", { count: taps_s.length, all: BAR_BEATS });
    return undefined;
  }
}
