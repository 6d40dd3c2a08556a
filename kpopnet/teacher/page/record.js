// Record and dance: a dance before this browser's webcam, cut to its beats and named, is a lesson.
import { LearnerView } from "./learner.js";
import { MUSIC, choice } from "./panels.js";
import { songAt, songPanel, songTempo } from "./song.js";
import { Sound } from "./sound.js";
import { sketch } from "./sketch.js";
import { ask, clamp, clock, el, latencyOf, remembered } from "./tools.js";
import { WEBCAM, Webcam, cutOut, joined } from "./webcam.js";
import { say } from "./words.js";

const COUNTS = 4, USUAL_BPM = 120, LONGEST_S = 300, LEAST_S = 5;
const PREVIEW_PX = [320, 240], FLOOR_CM = 20;

export async function record(main) {
  const sound = new Sound(), state = { webcam: null, start: 0, frames: [], seconds: 0, saving: false, closed: false };
  const music = choice("music", MUSIC, remembered("music", "tick")), tempo = el("input", { type: "number", id: "bpm", min: 40, max: 240, value: USUAL_BPM });
  const song = songPanel(heard), start = el("button", { class: "main", id: "start", type: "button", onclick: () => (state.webcam ? stop("") : begin()) }, say("Record"));
  const told = el("p", { id: "told", role: "status" }), failed = el("p", { class: "error", id: "error", role: "alert" });
  const canvas = el("canvas", { id: "learner", role: "img", "aria-label": say("your picture with your skeleton") }), count = el("div", { class: "count", "aria-hidden": "true" });
  const preview = el("canvas", { id: "preview", width: PREVIEW_PX[0], height: PREVIEW_PX[1], role: "img", "aria-label": say("your dance, as it is cut") });
  const [from, to] = ["from", "to"].map((id) => el("input", { type: "range", id, min: 0, oninput: cut }));
  const excerpt = el("p", { id: "excerpt", role: "status" }), name = el("input", { id: "name", maxLength: 60, required: true, autocomplete: "off" });
  const editor = el("form", { id: "editor", hidden: true, onsubmit: save }, el("h2", {}, say("Cut and name it")), preview,
    el("div", { class: "controls" }, el("label", {}, say("begins"), from), el("label", {}, say("ends"), to)), excerpt,
    el("div", { class: "controls" }, el("label", {}, say("name"), name), el("button", { class: "main", id: "save", type: "submit" }, say("Make it a lesson"))));
  main.append(el("h1", {}, say("Dance it yourself")),
    el("p", { class: "quiet" }, say("Stand so that the webcam sees you from head to feet. {counts} counts lead in; dance, and press Stop (or the space bar). "
      + "The picture stays in this browser.", { counts: COUNTS })),
    el("div", { class: "controls" }, start, el("label", {}, say("music"), music), el("label", {}, say("beats a minute"), tempo)), song.panel, failed, told,
    el("div", { class: "panel seen calibrating" }, canvas, count), editor, el("p", {}, el("a", { href: "#/" }, say("To the dances"))));
  main.dataset.busy = ""; // nothing here is chosen by hand, and a dance would be lost
  const learner = new LearnerView(canvas);
  const onKey = (event) => {
    if (event.key !== " " || event.repeat || event.ctrlKey || event.metaKey || event.altKey) return;
    if (!editor.hidden || event.target.closest("input, select, button, a, summary, audio")) return; // a dance waits to be saved
    event.preventDefault();
    start.click();
  };
  document.addEventListener("keydown", onKey);
  const onDrag = (event) => {
    const [dropped] = event.dataTransfer.files;
    if (event.type === "drop" && dropped) {
      music.value = "song";
      heard();
      song.take(dropped);
    }
    event.preventDefault();
  };
  for (const kind of ["dragover", "drop"]) document.addEventListener(kind, onDrag);
  music.addEventListener("change", heard);
  heard();
  requestAnimationFrame(animate);
  return () => {
    state.closed = true;
    document.removeEventListener("keydown", onKey);
    for (const kind of ["dragover", "drop"]) document.removeEventListener(kind, onDrag);
    sound.close();
    state.webcam?.close();
  };

  function heard() {
    song.panel.hidden = music.value !== "song";
    tempo.disabled = music.value === "song" && songTempo() > 0;
    if (tempo.disabled) tempo.value = songTempo().toFixed(1);
  }

  function beat_s() {
    return 60 / clamp(Number(tempo.value) || USUAL_BPM, 40, 240);
  }

  function begin() {
    sound.wake();
    Object.assign(state, { frames: [], start: 0, webcam: new Webcam(seen, stop) });
    editor.hidden = true;
    failed.textContent = "";
    told.textContent = say("looking for you");
    start.textContent = say("Stop");
    start.blur(); // a focused button takes every space bar for itself
  }

  function seen(points, age_ms) {
    const now = performance.now();
    learner.show(state.webcam.picture, { joints: points.length ? joined(points).map(([, , z, u, v, sure]) => [u, v, z, sure]) : null, colour: "#fff" }, true);
    if (!state.start && points.length) lead(now);
    const at_ms = now - age_ms - state.start - 1000 * (latencyOf(WEBCAM) || 0);
    if (state.start && at_ms >= 0 && points.length) state.frames.push([at_ms / 1000, points]);
    if (state.start && at_ms > 1000 * LONGEST_S) stop("");
  }

  function lead(now) {
    state.beat_s = beat_s(); // whatever the field says later
    const in_s = COUNTS * state.beat_s + 0.3;
    state.start = now + 1000 * in_s;
    told.textContent = say("dance from the one on");
    sound.play({ in_s, from_s: 0, to_s: LONGEST_S, beat_s: state.beat_s, speed: 1, counts: COUNTS,
      music: music.value === "song" ? songAt(0, 1) || "tick" : music.value });
  }

  function stop(message) {
    state.webcam?.close();
    Object.assign(state, { webcam: null, start: 0 });
    sound.stop();
    start.textContent = say("Record");
    told.textContent = count.textContent = "";
    failed.textContent = message;
    state.seconds = state.frames.length ? state.frames.at(-1)[0] : 0;
    if (!state.frames.length) return;
    if (state.seconds < LEAST_S) failed.textContent ||= say("a lesson lasts at least {least} s; you were seen up to second {seconds}",
      { least: LEAST_S, seconds: state.seconds.toFixed(1) });
    else {
      const beats = Math.floor(state.seconds / state.beat_s);
      for (const [range, value] of [[from, 0], [to, beats]]) Object.assign(range, { max: beats, value });
      editor.hidden = false;
      cut();
      editor.scrollIntoView({ block: "nearest" });
    }
  }

  // Seconds of the recording; a lesson begins on a beat.
  function bounds() {
    return [from, to].map((range) => Number(range.value) * state.beat_s);
  }

  function cut() {
    const [from_s, to_s] = bounds(), long = to_s - from_s >= LEAST_S;
    excerpt.textContent = say(long ? "{start} to {end}, {seconds} s" : "{start} to {end}, {seconds} s: at least {least} s, please",
      { start: clock(from_s), end: clock(to_s), seconds: Math.max(to_s - from_s, 0).toFixed(1), least: LEAST_S });
    editor.querySelector("#save").disabled = !long || state.saving;
  }

  async function save(event) {
    event.preventDefault();
    if (editor.querySelector("#save").disabled) return;
    state.saving = true;
    cut();
    failed.textContent = "";
    told.textContent = say("adding {name} …", { name: name.value.trim() });
    const query = new URLSearchParams({ title: name.value.trim() || say("My dance"), bpm: 60 / state.beat_s });
    try {
      const { identity } = await ask(`/api/recordings?${query}`, { method: "POST", body: JSON.stringify(cutOut(state.frames, ...bounds())) });
      if (!state.closed) location.hash = `#/dance/${identity}`;
    } catch ({ message }) {
      failed.textContent = message;
      told.textContent = "";
      state.saving = false;
      cut();
    }
  }

  function animate(now) {
    if (state.closed) return;
    const beats = state.start ? (now - state.start) / 1000 / state.beat_s : 0;
    count.textContent = beats < 0 && beats >= -COUNTS ? String(Math.floor(beats) + 1 + COUNTS) : "";
    if (!editor.hidden) {
      const [from_s, to_s] = bounds(), at_s = from_s + now / 1000 % Math.max(to_s - from_s, 1);
      const [, points] = state.frames.find(([time_s]) => time_s >= at_s) || state.frames.at(-1), [width, height] = PREVIEW_PX, pen = preview.getContext("2d");
      pen.clearRect(0, 0, width, height);
      sketch(pen, joined(points).flatMap(([x, y]) => [100 * x, -100 * y]),
        { x: width / 2, y: height / 2, scale: height / (200 + FLOOR_CM), ink: getComputedStyle(document.body).color, mirrored: true });
    }
    requestAnimationFrame(animate);
  }
}
