// A result as the page holds it, without pictures in 3D.
import assert from "node:assert/strict";
import { beforeEach, mock, test } from "node:test";
import { allOf } from "./dom.mjs";
import "./without_3d.mjs";

const PAGE = "../../../../kpopnet/teacher/page/";
const { result } = await import(`${PAGE}result.js`), { views } = await import(`${PAGE}body.js`), { latencyOf } = await import(`${PAGE}tools.js`);
let draw, now_ms, get, main, leave, asked;
globalThis.requestAnimationFrame = (call) => { draw = call; };

const GROUP = { name: "Duet", seconds: 18, bpm: 120, phrase_s: 4, others: [{ name: "the second" }] };
const phrase = (start_s, total) => ({ start_s, end_s: Math.min(start_s + 4, 18), total, moments: [] });
const FOUND = {
  name: "Duet", total: 71, timing: 80, posture: 60, speed: 0.5, from_s: 4, to_s: 18, source: "realsense", skill: "good", fault: "", mirrored: false, dancer: 1,
  parts: {}, coverage: {}, hints: [], faults: [], worst: [[8, 9], [17, 18]].map(([start_s, end_s]) => ({ start_s, end_s, part: "left arm", text: "late" })),
  phrases: [phrase(4, 85), phrase(8, 30), phrase(12, null), phrase(16, 20)], latency_s: 0.1, taken_off_s: 0.05,
  course: { time_s: [4, 11, 18], total: [0, 100, null], delay_s: [0.5, -0.25, null], parts: { "left arm": [0, 100, null] } },
};

beforeEach(() => {
  mock.restoreAll();
  now_ms = 1000;
  mock.method(performance, "now", () => now_ms);
  localStorage.setItem("teach.latency.realsense", "null");
});

async function opened(more = {}) {
  globalThis.fetch = async (path, how) => {
    asked = how;
    return Response.json(path.endsWith("/movement") ? "the learner's" : path.startsWith("/api/tries") ? { ...FOUND, ...more } : path.startsWith("/api/dances") ? GROUP : []);
  };
  main = document.createElement("main");
  leave = await result(main, "own_001", "20260303-101010-000");
  get = (id) => allOf(main).find((one) => one.id === id);
}

const hrefs = (kind) => allOf(main).filter((one) => one.className === kind).map(({ href }) => href);
const lines = () => allOf(main).filter((one) => one.class === "line").map(({ d }) => d);

// Draws for some seconds, 50 images a second.
function passes(seconds) {
  for (let image = 0; image < 50 * seconds; image++) draw(now_ms += 20);
}

test("the learner is replayed beside the dancer who was danced, and nothing goes on when one leaves", async () => {
  await opened();
  const view = views.at(-1);
  assert.deepEqual(view.dancers.map(({ movement }) => movement.name || movement), ["the second", "the learner's"]);
  get("film").listeners.click();
  assert.ok(!view.closed && !asked.signal.aborted);
  leave();
  assert.ok(view.closed && asked.signal.aborted);
});

test("a moment is replayed with a second before and after, slowed, and the whole from its begin again", async () => {
  await opened();
  draw(now_ms);
  const view = views.at(-1), ends = (at_s) => assert.ok(Math.abs(view.time_s - at_s) < 0.05 && get("play").textContent === "Play", `${view.time_s}`);
  const moments = allOf(main).filter((one) => one.tag === "button" && one["data-part"]);
  moments[1].listeners.click();
  passes(5);
  ends(18);
  moments[0].listeners.click();
  passes(1);
  assert.ok(Math.abs(view.time_s - 7.6) < 0.05 && get("play").textContent === "Pause");
  passes(9);
  ends(10);
  get("play").listeners.click(); // goes on to the end
  passes(20);
  ends(18);
  get("play").listeners.click();
  passes(1);
  assert.ok(Math.abs(view.time_s - 4.6) < 0.05);
  leave();
});

test("of an excerpt its phrases can be practised as they were danced, but for unseen and short ones; the worst is offered first", async () => {
  await opened();
  const danced = "skill=good&fault=&dancer=1&mirrored=0", practise = (number) => `#/dance/own_001?phrase=${number}&practise=80&go&${danced}`;
  assert.deepEqual(hrefs("practise"), [practise(1), practise(2)]);
  assert.deepEqual([get("practise-worst").href, get("again").href], [practise(2), `#/dance/own_001?phrase=1&speed=50&${danced}`]);
  leave();
  await opened({ from_s: 0, to_s: 0, phrases: [phrase(0, 80)] });
  assert.deepEqual([get("practise-worst"), get("again").href], [undefined, `#/dance/own_001?speed=50&${danced}`]); // it reached the goal
  leave();
});

test("a course goes from left to right over what was danced, better scores and later moves above", async () => {
  await opened();
  assert.deepEqual(lines().map((d) => d.replace(/\d+\.\d+/g, (one) => Number(one).toFixed(2))), ["M0,145L500,5", "M0,3.75L500,110.63"]);
  leave();
});

test("who was on time and late all the same takes that off beside what is taken off", async () => {
  await opened();
  get("calibrate").listeners.click();
  assert.ok(Math.abs(latencyOf("realsense") - 0.15) < 1e-9);
  leave();
  for (const latency_s of [null, 0.02]) {
    await opened({ latency_s });
    assert.equal(get("calibrate"), undefined);
    leave();
  }
});

test("of learners beside each other it is said who was after the first, and who before", async () => {
  await opened({ members: [{ total: 60, session: "20260303-101010-001" }, { total: null }], together: { similarity: 70, timing: 80, posture: 60, after_s: [0, 0.2, -0.1] } });
  const rows = allOf(main).filter(({ tag, textContent }) => tag === "li" && textContent.includes("the first")).map(({ textContent }) => textContent);
  assert.deepEqual(rows.map((text) => text.match(/\d\.\d+ s \w+/)[0]), ["0.20 s after", "0.10 s before"]);
  leave();
});

test("the table of one's tries says what its columns are", async () => {
  await opened();
  const columns = allOf(get("history")).filter((one) => one.tag === "th").map(({ textContent }) => textContent);
  assert.deepEqual(columns, ["danced on", "score", "excerpt", "speed", "camera"]);
});
