// After a dance: the score, its course, the worst moments with a replay side by side, what to practise, history and files.
import { View, loadBody, movementOf } from "./body.js";
import { GOAL, againAddress, asDanced, isPart, phraseAt, practisable, practiseAddress, worstPhrase } from "./practice.js";
import { OF_LEARNERS, PARTS, ask, clamp, clock, el, followed, heat, keepLatency, latencyOf, milliseconds, partBars, swatch } from "./tools.js";
import { dated, say } from "./words.js";

const BEFORE_S = 1;
const LATE_S = 0.3; // the least range of the delay's course
const NOTICED_S = 0.05, ALIKE = 50; // of learners: a delay, and a posture from which on one means something
const HIGH = 150; // of a course, in its own units

export async function result(main, identity, name) {
  const base = `/api/tries/${identity}/${name}`;
  const [found, group, body, movement] = await Promise.all([
    ask(`${base}.json`), ask(`/api/dances/${identity}`), loadBody(), ask(`${base}/movement`),
  ]);
  const dance = { ...group, ...[group, ...group.others][found.dancer || 0] };
  const history = await ask(`/api/history/${identity}?who=${found.who || ""}`);
  const filming = film(base, `${identity}-${name}.mp4`);
  const danced = `skill=${found.skill}&fault=${encodeURIComponent(found.fault)}&${asDanced(found)}`;
  const leave = showResult(main, { found, dance, body, movement }, (phrase) => practiseAddress(identity, phrase, `&${danced}`));
  main.append(
    ...beside(found, identity),
    ...latency(found),
    el("h2", {}, say("Your tries")), historyTable(history, identity, name, dance.seconds),
    el("p", {}, say("Save as"), " ", ...["json", "csv", "bvh"].flatMap((kind) => [el("a", { href: `${base}.${kind}`, download: "" }, kind.toUpperCase()), " "]),
      ...filming.nodes),
    el("p", {}, el("a", { id: "again", href: againAddress(identity, found, dance, danced) }, say("Dance again"))),
  );
  return () => {
    filming.stop();
    leave();
  };
}

// Who danced beside, and what all had in common without regard to the teacher.
function beside({ total, members = [], together: common, formation }, identity) {
  if (!members.length) return [];
  const rows = [{ total }, ...members].map((one, k) => {
    const late_s = common?.posture >= ALIKE && Math.abs(common.after_s[k]) >= NOTICED_S ? common.after_s[k] : 0, told = say("learner {number}: {total}", { number: k + 1, total: one.total === null ? "–" : Math.round(one.total) });
    const late = late_s ? say(late_s > 0 ? "{seconds} s after the first" : "{seconds} s before the first", { seconds: Math.abs(late_s).toFixed(2) }) : "";
    return el("li", {}, swatch(OF_LEARNERS[k]), one.session ? el("a", { href: `#/dance/${identity}/try/${one.session}` }, told) : told, late ? `, ${late}` : "");
  });
  if (formation !== undefined) return [el("h2", {}, say("Formation")), ...formationOf(formation), el("ul", { class: "list" }, ...rows)];
  return [el("h2", {}, say("Together")), el("p", { id: "together" }, common
    ? say("as one {similarity} of 100: timing {timing}, posture {posture}", Object.fromEntries(["similarity", "timing", "posture"].map((name) => [name, Math.round(common[name])])))
    : say("not seen together for long enough")), el("ul", { class: "list" }, ...rows)];
}

// How a group kept its places relative to each other.
function formationOf(kept) {
  if (!kept || kept.why_not) return [el("p", { id: "formation" }, say(kept ? kept.why_not : "not seen together for long enough"))];
  const told = kept.remarks.map(({ member, text }) => el("li", {}, swatch(OF_LEARNERS[member]), say(text)));
  return [el("p", { id: "formation" }, say("{similarity} of 100; you stood {percent} % as far apart as they do",
    { similarity: Math.round(kept.similarity), percent: Math.round(100 * kept.spread) })), told.length ? el("ul", { class: "list" }, ...told) : ""];
}

const listed = (figures) => Object.entries(figures).map(([name, value]) => `${say(name)} ${Math.round(value)}`).join(", ");

