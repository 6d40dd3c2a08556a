// What stands on the page of a dance: its controls, the pictures, and the words.
import { LOOPS } from "./loops.js";
import { inStars } from "./menu.js";
import { GOALS, SPEEDS, practisable } from "./practice.js";
import { clock, el, latencyOf, lettersSwitch, milliseconds, partBars, remembered } from "./tools.js";
import { WEBCAM, withoutDepth } from "./webcam.js";
import { say } from "./words.js";

export const MUSIC = [["tick", say("a metronome")], ...Object.keys(LOOPS).map((one) => [one, say(`a loop, ${one}`)]), ["song", say("my song")], ["none", say("nothing")]];

export function choice(id, options, value) {
  const select = el("select", { id }, ...options.map(([key, text]) => el("option", { value: key }, text)));
  if (options.some(([key]) => String(key) === String(value))) select.value = value;
  return select;
}

export function controls(dance, offer, wanted) {
  const phrases = [["", say("whole dance")]];
  for (let k = 0; practisable(k, dance); k++) phrases.push([k, say("phrase {number}, {time}", { number: k + 1, time: clock(k * dance.phrase_s) })]);
  const parts = {
    start: el("button", { class: "main", id: "start", type: "button" }, say("Start")),
    pause: el("button", { type: "button", id: "pause", hidden: true }),
    speed: choice("speed", SPEEDS.map((one) => [one, say("{percent} %", { percent: one })]), wanted.get("speed") || remembered("speed", 100)),
    phrase: choice("phrase", phrases, wanted.get("phrase") ?? ""),
    practise: choice("practise", [["", say("off")], ...GOALS.map((one) => [one, say("until {goal}", { goal: one })])], wanted.get("practise") ?? ""),
    full: el("button", { type: "button", id: "full" }, say("Full screen")),
    loop: el("input", { type: "checkbox", id: "loop", checked: wanted.has("loop") }),
    mirrored: el("input", { type: "checkbox", id: "mirrored", checked: wanted.get("mirrored") !== "0" }),
    music: choice("music", MUSIC, remembered("music", "tick")),
    source: choice("source", Object.entries(offer.sources).map(([key, text]) => [key, say(text)]), remembered("source", Object.keys(offer.sources)[0])),
    skill: choice("skill", offer.skills.map((one) => [one, say(`skill|${one}`)]), wanted.get("skill") || "good"),
    fault: choice("fault", offer.faults.map((one) => [one, say(`fault|${one || "none"}`)]), wanted.get("fault") || ""),
    people: choice("people", [1, 2, 3].map((one) => [one, one]), remembered("people", 1)),
    dancer: choice("dancer", [dance, ...dance.others].map((_, k) => [k, ""]), wanted.get("dancer") || 0),
    seed: el("input", { type: "number", id: "seed", min: 0, max: 9999, value: wanted.get("seed") || "0" }),
  };
  // The dancers come from the group's own left to its right, which is the learner's only in a mirror.
  const count = () => [...parts.dancer.options].forEach((option, k, { length }) => {
    option.textContent = say("{number} from your left", { number: parts.mirrored.checked ? k + 1 : length - k });
  });
  parts.mirrored.addEventListener("change", count);
  count();
  return parts;
}

// Whom learners dance, from their own left: the chosen dancer and the next ones towards the group's own right, with the mirror and
// without it, so that the learners' formation is the group's. Without it the group is shown, as the learners are, from before it.
export function taught(parts, people) {
  const last = parts.dancer.options.length - 1, first = Math.max(Math.min(Number(parts.dancer.value), last + 1 - people), 0);
  return Array.from({ length: people }, (_, k) => Math.min(first + k, last));
}

// Several learners need depth: a webcam follows one, and one is simulated.
export const alone = (source) => [WEBCAM, "simulated"].includes(source);

