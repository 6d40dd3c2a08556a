// All people before a camera: depth with skeletons, skeletons in 3D, and what is recorded.
import { View } from "./body.js";
import { Figure } from "./figure.js";
import { LearnerView } from "./learner.js";
import { Live } from "./live.js";
import { OF_LEARNERS, clock, el, keyOf, lettersSwitch, swatch, tell } from "./tools.js";

const COLOURS = [...OF_LEARNERS, "#228833", "#aa3377", "#4477aa"];
const PREPARING = "no image yet; where kernels are compiled first, which happens once, that takes up to a minute";
const TORSO = 8, PALEST = 0.2, FLOOR_DOWN = 0.2, FLOOR_UP = 0.003, FOLLOW = 0.03, SILENCE_MS = 2000, AGAIN_MS = 2000;
const TURNED = 0.15;

const main = document.getElementById("main");
const state = { camera: null, paused: false, ended: false, recording: false, keeping: false, text: "", lost: false, frame: null, at: 0 };
const ORDERS = {
  record: { is: "recording", key: "r", words: ["Record depth", "Stop recording"], told: "depth" },
  joints: { is: "keeping", key: "j", words: ["Record joints", "Save joints"], told: "joints" },
  pause: { is: "paused", key: " ", words: ["Pause", "Go on"] },
};
for (const [name, order] of Object.entries(ORDERS)) {
  order.button = el("button", { type: "button", id: name, onclick: ({ detail }) => {
    live.send({ do: name, on: !state[order.is] });
    if (detail) order.button.blur(); // after the mouse, space pauses; after the keyboard it presses the button again
  } });
}
const depth = el("canvas", { id: "depth", role: "img", "aria-label": "depth with every person's skeleton" });
const room = el("canvas", { id: "room", role: "img", "aria-label": "every person's skeleton in 3D; the left and right keys turn the view" });
const told = el("div", { class: "guide", id: "told", role: "status" });
const title = el("h1", {}, "kpopnet live"), numbers = el("p", { id: "numbers" });
const people = el("ul", { class: "list", id: "people" }), said = el("ul", { class: "list quiet", id: "said" });
main.append(title,
  el("div", { class: "controls" }, ...Object.values(ORDERS).map(({ button }) => button)),
  el("div", { class: "floor" },
    el("div", { class: "panel seen" }, depth, el("span", { class: "tag" }, "depth"), told),
    el("div", { class: "panel" }, room, el("span", { class: "tag" }, "3D"))),
  numbers, people, el("div", { role: "log" }, said),
  el("p", { class: "quiet" }, "Keys: r records depth, j joints, space pauses. Drag or use the left and right keys to turn the 3D view, scroll to zoom. ",
    "Pale limbs are uncertain; a percentage is the mean estimated probability that a joint is within 10 cm. ", lettersSwitch()));

const picture = new LearnerView(depth), view = new View(room), figures = new Map(), middle = { x: 0, z: 0, floor: null };
view.back(4.2);
const live = new Live({ opened, state: changed, frame, drawn, said: say, error: changed, lost });
live.connect();

document.addEventListener("keydown", (event) => {
  const typing = event.key === " " && event.target.closest("button, input");
  if (typing || event.ctrlKey || event.metaKey || event.altKey) return;
  const order = Object.values(ORDERS).find(({ key }) => key === keyOf(event));
  if (order && !event.repeat) order.button.click();
  else if (event.key === "ArrowLeft" || event.key === "ArrowRight") view.turn(event.key === "ArrowLeft" ? -TURNED : TURNED);
  else return;
  event.preventDefault();
});

function opened({ name, camera }) {
  title.textContent = name;
  document.title = `${name} – kpopnet live`;
  [state.lost, state.camera] = [false, camera];
}

function changed(found) {
  Object.assign(state, found, { at: performance.now() });
}

function frame(content, image) {
  const [fx, fy, cx, cy, width, height] = state.camera;
  for (const one of content.people) {
    one.places = one.joints.map(([x, y, z]) => (x === null ? null : [x, -y, -z]));
    one.colour = COLOURS[one.identity % COLOURS.length];
    one.metres = one.joints[TORSO][2];
    one.joints = one.joints.map(([x, y, z, sure]) =>
      (x === null ? [null, null, null, sure] : [(fx * x / z + cx + 0.5) / width, (fy * y / z + cy + 0.5) / height, z, sure]));
  }
  Object.assign(state, { frame: content, at: performance.now() });
  picture.show(image, content, false);
  place(content.people);
  const rate = content.fps === null ? "–" : content.fps.toFixed(1);
  state.told = `${rate} images a second · ${Math.round(content.delay_ms)} ms from image to joints · ${content.dropped} images left out`;
  people.replaceChildren(...content.people.map((one) => {
    const sure = one.joints.reduce((sum, joint) => sum + joint[3], 0) / one.joints.length;
    const away = one.metres === null ? "" : `, ${one.metres.toFixed(1)} m away`;
    return el("li", {}, swatch(one.colour), `person ${one.identity}: ${Math.round(100 * sure)} %${away}`);
  }));
}

function drawn(age_ms) {
  numbers.textContent = `${state.told} · drawn ${Math.round(age_ms)} ms after the image`;
}

// All people over the floor: in the middle of the view, which follows them slowly.
function place(seen) {
  const known = seen.flatMap(({ places }) => places.filter((one) => one));
  if (known.length) {
    const low = Math.min(...known.map(([, y]) => y)), mean = (axis) => known.reduce((sum, one) => sum + one[axis], 0) / known.length;
    if (middle.floor === null) Object.assign(middle, { x: mean(0), z: mean(2), floor: low });
    middle.floor += (low < middle.floor ? FLOOR_DOWN : FLOOR_UP) * (low - middle.floor);
    middle.x += FOLLOW * (mean(0) - middle.x);
    middle.z += FOLLOW * (mean(2) - middle.z);
    view.stage.position.set(-middle.x, -middle.floor, -middle.z);
  }
  for (const [identity, figure] of figures) {
    if (seen.some((one) => one.identity === identity)) continue;
    view.stage.remove(figure.group);
    figures.delete(identity);
  }
  for (const { identity, places, joints, colour } of seen) {
    if (!figures.has(identity)) {
      figures.set(identity, new Figure(() => colour));
      view.stage.add(figures.get(identity).group);
    }
    figures.get(identity).place(places, joints.map(([, , , sure]) => PALEST + (1 - PALEST) * sure));
  }
  view.changed = true;
}

function say({ text }) {
  said.append(el("li", {}, text));
}

function lost() {
  state.lost = true;
  setTimeout(() => live.connect(), AGAIN_MS);
}

function animate(now) {
  const { lost: gone, text, paused, ended, frame: last, at } = state;
  const waiting = !paused && !ended && now - at > SILENCE_MS;
  tell(told, gone ? "the program does not answer; is it still running?" : text || (paused ? "paused" : waiting ? PREPARING : ""));
  for (const { button, is, words, told: kept } of Object.values(ORDERS)) {
    const on = state[is], seconds = on && last && kept && last[kept] ? ` (${clock(last[kept].seconds)})` : "", label = words[Number(on)];
    // Seconds are no part of its name, or a screen reader would read each.
    if (button.textContent !== label + seconds) button.replaceChildren(label, el("span", { "aria-hidden": "true" }, seconds));
    button.className = on ? "main" : "";
    button.disabled = gone || ended;
  }
  live.draw();
  view.draw(0);
  requestAnimationFrame(animate);
}
requestAnimationFrame(animate);
