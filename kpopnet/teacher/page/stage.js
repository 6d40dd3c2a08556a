// A dance: the teacher in 3D, the learner beside, and everything that is said while dancing.
import { View, loadBody, movementOf } from "./body.js";
import { LearnerView } from "./learner.js";
import { Live } from "./live.js";
import { stars } from "./menu.js";
import { Sound } from "./sound.js";
import { ask, clock, el, latencyOf, milliseconds, partBars, remember, remembered } from "./tools.js";

const COUNTS = 4;
const AGAIN_S = 2;
const SPEEDS = [25, 40, 50, 60, 75, 90, 100];

export async function stage(main, identity, wanted) {
  const [dance, body, offer] = await Promise.all([ask(`/api/dances/${identity}`), loadBody(), ask("/api/offer")]);
  const beat_s = 60 / dance.bpm, sound = new Sound();
  const state = { running: false, ready: false, start: 0, start_s: 0, speed: 1, from_s: 0, to_s: dance.seconds, closed: false };
  const parts = controls(dance, offer, wanted);
  const shown = panels(main, dance, parts);
  const view = new View(shown.teacher), learner = new LearnerView(shown.learner);
  const teacher = view.add(body, "teacher", 0);
  teacher.movement = movementOf(dance);
  view.mirror(parts.mirrored.checked);
  const live = new Live({ preparing, ready, frame, drawn, verdict, away, back, done, error, lost });

  parts.start.addEventListener("click", () => (state.running ? stop("") : start()));
  parts.mirrored.addEventListener("change", () => view.mirror(parts.mirrored.checked));
  parts.music.addEventListener("change", () => sound.choose(parts.music.files[0]));
  parts.phrase.addEventListener("change", () => { if (!state.running) showExcerpt(); });
  const onKey = (event) => {
    if (event.target.closest("input, select, button, a, summary")) return;
    if (event.key === " ") parts.start.click();
    else if (event.key === "ArrowLeft") view.turn(-0.2);
    else if (event.key === "ArrowRight") view.turn(0.2);
    else if (event.key === "m") parts.mirrored.click();
    else return;
    event.preventDefault();
  };
  document.addEventListener("keydown", onKey);
  showExcerpt();
  requestAnimationFrame(animate);
  if (wanted.has("go")) start();
  return () => {
    state.closed = true;
    document.removeEventListener("keydown", onKey);
    sound.stop();
    sound.forget();
    live.close();
    view.close();
  };

  function showExcerpt() {
    const phrase = parts.phrase.value;
    state.from_s = phrase === "" ? 0 : Number(phrase) * dance.phrase_s;
    state.to_s = phrase === "" ? dance.seconds : Math.min(state.from_s + dance.phrase_s, dance.seconds);
  }

  function start() {
    sound.wake();
    showExcerpt();
    state.speed = Number(parts.speed.value) / 100;
    remember("speed", parts.speed.value);
    remember("source", parts.source.value);
    Object.assign(state, { running: true, ready: false, start: 0 });
    parts.start.textContent = "Stop";
    shown.error.textContent = "";
    shown.preparing.hidden = false;
    live.send({
      do: "prepare",
      lesson: {
        dance: identity, source: parts.source.value, skill: parts.skill.value, fault: parts.fault.value, seed: Number(parts.seed.value) || 0,
        speed: state.speed, from_s: state.from_s, to_s: state.to_s, mirrored: parts.mirrored.checked,
        latency_s: latencyOf(parts.source.value) || 0,
      },
    });
  }

  function stop(message) {
    Object.assign(state, { running: false, ready: false, start: 0 });
    sound.stop();
    live.send({ do: "stop" });
    parts.start.textContent = "Start";
    shown.preparing.hidden = true;
    shown.count.textContent = "";
    shown.error.textContent = message;
  }

  function preparing({ fraction, text }) {
    shown.bar.value = fraction;
    shown.preparingText.textContent = text;
  }

  function ready() {
    shown.preparing.hidden = true;
    begin();
  }

  function begin(what = "go", from_s = state.from_s) {
    const in_s = COUNTS * beat_s / state.speed + 0.3;
    state.ready = true;
    Object.assign(state, { start: performance.now() + 1000 * in_s, start_s: from_s, reason: "" });
    shown.words.textContent = shown.verdict.textContent = "";
    live.send({ do: what, in_s });
    sound.play({
      in_s, from_s, to_s: state.to_s, beat_s, speed: state.speed, counts: COUNTS, metronome: parts.metronome.checked,
      offset_s: Number(parts.offset.value) || 0,
    });
  }

  function frame(content, picture) {
    learner.show(picture, content, parts.mirrored.checked);
    shown.guide.textContent = content.guidance;
    if (content.time_s === null) return;
    shown.score.textContent = content.so_far === null ? "–" : Math.round(content.so_far);
    shown.words.textContent = content.words === state.reason ? "" : content.words; // the verdict says it already
    shown.bars.show(content.parts);
  }

  function drawn(age_ms) {
    shown.age.textContent = `${Math.round(age_ms)} ms ago`;
  }

  function done(result) {
    sound.stop();
    shown.words.textContent = result.total === null ? result.hints[0] : `${Math.round(result.total)} of 100`;
    shown.score.textContent = result.total === null ? "–" : Math.round(result.total);
    if (result.not_saved) shown.error.textContent = result.not_saved;
    if (parts.loop.checked && result.total !== null) {
      state.start = 0;
      shown.count.textContent = "again";
      setTimeout(() => { if (state.running && !state.closed) begin(); }, 1000 * AGAIN_S);
      return;
    }
    stop(result.total === null ? result.hints[0] : "");
    if (result.session) location.hash = `#/dance/${identity}/try/${result.session}`;
  }

  function verdict({ number, end_s, total, words }) {
    const after_ms = performance.now() - state.start - 1000 * (end_s - state.start_s) / state.speed;
    shown.verdict.dataset.afterMs = Math.round(after_ms);
    shown.verdict.textContent = [`move ${number}: ${praise(total)}`, words].filter((text) => text).join(", ");
    state.reason = words;
    if (shown.words.textContent === words) shown.words.textContent = "";
  }

  // The camera sends nothing: the dance stands still, and goes on when it is back.
  function away({ text }) {
    if (state.start) state.start_s += Math.max(performance.now() - state.start, 0) / 1000 * state.speed;
    state.start = 0;
    sound.stop();
    shown.guide.textContent = text;
    shown.count.textContent = "";
  }

  function back({ from_s }) {
    shown.guide.textContent = "";
    if (state.running && from_s !== null) begin("resume", from_s);
  }

  function error({ text }) {
    stop(text);
  }

  function lost() {
    if (state.running) stop("the teacher's program does not answer; is it still running?");
  }

  function animate(now) {
    if (state.closed) return;
    let time_s = state.ready ? state.start_s : state.from_s;
    if (state.start) {
      const left_s = (state.start - now) / 1000;
      time_s = state.start_s - Math.min(left_s, 0) * state.speed;
      const beats = Math.ceil(left_s * state.speed / beat_s);
      shown.count.textContent = left_s > 0 && beats <= COUNTS ? String(COUNTS + 1 - beats) : "";
      shown.time.textContent = `${clock(Math.min(time_s, state.to_s))} of ${clock(dance.seconds)}`;
    }
    view.draw(Math.min(time_s, state.to_s));
    live.draw();
    requestAnimationFrame(animate);
  }
}

