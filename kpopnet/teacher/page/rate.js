// Two learners beside their teacher, pair by pair: a rater says who dances better. Names, ranks and scores never come here.
import { View } from "./body.js";
import { Figure, JOINTS } from "./figure.js";
import { ask, clamp, clock, el, keyOf, lettersSwitch, unpacked } from "./tools.js";

const MISSING = -32768;
const SIDES = { left: "left learner", teacher: "teacher", right: "right learner" };
const CHOICES = { left: "← left is better", equal: "↓ equal, or unsure", right: "right is better →" };
const COLOURS = { right: "#e07b2c", left: "#3d8fdc", torso: "#9a95a8" };
const SPEEDS = [25, 50, 75, 100];

// Once the mouse has set a control the keys are the page's again; whom the keyboard led there goes on with it.
const afterMouse = ({ target }) => target.matches(":focus-visible") || target.blur();

// The figure of a dance, whose right limbs are orange and left ones blue; parts that are missing are left out.
class Dance extends Figure {
  constructor() {
    super((part) => COLOURS[part.split(" ")[0]]);
    this.movement = null;
  }

  show(time_s) {
    const { fps, begin_s, joints } = this.movement, last = joints.length / (3 * JOINTS) - 1;
    const frame = clamp(Math.round((time_s - begin_s) * fps), 0, last);
    this.place(Array.from({ length: JOINTS }, (_, joint) => {
      const [x, y, z] = joints.subarray(3 * (frame * JOINTS + joint));
      return x === MISSING ? null : [x / 1000, y / 1000, z / 1000];
    }));
  }
}

function views(panels) {
  const made = Object.entries(panels).map(([side, canvas]) => {
    const view = new View(canvas), figure = new Dance();
    view.stage.add(figure.group);
    view.back(3.9);
    return { side, view, figure };
  });
  for (const { view } of made) { // who turns one turns all
    view.controls.addEventListener("change", () => {
      for (const other of made) {
        other.view.camera.position.copy(view.camera.position);
        other.view.camera.quaternion.copy(view.camera.quaternion);
        other.view.changed = true;
      }
    });
  }
  return made;
}

