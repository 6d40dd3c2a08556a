// A guided step that measures how late camera, sound and screen make what is scored: an arm on every beat.
import { LearnerView } from "./learner.js";
import { liveFor } from "./live.js";
import { choice } from "./panels.js";
import { Sound } from "./sound.js";
import { ask, el, keepLatency, latencyOf, milliseconds, remember, remembered, tell } from "./tools.js";
import { say } from "./words.js";

const BEAT_S = 1, BEATS = 12, COUNTS = 4, START_S = COUNTS * BEAT_S + 0.3;

export async function calibrate(main) {
  const [dances, offer] = await Promise.all([ask("/api/dances"), ask("/api/offer")]);
  if (!main.isConnected) return () => {}; // the page shows another view by now, which has the connection
  const dance = dances.find((one) => one.seconds >= BEATS * BEAT_S); // its length is all that is used of it
  if (!dance) throw new Error(say("there is no dance that is long enough to count with"));
  const state = { start: 0, running: false, closed: false }, sound = new Sound();
  const source = choice("source", Object.entries(offer.sources).map(([key, text]) => [key, say(text)]), remembered("source", ""));
  source.addEventListener("change", showKept);
  const start = el("button", { class: "main", id: "start", type: "button", onclick: () => (state.running ? stop("") : begin()) }, say("Start"));
  const told = el("p", { id: "told", role: "status" }), failed = el("p", { class: "error", id: "error", role: "alert" });
  const kept = el("p", { id: "kept", role: "status" }), beat = el("div", { class: "count", "aria-hidden": "true" });
  const canvas = el("canvas", { id: "learner", role: "img", "aria-label": say("your picture with your skeleton") });
  const guide = el("div", { class: "guide", role: "status" });
  main.append(
    el("h1", {}, say("Latency of camera, sound and screen")),
    el("p", {}, say("Stand so that you are seen from head to feet. After {counts} ticks raise an arm so that it is highest at each tick, "
      + "and lower it in between, {beats} times. Or clap at each tick. What is measured is taken off whenever you dance here.",
    { counts: COUNTS, beats: BEATS })),
    el("div", { class: "controls" }, start, el("label", {}, say("camera"), source)),
    told, failed,
    el("div", { class: "panel seen calibrating" }, canvas, beat, guide), kept,
    el("p", {}, el("a", { href: "#/" }, say("To the dances"))),
  );
  main.dataset.busy = ""; // nothing here is chosen by hand
  const learner = new LearnerView(canvas);
  const live = liveFor({ preparing, ready, frame, away, back: () => stop(say("the camera was away; start again")), done,
    error: ({ text }) => stop(say(text)), lost: () => state.running && stop(say("the teacher's program does not answer; is it still running?")) });
  showKept();
  requestAnimationFrame(animate);
  return () => {
    state.closed = true;
    sound.close();
    live.leave();
  };

  function showKept() {
    const latency_s = latencyOf(source.value);
    kept.textContent = latency_s === null ? say("Nothing is taken off yet.")
      : `${say("{time} are taken off for {source}.", { time: milliseconds(latency_s), source: say(offer.sources[source.value]) })} `;
    if (latency_s === null) return;
    kept.append(el("button", { type: "button", id: "forget", onclick: () => { keepLatency(source.value, null); showKept(); start.focus(); } }, say("Take nothing off")));
  }

  function begin() {
    sound.wake();
    remember("source", source.value);
    Object.assign(state, { running: true, start: 0 });
    source.disabled = true; // its latency is what is measured
    start.textContent = say("Stop");
    failed.textContent = "";
    live.send({ do: "prepare", lesson: { dance: dance.identity, source: source.value, to_s: BEATS * BEAT_S, calibrate: true } });
  }

  function preparing({ text }) {
    if (state.running) told.textContent = say(text); // as in `done`
  }

  function ready() {
    if (!state.running) return; // as in `done`
    told.textContent = say("an arm up at each tick");
    state.start = performance.now() + 1000 * START_S;
    live.send({ do: "go", in_s: START_S });
    sound.play({ in_s: START_S, from_s: 0, to_s: BEATS * BEAT_S, beat_s: BEAT_S, speed: 1, counts: COUNTS, music: "tick" });
  }

  function frame(content, picture) {
    if (!state.running) return; // as in `done`
    learner.show(picture, content, true);
    tell(guide, say(content.guidance));
  }

  function away({ text }) {
    if (!state.running) return; // as in `done`
    state.start = 0; // nothing is counted without ticks
    sound.stop();
    guide.textContent = say(text);
  }

  function done({ latency_s, hints }) {
    if (!state.running) return; // it was on its way when it was stopped
    stop(latency_s === null ? say(hints[0]) : "");
    if (latency_s === null) return;
    keepLatency(source.value, latency_s);
    told.textContent = say("You were measured {time} after the tick.", { time: milliseconds(latency_s) });
    showKept();
  }

  function stop(message) {
    Object.assign(state, { running: false, start: 0 });
    source.disabled = false;
    sound.stop();
    live.send({ do: "stop" });
    start.textContent = say("Start");
    told.textContent = beat.textContent = guide.textContent = "";
    failed.textContent = message;
  }

  function animate(now) {
    if (state.closed) return;
    const beats = state.start ? (now - state.start) / 1000 / BEAT_S : -COUNTS - 1;
    const number = Math.floor(beats) + 1;
    beat.textContent = beats >= -COUNTS && number <= BEATS ? String(number > 0 ? number : number + COUNTS) : "";
    live.draw();
    requestAnimationFrame(animate);
  }
}