function praise(total) {
  if (total === null) return "not seen";
  return total >= 90 ? "perfect" : total >= 75 ? "great" : total >= 55 ? "good" : total >= 30 ? "keep going" : "watch the teacher";
}

function choice(id, options, value) {
  const select = el("select", { id }, ...options.map(([key, text]) => el("option", { value: key }, text)));
  if (options.some(([key]) => String(key) === String(value))) select.value = value;
  return select;
}

function controls(dance, offer, wanted) {
  const phrases = [["", "whole dance"]];
  for (let k = 0; (k + 1) * dance.phrase_s <= dance.seconds + 0.05; k++) phrases.push([k, `phrase ${k + 1}, ${clock(k * dance.phrase_s)}`]);
  return {
    start: el("button", { class: "main", id: "start", type: "button" }, "Start"),
    speed: choice("speed", SPEEDS.map((one) => [one, `${one} %`]), wanted.get("speed") || remembered("speed", 100)),
    phrase: choice("phrase", phrases, wanted.get("phrase") ?? ""),
    loop: el("input", { type: "checkbox", id: "loop", checked: wanted.has("loop") }),
    mirrored: el("input", { type: "checkbox", id: "mirrored", checked: true }),
    metronome: el("input", { type: "checkbox", id: "metronome", checked: true }),
    music: el("input", { type: "file", accept: "audio/*", id: "music" }),
    offset: el("input", { type: "number", id: "offset", step: "0.01", value: "0", size: 5 }),
    source: choice("source", Object.entries(offer.sources), remembered("source", Object.keys(offer.sources)[0])),
    skill: choice("skill", offer.skills.map((one) => [one, one]), wanted.get("skill") || "good"),
    fault: choice("fault", offer.faults.map((one) => [one, one || "none"]), wanted.get("fault") || ""),
    seed: el("input", { type: "number", id: "seed", min: 0, max: 9999, value: wanted.get("seed") || "0" }),
  };
}