// What the total consists of where the teacher chose it; place, height, lean and facing; what is left free. Tries of before lack some.
export function furtherOf({ weights = {}, counted = {}, stage = {}, on_stage = [], free = {} }) {
  const quiet = (id, text) => el("p", { class: "quiet", id }, text);
  return [
    Object.keys(weights).length ? quiet("contains", say("The total, by weight: {weights}.", { weights: Object.entries(weights).map(([name, share]) => say("{what} {figure}", { what: say(name), figure: name in counted ? say("{figure} (× {share})", { figure: Math.round(counted[name]), share }) : share })).join(", ") })) : "",
    Object.keys(stage).length ? quiet("on-stage", say("On the stage, beside timing and posture: {figures}.", { figures: [listed(stage), ...on_stage.map((one) => say(one))].join("; ") })) : "",
    Object.keys(free).length ? quiet("in-free-parts", say("In the free parts: {figures}.", { figures: listed(free) })) : "",
  ];
}

// A result with the movements of both, and, where it can be practised, the address for each phrase; returns what ends it.
export function showResult(main, { found, dance, body, movement }, practiseAt = null) {
  const end_s = found.to_s || dance.seconds;
  const state = { time_s: found.from_s, until_s: end_s, playing: false, closed: false, last: 0 };
  const canvas = el("canvas", { id: "replay", role: "img", "aria-label": say("the teacher on the left, you on the right") });
  const slider = el("input", { type: "range", id: "scrub", min: found.from_s, max: end_s, step: 0.02, value: found.from_s,
    "aria-label": say("time"), oninput: () => { state.playing = false; seek(Number(slider.value)); } });
  const play = el("button", { type: "button", id: "play", onclick: () => toggle() }, say("Play"));
  const time = el("span", { class: "quiet" });
  const course = courseOf(found, dance, end_s, (time_s) => watch(time_s - BEFORE_S, time_s + 2 * BEFORE_S));
  const bars = partBars();
  main.append(
    el("h1", {}, say("{name}: {total} of 100",
      { name: found.name, total: `${Math.round(found.total)}${found.uncertainty ? ` ± ${Math.round(found.uncertainty)}` : ""}` }),
    el("small", { class: "quiet" }, isPart(found, dance.seconds) ? ` ${excerptOf(found, dance.seconds)}` : "")),
    el("div", { class: "numbers" }, number("total", found.total, say("total")), number("timing", found.timing, say("timing")),
      number("posture", found.posture, say("posture")), found.speed ? number("speed", 100 * found.speed, say("speed, %")) : null),
    bars.list,
    ...furtherOf(found),
    practiseAt ? worstLink(found, dance, practiseAt) : "",
    ...found.hints.map((hint) => el("p", { class: "error" }, say(hint))),
    el("h2", {}, say("Worst moments")), momentList(found, watch),
    el("div", { class: "replay" }, el("div", { class: "panel" }, canvas, el("span", { class: "tag" }, say("teacher left, you right"))),
      el("div", { class: "controls" }, play, slider, time)),
    el("h2", {}, say("Course of the dance")), el("p", { class: "quiet" }, say(COURSE)), course.picture, ...moreCourses(found, end_s),
    ...(found.faults.length ? [el("h2", {}, say("What to mend, the costliest first")), el("ol", {}, ...found.faults.map((text) => el("li", {}, say(text))))] : []),
    el("h2", {}, say("Phrase by phrase")), phraseTable(found, dance, watch, practiseAt),
  );
  bars.show(found.parts, found.coverage);
  const view = new View(canvas);
  view.add(body, "teacher", -0.7).movement = movementOf(dance);
  view.add(body, "learner", 0.7).movement = movementOf(movement);
  view.back(canvas.clientWidth < 1.3 * canvas.clientHeight ? 5.8 : 4.4);
  seek(state.time_s);
  requestAnimationFrame(animate);
  return () => {
    state.closed = true;
    view.close();
  };

  function seek(time_s) {
    state.time_s = clamp(time_s, found.from_s, end_s);
    slider.value = state.time_s;
    const text = say("{time} of {end}", { time: clock(state.time_s), end: clock(end_s) });
    if (time.textContent !== text) time.textContent = slider.ariaValueText = text;
    course.mark(state.time_s);
  }

  function watch(from_s, to_s) {
    seek(from_s);
    Object.assign(state, { until_s: Math.min(to_s, end_s), playing: true, last: performance.now() });
    canvas.scrollIntoView({ block: "nearest" });
  }

  function toggle() {
    if (state.playing) state.playing = false;
    else watch(state.time_s >= end_s - 0.1 ? found.from_s : state.time_s, end_s);
  }

  function animate(now) {
    if (state.closed) return;
    if (state.playing) {
      seek(state.time_s + (now - state.last) / 1000 * 0.6);
      if (state.time_s >= state.until_s) state.playing = false;
    }
    state.last = now;
    play.textContent = say(state.playing ? "Pause" : "Play");
    view.draw(state.time_s);
    requestAnimationFrame(animate);
  }
}

