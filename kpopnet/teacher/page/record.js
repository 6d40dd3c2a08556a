// Record and dance: a dance before a camera, cut to its beats and named, is a lesson.
import { chosenSource, recordable, watching } from "./hands.js";
import { LearnerView } from "./learner.js";
import { liveFor } from "./live.js";
import { MUSIC, choice } from "./panels.js";
import { keepBegin, songAt, songName, songPanel, songTempo } from "./song.js";
import { Sound } from "./sound.js";
import { sketch } from "./sketch.js";
import { ask, clamp, clock, el, latencyOf, remember, remembered, tell } from "./tools.js";
import { withoutDepth } from "./webcam.js";
import { say } from "./words.js";

const COUNTS = 4, USUAL_BPM = 120, LONGEST_S = 300, LEAST_S = 5;
const PREVIEW_PX = [320, 240], FLOOR_CM = 20, TORSO = 8;
const DIGITS = 4, STEP_S = 0.01;

// A recording's [time_s, joints] between two of its seconds as the server takes it, on a clock that begins with them: who is seen
// later stands as then until then, so that beats stay beats.
export function cutOut(frames, from_s, to_s) {
  const inside = frames.filter(([time_s]) => time_s >= from_s && time_s <= to_s);
  const within = inside.filter(([time_s]) => time_s > from_s + STEP_S && time_s < to_s - STEP_S);
  const held = inside.length ? [[from_s, inside[0][1]], ...within, [to_s, inside.at(-1)[1]]] : [];
  return { frames: held.map(([time_s, joints]) => ({ time_s: Number((time_s - from_s).toFixed(DIGITS)), joints })) };
}