function panels(main, dance, parts) {
  const shown = {
    teacher: el("canvas", { id: "teacher", "aria-label": "the teacher, in 3D; the left and right keys turn the view" }),
    learner: el("canvas", { id: "learner", "aria-label": "your picture with your skeleton" }),
    count: el("div", { class: "count", "aria-hidden": "true" }),
    guide: el("div", { class: "guide", id: "guide", role: "status" }),
    score: el("div", { class: "score", id: "so-far", "aria-label": "score so far" }, "–"),
    words: el("div", { class: "words", id: "words" }),
    verdict: el("div", { class: "verdict", id: "verdict", role: "status" }),
    time: el("span", {}), age: el("span", { id: "age" }),
    error: el("p", { class: "error", id: "error", role: "alert" }),
    bar: el("progress", { max: 1, value: 0 }), preparingText: el("span", {}),
    bars: partBars(),
  };
  shown.preparing = el("div", { id: "preparing", hidden: true }, shown.preparingText, shown.bar);
  const latency_s = latencyOf(parts.source.value);
  const simulated = el("details", { id: "simulated" }, el("summary", {}, "Simulated learner"),
    el("div", { class: "controls" }, el("label", {}, "skill", parts.skill), el("label", {}, "fault", parts.fault),
      el("label", {}, "person", parts.seed)));
  main.append(
    el("h1", {}, dance.name),
    el("p", { class: "quiet" }, `${stars(dance.difficulty)} · ${Math.round(dance.bpm)} bpm · ${clock(dance.seconds)}`),
    el("div", { class: "controls" }, parts.start, el("label", {}, "speed", parts.speed), el("label", {}, "dance", parts.phrase),
      el("label", {}, parts.loop, "loop"), el("label", {}, parts.mirrored, "as in a mirror"),
      el("label", {}, parts.metronome, "metronome"), el("label", {}, "who dances", parts.source)),
    shown.preparing, shown.error,
    el("div", { class: "floor" },
      el("div", { class: "panel" }, shown.teacher, el("span", { class: "tag" }, "teacher ", shown.time), shown.count),
      el("div", { class: "panel seen" }, shown.learner, el("span", { class: "tag" }, "you ", shown.age), shown.guide)),
    el("div", { class: "told" }, shown.score, el("div", {}, shown.verdict, shown.words)),
    shown.bars.list,
    el("details", {}, el("summary", {}, "Music"), el("div", { class: "controls" },
      el("label", {}, "your own audio file (it stays in this browser)", parts.music),
      el("label", {}, "the dance begins at second", parts.offset))),
    simulated,
    el("p", { class: "quiet", id: "latency" }, latency_s === null ? "Latency not measured. " : `${milliseconds(latency_s)} latency are taken off. `,
      el("a", { href: "#/calibrate" }, latency_s === null ? "Measure it" : "Measure it again")),
    el("p", { class: "quiet" }, "Keys: space starts and stops, left and right turn the teacher, m mirrors."),
  );
  return shown;
}
