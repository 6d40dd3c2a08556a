// The menu: all dances with moving thumbnails, search, order, and one's own dances.
import { chosenSource, letChoose, recordable, watch } from "./hands.js";
import { greeting, myself } from "./mine.js";
import { sketch } from "./sketch.js";
import { ask, clock, el, remember, remembered } from "./tools.js";
import { say } from "./words.js";

const FILES = ".bvh,.npz,.glb,.vmd,.csv,.json,.c3d,.trc,.gltf,.vrm,.vrma";
const ORDERS = {
  name: (a, b) => a.name.localeCompare(b.name),
  difficulty: (a, b) => a.difficulty - b.difficulty,
  tempo: (a, b) => a.bpm - b.bpm,
  length: (a, b) => a.seconds - b.seconds,
};

const AT_ONCE = 4; // dances that can be chosen by hand

// Dances in the order of the menu, one's own first; damaged ones last.
export function inOrder(dances, order = remembered("order", "name")) {
  return dances.toSorted((a, b) => Boolean(a.broken) - Boolean(b.broken) || Number(b.own) - Number(a.own) || ORDERS[order](a, b));
}

export async function menu(main) {
  const [dances, told_of, offer] = await Promise.all([ask("/api/dances"), myself(), ask("/api/offer")]);
  if (!main.isConnected) return () => {}; // the page shows another view by now, which has the connection
  const search = el("input", { type: "search", id: "search", placeholder: say("search"), oninput: show });
  const level = el("select", { id: "level", "aria-label": say("difficulty"), onchange: show }, el("option", { value: "" }, say("any difficulty")));
  for (let one = 1; one <= 5; one++) level.append(inStars("option", one));
  const order = el("select", { id: "order", "aria-label": say("order"), onchange: () => { remember("order", order.value); show(); } });
  for (const name of Object.keys(ORDERS)) order.append(el("option", { value: name }, say(`by ${name}`)));
  order.value = remembered("order", "name");
  const told = el("p", { class: "quiet", role: "status" });
  const cards = el("div", { class: "cards", id: "cards" });
  const thumbs = thumbnails();
  const file = el("input", { type: "file", accept: FILES, onchange: () => {
    const [chosen] = file.files;
    file.value = ""; // so that the same file may be chosen again, mended
    add(chosen);
  } });
  main.append(
    ...greeting(told_of), el("h1", {}, say("Choose a dance")),
    el("div", { class: "controls" }, el("label", {}, say("Search"), search), level, order,
      el("label", {}, say("Add your own ({endings} ...)", { endings: FILES.split(",").slice(0, 4) }), file),
      Object.keys(recordable(offer.sources)).length ? el("a", { class: "button", id: "dance-it", href: "#/record" }, say("Dance it yourself")) : null),
    told, cards,
  );
  let first = 0;
  show();
  const unwatch = watch(dances.find((one) => !one.broken), chosenSource(offer.sources));
  return () => {
    unwatch();
    thumbs.stop();
  };

  function show() {
    const plain = (text) => text.normalize("NFC").toLowerCase(), words = plain(search.value).split(/\s+/); // macOS names files in NFD
    const found = inOrder(dances.filter((one) => words.every((word) => plain(one.name).includes(word))
      && (!level.value || one.difficulty === Number(level.value))), order.value);
    first = 0;
    choose(found.filter((one) => !one.broken));
    told.textContent = say("{count} of {all} dances", { count: found.length, all: dances.length });
    cards.replaceChildren(...found.map((one) => {
      if (one.broken) {
        return el("p", { class: "card", "data-dance": one.identity }, el("b", {}, one.name), el("small", {}, say("damaged: {reason}", { reason: one.broken })));
      }
      const canvas = el("canvas", { width: 160, height: 120, "aria-hidden": "true" });
      thumbs.watch(canvas, one.identity);
      return el("a", { class: "card", href: `#/dance/${one.identity}`, "data-dance": one.identity }, canvas,
        el("b", {}, one.name),
        inStars("small", one.difficulty),
        el("small", {}, `${clock(one.seconds)} · ${say("{count} bpm", { count: Math.round(one.bpm) })}${one.own ? ` · ${say("yours")}` : ""}`));
    }));
  }

  // A few dances at a time for a hand that points.
  function choose(found) {
    const targets = found.slice(first, first + AT_ONCE).map(({ identity, name }) => {
      const picture = el("canvas", { width: 160, height: 120, "aria-hidden": "true" });
      thumbs.watch(picture, identity);
      return { id: identity, text: name, picture, act: () => { location.hash = `#/dance/${identity}`; } };
    });
    const more = { id: "more", text: say("More dances"), act: () => { first = first + AT_ONCE < found.length ? first + AT_ONCE : 0; choose(found); } };
    letChoose(found.length > AT_ONCE ? [...targets, more] : targets);
  }

  async function add(chosen) {
    if (!chosen) return;
    told.textContent = say("adding {name} …", { name: chosen.name });
    try {
      const title = chosen.name.replace(/\.[^.]*$/, "") || say("My dance");
      const query = new URLSearchParams({ file: chosen.name, title });
      const { identity } = await ask(`/api/dances?${query}`, { method: "POST", body: chosen });
      if (told.isConnected) location.hash = `#/dance/${identity}`;
    } catch (error) {
      told.textContent = error.message;
    }
  }
}

// A difficulty in circles, which are read as words.
export const inStars = (tag, level) => el(tag, { ...(tag === "option" ? { value: level } : { role: "img" }), "aria-label": say("difficulty {level} of 5", { level }) },
  "●".repeat(level) + "○".repeat(5 - level));

// Draws the dances whose cards are in view, ten times a second.
function thumbnails() {
  const seen = new Map();
  const observer = new IntersectionObserver((entries) => {
    for (const { target, isIntersecting } of entries) {
      if (!isIntersecting) seen.delete(target);
      else if (!seen.has(target)) {
        seen.set(target, null);
        ask(`/api/dances/${target.dataset.dance}/preview`).then((frames) => { if (seen.has(target)) seen.set(target, frames); }, () => {});
      }
    }
  });
  const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
  let tick = 0;
  const timer = setInterval(() => {
    tick += still ? 0 : 1;
    const ink = getComputedStyle(document.body).color;
    for (const [canvas, frames] of seen) if (frames) draw(canvas, frames[tick % frames.length], ink);
  }, 100);
  return {
    watch(canvas, dance) {
      canvas.dataset.dance = dance;
      observer.observe(canvas);
    },
    stop() {
      clearInterval(timer);
      observer.disconnect();
    },
  };
}

function draw(canvas, points, ink) {
  const pen = canvas.getContext("2d");
  pen.clearRect(0, 0, 160, 120);
  sketch(pen, points, { x: 80, y: 62, scale: 0.52, ink, mirrored: true });
}
