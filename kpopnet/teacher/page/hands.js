// Point and hold: a raised hand of the learner moves a cursor, and what it stays on for a moment is chosen. Nothing is chosen while
// no person is seen or while one dances: a view offers nothing then.
import { liveFor } from "./live.js";
import { Dwell, pointed } from "./pointing.js";
import { el, remember, remembered, tell } from "./tools.js";
import { say } from "./words.js";

const SHOWN_MS = 1500, STEADY_MS = 120;
const fields = el("div", { class: "fields" }), cursor = el("i", { class: "cursor", hidden: true });
const panel = el("div", { id: "hands", hidden: true }, fields, cursor), hint = el("p", { id: "hands-hint", role: "status", hidden: true });
const dwell = new Dwell();
let acts = [], offered = "", place = null, seen_ms = 0, shown_ms = -Infinity;

export const handsFree = () => remembered("hands", false);

// The switch in the header; `changed` is called after it.
export function handsSwitch(changed) {
  const box = el("input", { type: "checkbox", id: "hands-free", checked: handsFree(), onchange: () => {
    remember("hands", box.checked);
    if (!box.checked) panel.hidden = hint.hidden = true;
    changed();
  } });
  document.body.append(panel, hint);
  // Of what is in full screen nothing outside is drawn.
  document.addEventListener("fullscreenchange", () => (document.fullscreenElement || document.body).append(panel, hint));
  return el("label", {}, box, say("point and hold"));
}

// What can be chosen by hand from now on: id, text and what happens, and a picture if there is one.
export function letChoose(targets) {
  acts = targets.map(({ act }) => act); // of the newest, also where they look as before
  const key = targets.map(({ id, text }) => `${id} ${text}`).join();
  if (key === offered) return;
  offered = key;
  fields.replaceChildren(...targets.map(({ id, text, picture }, k) =>
    el("button", { type: "button", class: "field", "data-target": id, onclick: () => acts[k]() }, picture || null, text)));
  dwell.renew();
  if (!targets.length) panel.hidden = hint.hidden = true;
}

// Follows the joints of an image of the learner, who sees themselves mirrored or not.
export function follow(joints, mirrored, now_ms) {
  if (!handsFree() || !offered) return;
  const at = joints && pointed(joints, mirrored, place?.hand), keep = Math.exp(-(now_ms - seen_ms) / STEADY_MS);
  seen_ms = now_ms;
  tell(hint, say("raise a hand to choose"));
  hint.hidden = !joints || Boolean(at);
  if (at) shown_ms = now_ms;
  panel.hidden = !joints || now_ms - shown_ms > SHOWN_MS;
  place = at && (place?.hand === at.hand ? { ...at, x: at.x + keep * (place.x - at.x), y: at.y + keep * (place.y - at.y) } : at);
  cursor.hidden = !place;
  const over = place && !panel.hidden ? fieldAt(place.x * document.documentElement.clientWidth, place.y * document.documentElement.clientHeight) : null;
  const chosen = dwell.see(over, now_ms);
  for (const field of fields.children) field.classList.toggle("over", field === over);
  if (place) {
    [cursor.style.left, cursor.style.top] = [`${100 * place.x}%`, `${100 * place.y}%`];
    cursor.style.setProperty("--held", `${360 * dwell.progress}deg`);
  }
  if (chosen) chosen.click();
}

// Where no images come no person points: nothing is offered until they do, and `text` says what is the matter.
export function rest(text) {
  follow(null, true, performance.now());
  panel.hidden = true;
  hint.textContent = text;
  hint.hidden = !text;
}

function fieldAt(x, y) {
  return [...fields.children].find((field) => {
    const { left, right, top, bottom } = field.getBoundingClientRect();
    return x >= left && x <= right && y >= top && y <= bottom;
  }) || null;
}

// A lesson in which nothing is danced, for the sake of its joints alone.
export const watching = (dance, source) => ({ do: "prepare", lesson: { dance: dance.identity, source, to_s: Math.min(5, dance.seconds), calibrate: true } });

// Watches the learner in a view without a lesson of its own; returns what ends it.
export function watch(dance, source) {
  if (!handsFree() || !dance) return () => {};
  const told = ({ text }) => rest(say(text));
  const failed = (message) => {
    live.send({ do: "stop" }); // a webcam would go on sending pictures, and each would be refused in other words
    told(message);
  };
  const live = liveFor({ frame: ({ joints }) => follow(joints, true, performance.now()), away: told, error: failed,
    lost: () => rest(say("the teacher's program does not answer; is it still running?")) });
  live.send(watching(dance, source));
  let ended = false;
  const draw = () => {
    if (ended) return;
    live.draw();
    requestAnimationFrame(draw);
  };
  draw();
  return () => {
    ended = true;
    live.leave();
  };
}

// The dance after one of a list, as it is shown.
export const after = (dances, identity) => {
  const whole = dances.filter(({ broken }) => !broken);
  return whole[(whole.findIndex((one) => one.identity === identity) + 1) % whole.length];
};
export const chosenSource = (sources) => (remembered("source", "") in sources ? remembered("source", "") : Object.keys(sources)[0]);

// The sources that see who sits before the page, and so can record a dance of one's own.
export const recordable = (sources) => Object.fromEntries(Object.entries(sources).filter(([key]) => !["simulated", "recording"].includes(key)));
