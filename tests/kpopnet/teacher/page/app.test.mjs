// Which view an address shows, with views that the test plays.
import assert from "node:assert/strict";
import { register } from "node:module";
import { beforeEach, test } from "node:test";
import { allOf } from "./dom.mjs";

const script = (text) => `data:text/javascript,${encodeURIComponent(text)}`;
const VIEWS = script(`const view = (kind) => (...given) => globalThis.view(kind, ...given);
export const [calibrate, menu, profilePage, record, result, stage] = ["calibrate", "menu", "me", "record", "result", "stage"].map(view);
export const inOrder = (dances) => dances, myself = async () => null;`);
register(script(`export const resolve = async (name, context, next) =>
  (/\\/(calibrate|menu|mine|record|result|stage)\\.js$/.test(name) ? { url: ${JSON.stringify(VIEWS)}, shortCircuit: true } : next(name, context));`));

const made = Object.fromEntries(["main", "language", "theme", "palette"].map((id) => [id, document.createElement("div")])), { main } = made;
const on = {}, settled = () => new Promise((go) => { setTimeout(go, 5); });
let shown = [], ended = [], kept;
HTMLCanvasElement.prototype.focus = function focus() { document.activeElement = this; }; // of every node
Object.assign(main, { querySelector: (selector) => allOf(main).find(({ tag }) => tag === selector) || null });
Object.assign(made.language, { before(node) { made.hands = node; } });
Object.assign(document, {
  getElementById: (id) => made[id] || document.createElement("p"), querySelectorAll: () => [], querySelector: () => document.createElement("a"), addEventListener() {},
});
Object.assign(globalThis, {
  location: { hash: "#/dance/a" }, addEventListener: (kind, listener) => { on[kind] = listener; },
  history: { state: null, replaceState(state) { this.state = state; }, pushState(_, __, url) { kept = url; } },
  view: async (kind, place, ...given) => {
    shown.push([kind, ...given.map(String)]);
    place.append(Object.assign(document.createElement("h1")));
    return () => ended.push(kind);
  },
});
const { view } = globalThis;
await import("../../../../kpopnet/teacher/page/app.js");

async function go(hash) {
  location.hash = hash;
  on.hashchange({ oldURL: "before" });
  await settled();
}

beforeEach(async () => {
  globalThis.view = view;
  await go("#/me");
  [shown, ended, kept] = [[], [], null];
});

test("an address shows its view, whose heading reading goes on at, and ends the one before", async () => {
  for (const hash of ["#/dance/a?speed=50", "#/record", "#/calibrate", "#/dance/a/try/t", "#/"]) await go(hash);
  assert.deepEqual(shown, [["stage", "a", "speed=50"], ["record"], ["calibrate"], ["result", "a", "t"], ["menu"]]);
  assert.deepEqual(ended, ["me", "stage", "record", "calibrate", "result"]);
  assert.equal(document.activeElement, main.querySelector("h1"));
});

test("a dance begins by itself when its address is opened, and not for who comes back to it", async () => {
  history.state = null;
  await go("#/dance/a?go&speed=50");
  await go("#/dance/a?go&speed=50"); // in whose state it stands that it has begun
  assert.deepEqual(shown, [["stage", "a", "go=&speed=50"], ["stage", "a", "speed=50"]]);
});

test("a view that arrives when another is shown is ended, and one that fails then is not told", async () => {
  const answers = [];
  globalThis.view = (kind) => new Promise((take, fail) => { answers.push([() => take(() => ended.push(kind)), () => fail(new Error("late"))]); });
  for (const hash of ["#/record", "#/calibrate", "#/"]) await go(hash);
  ended = [];
  answers[2][0]();
  answers[0][0]();
  answers[1][1]();
  await settled();
  assert.deepEqual([ended, allOf(main).filter(({ role }) => role === "alert")], [["record"], []]);
});

test("a view that would lose something may stay, at its address", async () => {
  let asked = 0;
  globalThis.view = async (kind) => Object.assign(() => ended.push(kind), { stays: () => asked++ === 0 });
  await go("#/record");
  ended = [];
  await go("#/");
  assert.deepEqual([ended, kept], [[], "before"]);
  await go("#/");
  assert.deepEqual(ended, ["record"]);
});

test("another palette is drawn at once, but not into what is busy, and the focus stays", async () => {
  await go("#/dance/a/try/t");
  document.activeElement = made.palette;
  made.palette.listeners.change();
  await settled();
  const { querySelector } = main;
  main.querySelector = () => main;
  made.palette.listeners.change();
  Object.assign(main, { querySelector });
  assert.deepEqual([shown, document.activeElement], [[["result", "a", "t"], ["result", "a", "t"]], made.palette]);
});

test("what goes wrong is told, with a way to the dances, which are asked for again where they are what went wrong", async () => {
  globalThis.view = async () => { throw new Error("it does not answer"); };
  await go("#/");
  const [told, link] = main.children;
  assert.deepEqual([told.role, told.textContent, document.activeElement], ["alert", "it does not answer", main]);
  globalThis.view = view;
  link.listeners.click();
  await settled();
  assert.deepEqual(shown, [["menu"]]);
});

test("beside a result a hand is offered the dance again, the next one and the menu, until it is left; it stays also without them", async () => {
  const fields = () => document.body.children[0].children[0].children, sent = [];
  globalThis.WebSocket = class {
    static OPEN = 1;

    readyState = 1;

    addEventListener() {}

    send(text) { sent.push(JSON.parse(text).do); }
  };
  globalThis.requestAnimationFrame = () => {};
  localStorage.setItem("teach.hands", "true");
  globalThis.view = async (kind, place) => {
    place.append(Object.assign(document.createElement("a"), { id: "again", hash: "#/dance/a?speed=50" }));
    return () => ended.push(kind);
  };
  const answers = { "/api/dances": ["a", "b"].map((identity) => ({ identity, seconds: 9 })), "/api/offer": { sources: { realsense: "" } } };
  globalThis.fetch = async (path) => Response.json(answers[path]);
  for (const [k, hash] of ["#/dance/a?speed=50&go", "#/dance/b", "#/"].entries()) {
    await go("#/dance/a/try/t");
    fields()[k].click();
    assert.equal(location.hash, hash);
  }
  await go("#/me");
  assert.deepEqual([sent.slice(-2), fields().length], [["prepare", "stop"], 0]);
  globalThis.fetch = async () => Response.json({ error: "no" }, { status: 500 });
  await go("#/dance/a/try/t");
  assert.deepEqual([fields().length, allOf(main).some(({ id }) => id === "again")], [0, true]);
  localStorage.setItem("teach.hands", "false");
});
