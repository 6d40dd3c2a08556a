// Small things that every view needs: elements, requests, packed arrays, settings.
import { remember, remembered } from "./memory.js";
import { say } from "./words.js";

export { remember, remembered };

export function el(tag, properties = {}, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
    else if (name === "class") node.className = value;
    else if (name in node && name !== "list") node[name] = value;
    else node.setAttribute(name, value);
  }
  node.append(...children.filter((child) => child !== null && child !== undefined));
  return node;
}

// Writes what may be written many times a second: a screen reader would read the same words as often.
export function tell(node, text) {
  if (node.textContent !== text) node.textContent = text;
}

function unanswered() {
  throw new Error(say("the teacher's program does not answer; is it still running?"));
}

// The server's answer; throws what a refusal says, as JSON or in plain text.
async function answered(path, options) {
  const response = await fetch(path, options).catch(unanswered);
  if (response.ok) return response;
  const type = response.headers.get("content-type") || "", text = type.includes("json") ? (await response.json()).error : (await response.text()).trim();
  throw new Error(say(text || response.statusText));
}

export async function ask(path, options = {}) {
  return (await answered(path, options)).json();
}

// Follows work on the server, which tells line by line how much of it is done, from 0 to 1, or what went wrong.
export async function followed(path, signal, show) {
  const response = await answered(path, { method: "POST", signal }), reader = response.body.getReader(), letters = new TextDecoder();
  const next = () => reader.read().catch((error) => { if (signal.aborted) throw error; unanswered(); });
  let text = "", done = 0;
  for (let part = await next(); !part.done; part = await next()) {
    text += letters.decode(part.value, { stream: true });
    const lines = text.split("\n");
    text = lines.pop();
    for (const { fraction, error } of lines.map((line) => JSON.parse(line))) {
      if (error) throw new Error(say(error));
      show(done = fraction);
    }
  }
  if (done < 1) unanswered();
}

export function unpacked(text, Kind) {
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  return new Kind(bytes.buffer);
}

export function clock(seconds) {
  const whole = Math.round(seconds), sizes = Math.abs(whole);
  return `${whole < 0 ? "-" : ""}${Math.floor(sizes / 60)}:${String(sizes % 60).padStart(2, "0")}`;
}

export function clamp(value, low, high) {
  return Math.min(Math.max(value, low), high);
}

// The key of an event. Of a letter the small one, with Caps Lock too, and where the layout has another script the one that stands
// there on a keyboard of Latin letters; none where letters are switched off.
export function keyOf({ key, code = "" }) {
  const found = /^Key[A-Z]$/.test(code) && !/^[a-z]$/i.test(key) ? code[3] : key; // an input method says "Process" for every key
  if (found.length !== 1) return found;
  return found === " " || remembered("letters", true) ? found.toLowerCase() : "";
}

// Switches shortcuts of one letter off: who speaks to the machine, or presses keys by accident, would start them with every word.
export function lettersSwitch() {
  const box = el("input", { type: "checkbox", id: "letters", checked: remembered("letters", true), onchange: () => remember("letters", box.checked) });
  return el("label", {}, box, " ", say("letters are shortcuts"));
}

// The latency of a set-up, by its source of depth, in seconds; null where none was measured.
export const latencyOf = (source) => remembered(`latency.${source}`, null);
export const keepLatency = (source, latency_s) => remember(`latency.${source}`, latency_s === null ? null : clamp(latency_s, -1, 1));
export const milliseconds = (seconds) => `${Math.round(1000 * seconds)} ms`;

export const PARTS = ["left arm", "right arm", "left leg", "right leg", "torso", "turning"];

const orangeToBlue = () => remembered("palette", "brightness") === "safe";

// From orange, 0, to blue, 100, which are not mixed up.
export function heat(similarity) {
  const part = clamp(similarity / 100, 0, 1), from = [230, 97, 0], to = [64, 150, 255];
  return `rgb(${from.map((value, i) => Math.round(value + part * (to[i] - value))).join(" ")})`;
}

// Of learners beside each other, from Paul Tol's bright colours, which people who mix up colours tell apart.
export const OF_LEARNERS = ["#66ccee", "#ee6677", "#ccbb44"];

export function swatch(colour) {
  const shown = el("i", { class: "swatch" });
  shown.style.background = colour;
  return shown;
}

// The colour of a similarity from 0 to 100: brightness as in the paper, or orange to blue, which are not mixed up.
export function shade(similarity) {
  if (similarity === undefined || similarity === null) return "#8a8694";
  const part = clamp(similarity / 100, 0, 1);
  if (orangeToBlue()) return heat(similarity);
  const level = Math.round(60 + 195 * part);
  return `rgb(${level} ${level} ${Math.round(level * 0.92)})`;
}

export function partBars() {
  const rows = new Map();
  const list = el("ul", { class: "parts", "aria-label": say("parts of the body") });
  for (const part of PARTS) {
    const bar = el("i"), number = el("span");
    rows.set(part, { bar, number });
    list.append(el("li", { "data-part": part }, `${say(part)} `, number, el("div", { class: "track" }, bar)));
  }
  const show = (parts, coverage = {}) => {
    for (const [part, { bar, number }] of rows) {
      const value = parts[part];
      const known = value !== undefined && value !== null;
      bar.style.width = known ? `${value}%` : "0";
      bar.style.background = orangeToBlue() ? heat(value) : ""; // bright as in the picture, it would vanish on a light page
      number.textContent = known ? `${Math.round(value)}${coverage[part] < 0.99 ? say(", seen {percent} %", { percent: Math.round(100 * coverage[part]) }) : ""}` : "";
      bar.closest("li").dataset.value = known ? value : "";
    }
  };
  return { list, show };
}
