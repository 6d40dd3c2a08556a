// After a dance: the score, its course, the worst moments with a replay side by side, what to practise, history and files.
import { View, loadBody, movementOf } from "./body.js";
import { ask, clamp, clock, el, followed, keepLatency, latencyOf, milliseconds, partBars } from "./tools.js";

const BEFORE_S = 1;

export async function result(main, identity, name) {
  const base = `/api/tries/${identity}/${name}`;
  const [found, dance, body, movement, history] = await Promise.all([
    ask(`${base}.json`), ask(`/api/dances/${identity}`), loadBody(), ask(`${base}/movement`), ask(`/api/history/${identity}`),
  ]);
  const end_s = found.to_s || dance.seconds;
  const state = { time_s: found.from_s, until_s: end_s, playing: false, closed: false, last: 0 };
  const canvas = el("canvas", { id: "replay", "aria-label": "the teacher on the left, you on the right" });
  const slider = el("input", { type: "range", id: "scrub", min: found.from_s, max: end_s, step: 0.02, value: found.from_s,
    "aria-label": "time", oninput: () => { state.playing = false; seek(Number(slider.value)); } });
  const play = el("button", { type: "button", id: "play", onclick: () => toggle() }, "Play");
  const time = el("span", { class: "quiet" });
  const course = courseOf(found, dance, end_s, (time_s) => watch(time_s - BEFORE_S, time_s + 2 * BEFORE_S));
  const bars = partBars(), filming = film(base, `${identity}-${name}.mp4`);
  main.append(
    el("h1", {}, `${found.name}: ${Math.round(found.total)} of 100`),
    el("div", { class: "numbers" }, number("total", found.total, "total"), number("timing", found.timing, "timing"),
      number("posture", found.posture, "posture"), number("speed", 100 * found.speed, "speed, %")),
    bars.list,
    ...found.hints.map((hint) => el("p", { class: "error" }, hint)),
    el("h2", {}, "Course of the dance"), course.picture,
    el("h2", {}, "Worst moments"), momentList(found, watch),
    el("div", { class: "replay" }, el("div", { class: "panel" }, canvas, el("span", { class: "tag" }, "teacher left, you right")),
      el("div", { class: "controls" }, play, slider, time)),
    el("h2", {}, "Practise"), practise(found, dance, identity),
    ...latency(found),
    el("h2", {}, "Your tries"), historyTable(history, identity, name),
    el("p", {}, "Save as ", ...["json", "csv", "bvh"].flatMap((kind) => [el("a", { href: `${base}.${kind}`, download: "" }, kind.toUpperCase()), " "]),
      ...filming.nodes),
    el("p", {}, el("a", { href: `#/dance/${identity}` }, "Dance again")),
  );
  bars.show(found.parts);
  const view = new View(canvas);
  view.add(body, "teacher", -0.7).movement = movementOf(dance);
  view.add(body, "learner", 0.7).movement = movementOf(movement);
  view.back(canvas.clientWidth < 1.3 * canvas.clientHeight ? 5.8 : 4.4);
  requestAnimationFrame(animate);
  return () => {
    state.closed = true;
    filming.stop();
    view.close();
  };

  function seek(time_s) {
    state.time_s = clamp(time_s, found.from_s, end_s);
    slider.value = state.time_s;
    time.textContent = `${clock(state.time_s)} of ${clock(end_s)}`;
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
    play.textContent = state.playing ? "Pause" : "Play";
    view.draw(state.time_s);
    requestAnimationFrame(animate);
  }
}

function number(id, value, text) {
  return el("div", { id: `result-${id}` }, el("b", {}, value === null ? "–" : String(Math.round(value))), text);
}

function momentList(found, watch) {
  if (!found.worst.length) return el("p", {}, "Nothing was clearly wrong.");
  return el("ol", { class: "list", id: "worst" }, ...found.worst.map((one) => el("li", {},
    el("button", { type: "button", "data-part": one.part, onclick: () => watch(one.start_s - BEFORE_S, one.end_s + BEFORE_S) }, one.text))));
}

