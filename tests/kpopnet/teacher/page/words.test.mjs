// What the page says in the language that was asked for.
import assert from "node:assert/strict";
import { test } from "node:test";
import { allOf } from "./dom.mjs";

const stored = {};
globalThis.localStorage = { getItem: (name) => stored[name] ?? null, setItem: (name, value) => { stored[name] = value; } };
globalThis.location = { search: "?lang=de" };
const PAGE = "../../../../kpopnet/teacher/page/";
const { language, say } = await import(`${PAGE}words.js`);
const { furtherOf, when } = await import(`${PAGE}result.js`);
const { controls } = await import(`${PAGE}panels.js`);

test("the address chooses the language, which is remembered", () => {
  assert.equal(language, "de");
  assert.equal(stored["teach.language"], '"de"');
});

test("the address chooses the language also where the browser stores nothing", async () => {
  const { localStorage } = globalThis;
  globalThis.localStorage = null;
  const { language: chosen } = await import(`${PAGE}words.js?nothing-stored`);
  globalThis.localStorage = localStorage;
  assert.equal(chosen, "de");
});

test("a page speaks its own language, and otherwise the first of the browser's that it knows", async () => {
  const { location, localStorage } = globalThis, { dataset } = document.documentElement;
  Object.assign(globalThis, { location: { search: "" }, localStorage: null });
  Object.defineProperty(globalThis, "navigator", { value: { languages: ["fr-FR", "ko-KR", "de"] }, configurable: true });
  for (const [own, spoken] of [[undefined, "ko"], ["en", "en"]]) {
    dataset.language = own;
    const { language: chosen } = await import(`${PAGE}words.js?of-${own}`);
    assert.deepEqual([chosen, document.documentElement.lang], [spoken, spoken]);
  }
  delete dataset.language;
  Object.assign(globalThis, { location, localStorage });
});

test("a text is said by its English words, with what fills its gaps", () => {
  assert.equal(say("Begin now"), "Jetzt beginnen");
  assert.equal(say("{total} of 100", { total: 81 }), "81 von 100");
  assert.equal(say("verdict|good"), "gut");
  assert.equal(say("late in {name}.js"), "late in {name}.js"); // no text of ours
});

test("a value that is missing is a dash, and a text that names a part of every object is a text", () => {
  assert.equal(say({ say: "this try could not be saved: {reason}", reason: null }), "dieser Versuch konnte nicht gespeichert werden: –");
  assert.deepEqual([null, undefined, "constructor", "{toString}"].map((one) => say(one)), ["–", "–", "constructor", "{toString}"]);
});

test("what the server sends is said whole, with decimal commas in numbers alone", () => {
  const late = { say: "{amount} {word}", amount: { say: "{seconds} s", seconds: "0.2" }, word: { say: "late" } };
  assert.equal(say({ say: "{what} {when}", what: late, when: { say: "at {times} and {last}", times: ["0:01", "0:05"], last: "0:12" } }),
    "0,2 s zu spät bei 0:01, 0:05 und 0:12");
  assert.equal(say({ say: "the recording {name}", name: "take.2.npz" }), "die Aufnahme take.2.npz");
  assert.equal(say("{what} {figure}", { what: say("place"), figure: 0.5 }), "Position 0,5");
});

test("a name that is written from right to left does not turn the numbers beside it", () => {
  assert.equal(say("Last: {name}, {total} of 100.", { name: "مرحبا 2", total: 97 }), "Zuletzt: \u2068مرحبا 2\u2069, 97 von 100.");
});

test("a language whose code only begins like a known one is another", async () => {
  const { location, localStorage } = globalThis;
  Object.assign(globalThis, { location: { search: "" }, localStorage: null });
  Object.defineProperty(globalThis, "navigator", { value: { languages: ["kok-IN", "de-AT"] }, configurable: true });
  const { language: chosen } = await import(`${PAGE}words.js?konkani`);
  Object.assign(globalThis, { location, localStorage });
  assert.equal(chosen, "de");
});

test("a date in Korean has no English in it", async () => {
  globalThis.location = { search: "?lang=ko" };
  const { dated } = await import(`${PAGE}words.js?korean`);
  globalThis.location = { search: "?lang=de" };
  assert.equal(dated(Date.UTC(2026, 11, 3, 0, 11)), "2026. 12. 3. 00:11");
});

test("dates, weights and percentages are written as the language writes them", () => {
  assert.equal(when("20261203-091100-123"), "03.12.2026, 09:11");
  assert.equal(furtherOf({ weights: { similarity: 3, place: 0.5 }, counted: { similarity: 81.4, place: 60 } })[0].textContent,
    "Die Gesamtwertung nach Gewicht: Übereinstimmung 81 (× 3), Position 60 (× 0,5).");
  const offer = { sources: { simulated: "a simulated learner" }, skills: ["good"], faults: [""] };
  const { speed } = controls({ others: [], phrase_s: 4, seconds: 8 }, offer, new URLSearchParams());
  assert.equal(allOf(speed)[0].textContent, "25 %");
});