function number(id, value, text) {
  return el("div", { id: `result-${id}` }, el("b", {}, value === null ? "–" : String(Math.round(value))), text);
}

function worstLink(found, dance, practiseAt) {
  const worst = worstPhrase(found.phrases, dance);
  if (!worst || Math.round(worst.total) >= GOAL) return "";
  return el("p", {}, el("a", { class: "button", id: "practise-worst", href: practiseAt(worst.phrase) },
    say("Practise phrase {number}, which went worst ({total}), until {goal}", { number: worst.phrase + 1, total: Math.round(worst.total), goal: GOAL })));
}

function momentList(found, watch) {
  if (!found.worst.length) return el("p", {}, say("Nothing was clearly wrong."));
  return el("ol", { class: "list", id: "worst" }, ...found.worst.map((one) => el("li", {},
    el("button", { type: "button", "data-part": one.part, onclick: () => watch(one.start_s - BEFORE_S, one.end_s + BEFORE_S) }, say(one.text)))));
}

export function part(tag, attributes, ...children) {
  const node = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
  node.append(...children);
  return node;
}

// A line through the known values of a course, with gaps where none is known; `x` and `y` place times and values.
export function line(times_s, values, x, y) {
  const steps = values.map((value, i) => value === null ? "" : `${i && values[i - 1] !== null ? "L" : "M"}${x(times_s[i])},${y(value)}`);
  return part("path", { class: "line", d: steps.join("") });
}

const placed = (found, end_s) => (time_s) => 1000 * (time_s - found.from_s) / (end_s - found.from_s);

const COURSE = "Score, 0 at the bottom, 100 at the top; the worst moments are shaded";

// The score over the dance as a picture; phrases are marked, the worst moments shaded, a click chooses a time.
function courseOf(found, dance, end_s, choose) {
  const span_s = end_s - found.from_s, x = placed(found, end_s), y = (value) => 145 - 1.4 * value;
  const picture = part("svg", { class: "course", id: "course", viewBox: "0 0 1000 150", preserveAspectRatio: "none", role: "img",
    "aria-label": say(COURSE) });
  for (const one of found.worst) picture.append(part("rect", { class: "bad", x: x(one.start_s), y: 0, width: Math.max(x(one.end_s) - x(one.start_s), 4), height: 150 }));
  for (const one of found.phrases) picture.append(part("line", { class: "phrase", x1: x(one.start_s), x2: x(one.start_s), y1: 0, y2: 150 }));
  picture.append(line(found.course.time_s, found.course.total, x, y));
  const now = part("line", { class: "now", x1: 0, x2: 0, y1: 0, y2: 150 });
  picture.append(now);
  picture.addEventListener("click", (event) => {
    const box = picture.getBoundingClientRect();
    choose(found.from_s + (event.clientX - box.left) / box.width * span_s);
  });
  return { picture, mark: (time_s) => { now.setAttribute("x1", x(time_s)); now.setAttribute("x2", x(time_s)); } };
}

// The delay over the dance, and the posture of each part: what is wrong is orange, what is right blue.
function moreCourses(found, end_s) {
  const { time_s: times_s, delay_s, parts } = found.course, x = placed(found, end_s);
  const most_s = Math.max(LATE_S, ...delay_s.map((value) => Math.abs(value || 0))), middle = HIGH / 2;
  const frame = (text, ...nodes) => part("svg", { class: "course", viewBox: `0 0 1000 ${HIGH}`, preserveAspectRatio: "none", role: "img", "aria-label": text }, ...nodes);
  const wide = Math.max(x(times_s[1] || end_s) - x(times_s[0]), 2);
  const rows = PARTS.filter((name) => parts[name]).map((name) => el("div", { class: "row" }, el("span", {}, say(name)),
    frame(say("posture of {part}", { part: say(name) }), ...times_s.map((time_s, i) => part("rect", { x: x(time_s) - wide / 2, y: 0, width: wide + 1, height: HIGH,
      fill: parts[name][i] === null ? "#8a8694" : heat(parts[name][i]) })))));
  return [
    el("p", { class: "quiet" }, say("Late (above) and early (below), up to {seconds} s", { seconds: most_s.toFixed(1) })),
    frame(say("delay over the dance"), part("line", { class: "phrase", x1: 0, x2: 1000, y1: middle, y2: middle }),
      line(times_s, delay_s, x, (value) => middle - 0.95 * middle * value / most_s)),
    el("p", { class: "quiet" }, say("Parts of the body: orange is wrong, blue is right")), el("div", { class: "rows" }, ...rows),
  ];
}

