// What the views build, without a browser.
import assert from "node:assert/strict";
import { test } from "node:test";
import "./dom.mjs";

const PAGE = "../../../../kpopnet/teacher/page/";
const { controls } = await import(`${PAGE}panels.js`);

const OFFER = { sources: { simulated: "a simulated learner" }, skills: ["good"], faults: [""] };
const wanting = (dance, query) => controls({ others: [], ...dance }, OFFER, new URLSearchParams(query));

test("a last phrase that is cut short can be chosen, and is what a link asks for", () => {
  const asked = (seconds) => wanting({ phrase_s: 4, seconds }, "phrase=2&practise=80&go").phrase;
  assert.deepEqual(asked(10.6).options.map(({ value }) => value), ["", 0, 1, 2]);
  assert.equal(asked(10.6).value, "2");
  assert.deepEqual(asked(10.4).options.map(({ value }) => value), ["", 0, 1]); // 2.4 s are too short
  assert.deepEqual(wanting({ phrase_s: 24, seconds: 5 }, "").phrase.options.map(({ value }) => value), ["", 0]);
});

test("dancers are counted from the left of who faces the screen, with the mirror and without it", () => {
  const { dancer, mirrored } = wanting({ phrase_s: 4, seconds: 8, others: [{}, {}] }, ""), told = () => dancer.options.map(({ textContent }) => textContent[0]).join("");
  assert.equal(told(), "123");
  mirrored.checked = false;
  mirrored.listeners.change();
  assert.equal(told(), "321");
});