// The score over the dance as a picture; phrases are marked, the worst moments shaded, a click chooses a time.
function courseOf(found, dance, end_s, choose) {
  const name = "http://www.w3.org/2000/svg", span_s = end_s - found.from_s;
  const x = (time_s) => 1000 * (time_s - found.from_s) / span_s, y = (value) => 145 - 1.4 * value;
  const part = (tag, attributes) => {
    const node = document.createElementNS(name, tag);
    for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
    return node;
  };
  const picture = part("svg", { class: "course", id: "course", viewBox: "0 0 1000 150", preserveAspectRatio: "none", role: "img",
    "aria-label": "score over the dance, 0 at the bottom, 100 at the top" });
  for (const one of found.worst) picture.append(part("rect", { class: "bad", x: x(one.start_s), y: 0, width: Math.max(x(one.end_s) - x(one.start_s), 4), height: 150 }));
  for (const one of found.phrases) picture.append(part("line", { class: "phrase", x1: x(one.start_s), x2: x(one.start_s), y1: 0, y2: 150 }));
  const points = found.course.time_s.map((time_s, i) => [time_s, found.course.total[i]]).filter(([, value]) => value !== null);
  picture.append(part("polyline", { class: "line", points: points.map(([time_s, value]) => `${x(time_s)},${y(value)}`).join(" ") }));
  const now = part("line", { class: "now", x1: 0, x2: 0, y1: 0, y2: 150 });
  picture.append(now);
  picture.addEventListener("click", (event) => {
    const box = picture.getBoundingClientRect();
    choose(found.from_s + (event.clientX - box.left) / box.width * span_s);
  });
  return { picture, mark: (time_s) => { now.setAttribute("x1", x(time_s)); now.setAttribute("x2", x(time_s)); } };
}

function practise(found, dance, identity) {
  const rows = found.phrases.filter((one) => one.total !== null).map((one) => {
    const phrase = Math.max(Math.round((one.start_s) / dance.phrase_s), 0);
    const address = `#/dance/${identity}?phrase=${phrase}&speed=50&loop&go&skill=${found.skill}&fault=${encodeURIComponent(found.fault)}`;
    return el("tr", {}, el("td", {}, `phrase ${phrase + 1}`), el("td", {}, clock(one.start_s)), el("td", {}, String(Math.round(one.total))),
      el("td", {}, one.moments.length ? one.moments[0].words : ""),
      el("td", {}, el("a", { class: "practise", href: address }, "practise slowed and looped")));
  });
  return el("div", { class: "scroll" }, el("table", {}, el("thead", {}, el("tr", {}, ...["phrase", "at", "score", "worst", ""].map((text) => el("th", {}, text)))),
    el("tbody", {}, ...rows)));
}

// Who danced on time and was late all the same: camera, sound and screen are.
function latency(found) {
  if (found.latency_s === null || Math.abs(found.latency_s) < 0.03) return [];
  const total_s = clamp((latencyOf(found.source) || 0) + found.latency_s, -1, 1);
  const told = el("span", { role: "status" });
  const button = el("button", { type: "button", id: "calibrate", onclick: () => {
    keepLatency(found.source, total_s);
    button.disabled = true;
    told.textContent = ` ${milliseconds(total_s)} are taken off from now on.`;
  } }, `I was on time: take off ${milliseconds(found.latency_s)}`);
  return [el("p", {}, "Camera, sound and screen delay what is scored. ", button, told, " Or ", el("a", { href: "#/calibrate" }, "measure it"), ".")];
}

// The film is made while the page listens, which takes about as long as the dance; whoever leaves cancels it.
function film(base, name) {
  const told = el("span", { role: "status", id: "film-told" }), asked = "film, teacher and you side by side";
  const button = el("button", { type: "button", id: "film", onclick: () => (making ? making.abort() : make()) }, asked);
  let making = null;
  return { nodes: [button, told], stop: () => making && making.abort() };

  async function make() {
    making = new AbortController();
    button.textContent = "cancel the film";
    try {
      await followed(`${base}/film`, making.signal, (fraction) => { told.textContent = ` making the film: ${Math.round(100 * fraction)} %`; });
      el("a", { href: `${base}.mp4`, download: name }).click();
      told.textContent = " the film is saved";
    } catch (error) {
      told.textContent = making.signal.aborted ? " the film was cancelled" : ` ${error.message}`;
    }
    making = null;
    button.textContent = asked;
  }
}

function historyTable(history, identity, name) {
  return el("div", { class: "scroll" }, el("table", { id: "history" }, el("tbody", {}, ...history.map((one) => el("tr", {},
    el("td", {}, one.session === name ? "this one" : el("a", { href: `#/dance/${identity}/try/${one.session}` }, when(one.session))),
    el("td", {}, one.total === null ? "–" : String(Math.round(one.total))), el("td", {}, `${Math.round(100 * one.speed)} %`),
    el("td", {}, one.source === "simulated" ? `simulated, ${one.skill}` : one.source))))));
}

const when = (name) => `${name.slice(0, 4)}-${name.slice(4, 6)}-${name.slice(6, 8)} ${name.slice(9, 11)}:${name.slice(11, 13)}`;