export async function record(main) {
  const [dances, offer] = await Promise.all([ask("/api/dances"), ask("/api/offer")]);
  if (!main.isConnected) return () => {}; // the page shows another view by now, which has the connection
  const dance = dances.find(({ broken }) => !broken), sources = recordable(offer.sources); // every lesson is of a dance
  if (!dance || !Object.keys(sources).length) throw new Error(say("there is no camera that could record you"));
  const sound = new Sound(), state = { running: false, start: 0, frames: [], seconds: 0, song: "", saving: false, closed: false };
  const source = choice("source", Object.entries(sources).map(([key, text]) => [key, say(text)]), chosenSource(sources));
  const music = choice("music", MUSIC, remembered("music", "tick")), tempo = el("input", { type: "number", id: "bpm", min: 40, max: 240, value: USUAL_BPM });
  const song = songPanel(heard), start = el("button", { class: "main", id: "start", type: "button", onclick: () => (state.running ? stop("") : begin()) }, say("Record"));
  const told = el("p", { id: "told", role: "status" }), failed = el("p", { class: "error", id: "error", role: "alert" });
  const canvas = el("canvas", { id: "learner", role: "img", "aria-label": say("your picture with your skeleton") }), count = el("div", { class: "count", "aria-hidden": "true" });
  const guide = el("div", { class: "guide", role: "status" });
  const preview = el("canvas", { id: "preview", width: PREVIEW_PX[0], height: PREVIEW_PX[1], role: "img", "aria-label": say("your dance, as it is cut") });
  const [from, to] = ["from", "to"].map((id) => el("input", { type: "range", id, min: 0, oninput: cut }));
  const excerpt = el("p", { id: "excerpt", role: "status" }), name = el("input", { id: "name", maxLength: 60, required: true, autocomplete: "off" });
  const editor = el("form", { id: "editor", hidden: true, onsubmit: save }, el("h2", {}, say("Cut and name it")), preview,
    el("div", { class: "controls" }, el("label", {}, say("begins"), from), el("label", {}, say("ends"), to)), excerpt,
    el("div", { class: "controls" }, el("label", {}, say("name"), name), el("button", { class: "main", id: "save", type: "submit" }, say("Make it a lesson"))));
  main.append(el("h1", {}, say("Dance it yourself")),
    el("p", { class: "quiet" }, say("Stand so that the camera sees you from head to feet. {counts} counts lead in; dance, and press Stop (or the space bar).",
      { counts: COUNTS })),
    el("div", { class: "controls" }, start, el("label", {}, say("camera"), source), el("label", {}, say("music"), music),
      el("label", {}, say("beats a minute"), tempo)),
    withoutDepth(source), song.panel, failed, told, el("div", { class: "panel seen calibrating" }, canvas, count, guide), editor, el("p", {}, el("a", { href: "#/" }, say("To the dances"))));
  main.dataset.busy = ""; // nothing here is chosen by hand, and a dance would be lost
  const learner = new LearnerView(canvas), fail = ({ text }) => state.running && stop(say(text));
  const live = liveFor({ preparing: ({ text }) => { if (state.running) told.textContent = say(text); }, frame, joints, away: fail, error: fail,
    lost: () => fail({ text: "the teacher's program does not answer; is it still running?" }) });
  const onKey = (event) => {
    if (event.key !== " " || event.repeat || event.ctrlKey || event.metaKey || event.altKey) return;
    if (!editor.hidden || event.target.closest("input, select, button, a, summary, audio")) return; // a dance waits to be saved
    event.preventDefault();
    start.click();
  };
  document.addEventListener("keydown", onKey);
  const unsaved = () => state.running || !editor.hidden; // a dance that would be lost
  globalThis.onbeforeunload = (event) => { if (unsaved()) event.preventDefault(); };
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
  return Object.assign(() => {
    state.closed = true;
    document.removeEventListener("keydown", onKey);
    globalThis.onbeforeunload = null;
    for (const kind of ["dragover", "drop"]) document.removeEventListener(kind, onDrag);
    sound.close();
    live.leave();
  }, { stays: () => unsaved() && !globalThis.confirm(say("Leave without saving your dance?")) });

  function heard() {
    song.panel.hidden = music.value !== "song";
    const known = music.value === "song" && songTempo() > 0;
    if (known) tempo.value = songTempo().toFixed(1);
    else if (tempo.disabled && music.value === "song") tempo.value = USUAL_BPM; // that of the song before is not this one's
    tempo.disabled = known;
  }

  function beat_s() {
    return 60 / (tempo.disabled ? songTempo() : clamp(Number(tempo.value) || USUAL_BPM, 40, 240));
  }

  function begin() {
    if (unsaved() && !globalThis.confirm(say("Record another dance without saving this one?"))) return;
    sound.wake();
    remember("source", source.value);
    Object.assign(state, { running: true, frames: [], start: 0 });
    editor.hidden = source.disabled = true;
    failed.textContent = "";
    told.textContent = say("looking for you");
    start.textContent = say("Stop");
    start.blur(); // a focused button takes every space bar for itself
    const asked = watching(dance, source.value);
    live.send({ ...asked, lesson: { ...asked.lesson, record: true } });
  }

  function frame(content, picture) {
    learner.show(picture, { joints: content.joints, colour: "#fff" }, true);
    if (!state.running) return; // it was on its way when the recording was stopped
    tell(guide, say(content.guidance));
    if (!state.start && content.joints) lead(performance.now());
    if (state.start && performance.now() - state.start > 1000 * LONGEST_S) stop("");
  }

  // Of each image, also of those that are not drawn; between two machines, whose clocks become known by and by, time does not go back.
  function joints({ taken_ms, joints: seen }) {
    if (!state.start) return;
    const at_ms = performance.now() - live.clock.since(taken_ms, Date.now()) - state.start - 1000 * (latencyOf(source.value) || 0);
    if (at_ms / 1000 >= (state.frames.at(-1)?.[0] ?? -STEP_S) + STEP_S) state.frames.push([at_ms / 1000, seen]);
  }

  function lead(now) {
    Object.assign(state, { beat_s: beat_s(), song: music.value === "song" ? songName() : "" }); // whatever is chosen later
    const in_s = COUNTS * state.beat_s + 0.3;
    state.start = now + 1000 * in_s;
    told.textContent = say("dance from the one on");
    sound.play({ in_s, from_s: 0, to_s: LONGEST_S, beat_s: state.beat_s, speed: 1, counts: COUNTS,
      music: music.value === "song" ? songAt(0, 1) || "tick" : music.value });
  }

  function stop(message) {
    live.send({ do: "stop" });
    Object.assign(state, { running: false, start: 0 });
    source.disabled = false;
    sound.stop();
    start.textContent = say("Record");
    told.textContent = count.textContent = guide.textContent = "";
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
    start.disabled = state.saving; // another recording would take the place of this one
  }

  async function save(event) {
    event.preventDefault();
    if (editor.querySelector("#save").disabled) return;
    state.saving = true;
    cut();
    failed.textContent = "";
    told.textContent = say("adding {name} …", { name: name.value.trim() });
    const query = new URLSearchParams({ title: name.value.trim() || say("My dance"), bpm: 60 / state.beat_s }), [from_s, to_s] = bounds();
    try {
      const { identity } = await ask(`/api/recordings?${query}`, { method: "POST", body: JSON.stringify(cutOut(state.frames, from_s, to_s)) });
      if (state.song) keepBegin(identity, state.song, from_s);
      if (state.closed) return;
      editor.hidden = true; // nothing is unsaved
      location.hash = `#/dance/${identity}`;
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
      const [from_s, to_s] = bounds(), still_s = document.activeElement === to ? to_s : from_s; // for whom nothing shall move by itself
      const at_s = matchMedia("(prefers-reduced-motion: reduce)").matches ? still_s : from_s + now / 1000 % Math.max(to_s - from_s, 1);
      const [, shown] = state.frames.find(([time_s]) => time_s >= at_s) || state.frames.at(-1), [width, height] = PREVIEW_PX, pen = preview.getContext("2d");
      const [torso_x, torso_y] = shown[TORSO];
      pen.clearRect(0, 0, width, height);
      sketch(pen, shown.flatMap(([x, y]) => [100 * ((x ?? torso_x) - torso_x), 100 * (torso_y - (y ?? torso_y))]),
        { x: width / 2, y: height / 2, scale: height / (200 + FLOOR_CM), ink: getComputedStyle(document.body).color, mirrored: true });
    }
    live.draw();
    requestAnimationFrame(animate);
  }
}