const RIGHT = 90; // of 100, as in kpopnet/dance/feedback.py

const headed = (...columns) => el("thead", {}, el("tr", {}, ...columns.map((text) => el("th", {}, say(text)))));

function phraseTable(found, dance, watch, practiseAt) {
  const rows = found.phrases.map((one) => {
    const phrase = phraseAt(one.start_s, dance);
    const words = [...(one.unseen || []), ...one.moments.map(({ text }) => text)].map((text) => say(text)).join("; ");
    const unnamed = one.total >= RIGHT ? "no fault stands out" : "differences throughout, of which none stands out";
    return el("tr", {}, el("td", {}, el("button", { type: "button", onclick: () => watch(one.start_s, one.end_s) }, say("phrase {number}, {time}", { number: phrase + 1, time: clock(one.start_s) }))),
      el("td", {}, one.total === null ? "–" : String(Math.round(one.total))),
      el("td", {}, el("div", {}, words || say(one.total === null ? "not compared" : unnamed)),
        practiseAt && one.total !== null && practisable(phrase, dance) ? el("a", { class: "practise", href: practiseAt(phrase) }, say("practise, slowed first")) : null));
  });
  return el("div", { class: "scroll" }, el("table", {}, headed("phrase", "score", "what to mend"),
    el("tbody", {}, ...rows)));
}

// Who danced on time and was late all the same: camera, sound and screen are.
function latency(found) {
  if (found.latency_s === null || Math.abs(found.latency_s) < 0.03) return [];
  const total_s = clamp((found.taken_off_s ?? latencyOf(found.source) ?? 0) + found.latency_s, -1, 1); // of tries of before: today's
  const told = el("span", { role: "status", tabIndex: -1 });
  const button = el("button", { type: "button", id: "calibrate", onclick: () => {
    keepLatency(found.source, total_s);
    button.disabled = true;
    told.textContent = ` ${say("{time} are taken off from now on.", { time: milliseconds(total_s) })}`;
    told.focus(); // a button that is disabled loses the keyboard's place
  } }, say("I was on time: take off {time}", { time: milliseconds(found.latency_s) }));
  return [el("p", {}, say("Camera, sound and screen delay what is scored."), " ", button, told, " ", el("a", { href: "#/calibrate" }, say("Measure it")))];
}

// The film is made while the page listens, which takes about as long as the dance; whoever leaves cancels it.
function film(base, name) {
  const told = el("span", { role: "status", id: "film-told" }), asked = say("film, teacher and you side by side");
  const button = el("button", { type: "button", id: "film", onclick: () => (making ? making.abort() : make()) }, asked);
  let making = null;
  return { nodes: [button, told], stop: () => making && making.abort() };

  async function make() {
    making = new AbortController();
    told.ariaLive = "off"; // each percent would be read
    button.textContent = say("cancel the film");
    try {
      await followed(`${base}/film`, making.signal, (fraction) => { told.textContent = ` ${say("making the film: {percent} %", { percent: Math.round(100 * fraction) })}`; });
      el("a", { href: `${base}.mp4`, download: name }).click();
      told.ariaLive = "polite";
      told.textContent = ` ${say("the film is saved")}`;
    } catch (error) {
      told.ariaLive = "polite";
      told.textContent = ` ${making.signal.aborted ? say("the film was cancelled") : error.message}`;
    }
    making = null;
    button.textContent = asked;
  }
}

export const excerptOf = ({ from_s, to_s }, seconds) => `${clock(from_s)} – ${clock(to_s || seconds)}`;

function historyTable(history, identity, name, seconds) {
  return el("div", { class: "scroll" }, el("table", { id: "history" }, headed("danced on", "score", "excerpt", "speed", "camera"), el("tbody", {}, ...history.map((one) => el("tr", {},
    el("td", {}, one.session === name ? say("this one") : el("a", { href: `#/dance/${identity}/try/${one.session}` }, when(one.session))),
    el("td", {}, one.total === null ? "–" : String(Math.round(one.total))), el("td", {}, excerptOf(one, seconds)), el("td", {}, say("{percent} %", { percent: Math.round(100 * one.speed) })),
    el("td", {}, one.source === "simulated" ? say("simulated, {skill}", { skill: say(`skill|${one.skill}`) }) : say(`source|${one.source}`)))))));
}

// The day and time in the name of a try, such as 20261203-091100-123.
export function when(name) {
  const [year, month, ...rest] = [[0, 4], [4, 6], [6, 8], [9, 11], [11, 13]].map(([from, to]) => Number(name.slice(from, to)));
  return dated(Date.UTC(year, month - 1, ...rest));
}