function rating(main, rater) {
  const panels = Object.fromEntries(Object.keys(SIDES).map((side) => [side, el("canvas", { role: "img", "aria-label": `${SIDES[side]}, in 3D` })]));
  const answers = Object.fromEntries(Object.entries(CHOICES).map(([choice, text]) =>
    [choice, el("button", { type: "button", id: choice, class: choice === "equal" ? "" : "main", onclick: () => say(choice) }, text)]));
  const retry = el("button", { type: "button", id: "retry", hidden: true, onclick: () => load() }, "Try again");
  const undo = el("button", { type: "button", id: "undo", onclick: () => say("") }, "Take the last answer back");
  const play = el("button", { type: "button", id: "play", onclick: () => toggle() }, "Play");
  const again = el("button", { type: "button", id: "again", onclick: () => begin() }, "From the start");
  const speed = el("select", { id: "speed", onchange: afterMouse }, ...SPEEDS.map((one) => el("option", { value: one, selected: one === 100 }, `${one} %`)));
  const slider = el("input", { type: "range", id: "scrub", step: 0.02, "aria-label": "time", onchange: afterMouse,
    oninput: () => { state.playing = false; state.time_s = Number(slider.value); } });
  const told = el("p", { id: "told", role: "status" }), error = el("p", { class: "error", id: "error", role: "alert" });
  const bar = el("progress", { max: 1, value: 0, "aria-label": "pairs done" }), time = el("span", { class: "quiet" });
  const stage = el("div", {},
    el("div", { class: "floor trio" }, ...Object.entries(panels).map(([side, canvas]) =>
      el("div", { class: `panel ${side}` }, canvas, el("span", { class: "tag" }, SIDES[side])))),
    el("div", { class: "controls answers" }, ...Object.values(answers)),
    el("div", { class: "controls" }, play, again, el("label", {}, "speed", speed), slider, time),
    el("p", { class: "quiet" }, "Orange is the dancer's right, blue the left. Drag or use the keys a and d to turn all three, scroll to zoom. ",
      "Keys: ← left is better, → right is better, ↓ equal or unsure, space plays and pauses, r from the start, backspace takes the last answer back. ", lettersSwitch()));
  const state = { time_s: 0, from_s: 0, to_s: 0, done: 0, playing: false, busy: true, last: 0 };
  main.replaceChildren(el("h1", {}, "Which learner dances more like the teacher?"), told, bar, error, retry, stage,
    el("p", { class: "controls" }, undo, el("a", { href: "#" }, `Not ${rater}?`)));
  const shown = views(panels);
  document.addEventListener("keydown", onKey);
  load();
  requestAnimationFrame(animate);

  async function load() {
    state.busy = true;
    retry.hidden = true;
    error.textContent = "";
    try {
      const found = await ask(`/api/pair?rater=${encodeURIComponent(rater)}`);
      const over = found.done === found.of;
      Object.assign(state, { done: found.done, busy: false });
      [stage.hidden, undo.disabled, bar.value] = [over, found.done === 0, found.done / Math.max(found.of, 1)];
      told.textContent = over ? `All ${found.of} pairs are rated. Thank you, ${rater}.` : `Pair ${found.done + 1} of ${found.of}. Every answer is kept: you may stop at any time.`;
      if (over) return;
      for (const { side, view, figure } of shown) {
        const { fps, begin_s, joints_mm } = found[side];
        figure.movement = { fps, begin_s, joints: unpacked(joints_mm, Int16Array) };
        if (!view.dancers.length) view.dancers.push(figure);
        view.changed = true;
      }
      Object.assign(state, { from_s: found.from_s, to_s: found.to_s });
      Object.assign(slider, { min: found.from_s, max: found.to_s });
      begin();
      state.playing = !matchMedia("(prefers-reduced-motion: reduce)").matches;
    } catch (problem) {
      error.textContent = problem.message;
      [stage.hidden, undo.disabled, retry.hidden] = [true, true, false]; // the pair that is shown is not the one that is asked about
    }
  }

  async function say(choice) {
    if (state.busy || (choice === "" && state.done === 0) || (choice !== "" && stage.hidden)) return;
    state.busy = true;
    document.activeElement?.blur(); // or the space bar would press the button again, for the next pair
    error.textContent = "";
    try {
      await ask("/api/answer", { method: "POST", body: JSON.stringify({ rater, done: state.done, choice }) });
    } catch (problem) {
      error.textContent = problem.message;
      state.busy = false; // the answer may be given again
      return;
    }
    load();
  }

  function begin() {
    Object.assign(state, { time_s: state.from_s, playing: true });
  }

  function toggle() {
    if (state.time_s >= state.to_s) begin();
    else state.playing = !state.playing;
  }

  function onKey(event) {
    const keys = { ArrowLeft: () => say("left"), ArrowRight: () => say("right"), ArrowDown: () => say("equal"), Backspace: () => say(""),
      " ": toggle, r: begin, a: () => shown[0].view.turn(-0.2), d: () => shown[0].view.turn(0.2) };
    const { scrollHeight, clientHeight } = document.documentElement;
    if (scrollHeight > clientHeight) delete keys.ArrowDown; // it moves a page that does not fit, as one that is enlarged
    const key = keyOf(event), typing = event.target.closest("input, select") || (key === " " && event.target.closest("button"));
    if (typing || event.ctrlKey || event.metaKey || event.altKey || !keys[key]) return;
    event.preventDefault();
    if (!event.repeat || "ad".includes(key)) keys[key]();
  }

  function animate(now) {
    if (state.playing) state.time_s += Math.max(now - state.last, 0) / 1000 * Number(speed.value) / 100;
    if (state.time_s >= state.to_s) Object.assign(state, { time_s: state.to_s, playing: false });
    state.last = now;
    slider.value = state.time_s;
    const text = `${clock(state.time_s - state.from_s)} of ${clock(state.to_s - state.from_s)}`;
    if (time.textContent !== text) time.textContent = slider.ariaValueText = text;
    play.textContent = state.playing ? "Pause" : "Play";
    if (!stage.hidden) for (const { view } of shown) view.draw(state.time_s);
    requestAnimationFrame(animate);
  }
}

// The rater's name or code stands in the address, so that a reload goes on.
const main = document.getElementById("main"), named = nameIn(location.hash);
addEventListener("hashchange", () => location.reload());

function nameIn(hash) {
  try {
    return decodeURIComponent(hash.slice(1));
  } catch {
    return ""; // a name that an address could not have
  }
}

if (named) rating(main, named);
else {
  const name = el("input", { id: "name", required: true, pattern: ".*\\S.*", maxLength: 60, autocomplete: "off" });
  main.append(el("h1", {}, "Who dances better?"),
    el("p", {}, "You will see pairs of learners beside their teacher, as skeletons. Say which of the two dances more like the teacher. ",
      "Your answers are kept one by one: give the same name or code again to go on later."),
    el("form", { class: "controls", onsubmit: (event) => { event.preventDefault(); location.hash = encodeURIComponent(name.value.trim()); } },
      el("label", {}, "your name or code", name), el("button", { class: "main", id: "begin" }, "Begin")));
}