export function panels(main, dance, parts, song) {
  const shown = {
    teacher: el("canvas", { id: "teacher", role: "img", "aria-label": say("the teacher, in 3D; the left and right keys turn the view") }),
    learner: el("canvas", { id: "learner", role: "img", "aria-label": say("your picture with your skeleton") }),
    count: el("div", { class: "count", "aria-hidden": "true" }),
    guide: el("div", { class: "guide", id: "guide", role: "status" }),
    score: el("div", { class: "score", id: "so-far", role: "group", "aria-label": say("score so far") }, "–"),
    words: el("div", { class: "words", id: "words", role: "status" }),
    verdict: el("div", { class: "verdict", id: "verdict", role: "status" }),
    lane: el("canvas", { id: "lane", role: "img", "aria-label": say("the coming moves") }),
    stars: el("div", { id: "stars", role: "group", "aria-label": say("stars so far") }), streak: el("div", { id: "streak" }),
    beginNow: el("button", { type: "button", id: "begin", hidden: true }, say("Begin now")),
    practice: el("p", { id: "practice", role: "status" }),
    time: el("span", {}), age: el("span", { id: "age" }),
    error: el("p", { class: "error", id: "error", role: "alert" }),
    bar: el("progress", { max: 1, value: 0, "aria-labelledby": "preparing-text" }), preparingText: el("span", { id: "preparing-text", role: "status" }),
    members: el("ol", { id: "members" }), bars: partBars(),
  };
  shown.preparing = el("div", { id: "preparing", hidden: true }, shown.preparingText, shown.bar);
  shown.stage = el("div", { class: "stage", id: "stage" }, // all that is told while one dances: in full screen nothing else is drawn
    shown.preparing, shown.error, shown.beginNow,
    el("div", { class: "floor" },
      el("div", { class: "panel" }, shown.teacher, el("span", { class: "tag" }, `${say("teacher")} `, shown.time), shown.count),
      el("div", { class: "panel seen" }, shown.learner, el("span", { class: "tag" }, `${say("you")} `, shown.age), shown.guide)),
    shown.lane,
    el("div", { class: "told" }, el("div", {}, shown.score, shown.stars, shown.streak), el("div", {}, shown.verdict, shown.words, shown.members, shown.practice)));
  parts.full.hidden = !shown.stage.requestFullscreen; // as on an iPhone
  const latency = el("p", { class: "quiet", id: "latency" });
  const chosen = () => {
    parts.people.disabled = alone(parts.source.value);
    const latency_s = latencyOf(parts.source.value);
    latency.replaceChildren(`${latency_s === null ? say("Latency not measured.") : say("{time} of latency are taken off.", { time: milliseconds(latency_s) })} `,
      el("a", { href: "#/calibrate" }, say(latency_s === null ? "Measure it" : "Measure it again")));
  };
  parts.source.addEventListener("change", chosen);
  chosen();
  const simulated = el("details", { id: "simulated" }, el("summary", {}, say("Simulated learner")),
    el("div", { class: "controls" }, el("label", {}, say("skill"), parts.skill), el("label", {}, say("fault"), parts.fault),
      el("label", {}, say("person"), parts.seed)));
  main.append(
    el("h1", {}, el("bdi", {}, dance.name), el("small", { class: "quiet" }, inStars("span", dance.difficulty), ` · ${say("{count} bpm", { count: Math.round(dance.bpm) })} · ${clock(dance.seconds)}`)),
    el("div", { class: "controls" }, parts.start, parts.pause, el("label", {}, say("speed"), parts.speed), el("label", {}, say("dance"), parts.phrase),
      el("label", {}, say("practise"), parts.practise), el("label", {}, parts.loop, say("loop")), el("label", {}, parts.mirrored, say("as in a mirror")),
      el("label", {}, say("music"), parts.music), el("label", {}, say("camera"), parts.source), el("label", {}, say("learners"), parts.people),
      el("label", { hidden: !dance.others.length }, say("dancer"), parts.dancer), parts.full),
    song, withoutDepth(parts.source),
    shown.stage,
    shown.bars.list,
    simulated,
    latency,
    el("p", { class: "quiet" }, say("Hold your hands together above your head for a second and a half to pause, and again to go on."), " ",
      say("Keys: space starts and stops, p pauses, left and right turn the teacher, m mirrors, f is full screen."), " ", lettersSwitch()),
  );
  return shown;
}
