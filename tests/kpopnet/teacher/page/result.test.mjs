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

async function opened(more = {}, history = []) {
  globalThis.fetch = async (path, how) => {
    asked = how;
    return Response.json(path.endsWith("/movement") ? "the learner's" : path.startsWith("/api/tries") ? { ...FOUND, ...more } : path.startsWith("/api/dances") ? GROUP
      : path === "/api/history/own_001?who=p_1" ? history : []);
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
  assert.equal(document.activeElement.role, "status"); // the button is disabled now, and would lose the place
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

const texts = (found) => allOf(main).filter(found).map(({ textContent }) => textContent);

test("a result tells how sure it is, of what excerpt it is, what was the matter, and of figures that are not known that they are not", async () => {
  await opened({ uncertainty: 3.4, timing: null, hints: ["your feet were hidden"], total: 71.6, faults: ["left arm late"],
    parts: { "left arm": 80 }, coverage: { "left arm": 0.5 }, stage: { place: 80.4 }, free: { place: 69.6 },
    members: [{ total: 60 }], formation: { why_not: "the group has no formation" } });
  assert.deepEqual(texts(({ tag }) => ["h1", "small"].includes(tag)), ["Duet: 72 ± 3 of 100", " 0:04 – 0:18"]);
  assert.deepEqual(["total", "timing", "speed"].map((id) => get(`result-${id}`).children[0].textContent), ["72", "–", "50"]);
  assert.ok(texts(({ className }) => className === "error").includes("your feet were hidden"));
  assert.ok(texts(({ tag }) => tag === "span").includes("80, seen 50 %"));
  const kept = ["on-stage", "in-free-parts", "formation"].map((id) => get(id).textContent.match(/\w+ \d+|the group .*/)[0]);
  assert.deepEqual([kept, texts(({ tag }) => tag === "li").includes("left arm late")], [["place 80", "place 70", "the group has no formation"], true]);
  leave();
});

test("a click on the course replays what is there, a mark goes with it, and the slider stops it", async () => {
  await opened();
  draw(now_ms);
  const view = views.at(-1), course = get("course"), mark = () => Math.round(course.children.find((one) => one.class === "now").x1);
  course.getBoundingClientRect = () => ({ left: 100, width: 200 });
  course.listeners.click({ clientX: 200 }); // the second 11, of 4 to 18
  passes(1);
  assert.ok(Math.abs(view.time_s - 10.6) < 0.05 && mark() === Math.round(1000 * (view.time_s - 4) / 14), `${view.time_s} ${mark()}`);
  Object.assign(get("scrub"), { value: "6" }).listeners.input();
  passes(1);
  assert.deepEqual([view.time_s, get("play").textContent], [6, "Play"]);
  leave();
});

test("of each phrase it is said what to mend, what was not seen, or why nothing is said", async () => {
  const moved = [{ text: "left arm too low" }];
  await opened({ phrases: [phrase(4, 92), phrase(8, 89), phrase(12, null), { ...phrase(16, 50), unseen: ["legs not seen"], moments: moved }] });
  const told = allOf(main).filter(({ tag }) => tag === "tr").slice(1).map(({ children: [, score, words] }) => [score.textContent, words?.children[0]?.textContent]);
  assert.deepEqual(told.slice(0, 4), [["92", "no fault stands out"], ["89", "differences throughout, of which none stands out"], ["–", "not compared"], ["50", "legs not seen; left arm too low"]]);
  leave();
});

test("the table of tries has each one's day, score, excerpt, speed and camera, and this one among them", async () => {
  const tries = [{ session: "20260303-101010-000", total: 71.4, from_s: 4, to_s: 18, speed: 0.5, source: "webcam" },
    { session: "20260301-090000-000", total: null, from_s: 0, to_s: 0, speed: 1, source: "simulated", skill: "good" }];
  await opened({ who: "p_1" }, tries);
  const cells = allOf(get("history")).filter(({ tag }) => tag === "td"), link = cells[5].children[0];
  assert.deepEqual(cells.map(({ textContent }) => textContent), ["this one", "71", "0:04 – 0:18", "50 %", "webcam", "", "–", "0:00 – 0:18", "100 %", "simulated, good"]);
  assert.deepEqual([link.textContent, link.href], ["1 Mar 2026, 09:00", "#/dance/own_001/try/20260301-090000-000"]);
  leave();
});

test("a film is told of while it is made, with no word for each percent to a screen reader, saved in the end, and can be cancelled", async () => {
  await opened();
  let film;
  const saved = [], settled = () => new Promise((go) => { setTimeout(go, 5); }), told = () => [get("film-told").textContent.trim(), get("film-told").ariaLive, get("film").textContent];
  const tell = (fraction) => film.enqueue(new TextEncoder().encode(`{"fraction": ${fraction}}\n`));
  mock.method(HTMLCanvasElement.prototype, "click", function click() { saved.push(this.href); }); // of every node
  globalThis.fetch = async (_, { signal }) => new Response(new ReadableStream({ start(stream) {
    film = stream;
    signal.addEventListener("abort", () => stream.error(new Error("aborted")));
  } }));
  const [asked] = told().slice(-1);
  get("film").listeners.click();
  await settled();
  tell(0.25);
  await settled();
  assert.deepEqual(told(), ["making the film: 25 %", "off", "cancel the film"]);
  tell(1);
  film.close();
  await settled();
  assert.deepEqual([told(), saved], [["the film is saved", "polite", asked], ["/api/tries/own_001/20260303-101010-000.mp4"]]);
  for (let press = 0; press < 2; press++) {
    get("film").listeners.click();
    await settled();
  }
  assert.deepEqual([told(), saved.length], [["the film was cancelled", "polite", asked], 1]);
  leave();
});
