// The loop of a lesson: praise, stars and streaks; who is in place; the lane; practising a phrase.
import assert from "node:assert/strict";
import { test } from "node:test";
import { laneX } from "../../../../kpopnet/teacher/page/lane.js";
import { Practice, weekPlan, worstPhrase } from "../../../../kpopnet/teacher/page/practice.js";
import { HandsHeld, InPlace, praise, starsOf, streakAfter } from "../../../../kpopnet/teacher/page/verdicts.js";

const RAISED = Object.assign(Array.from({ length: 15 }, () => [0.5, 0.5, 2, 1]),
  { 0: [0.5, 0.2, 2, 1], 1: [0.5, 0.3, 2, 1], 6: [0.48, 0.1, 2, 1], 7: [0.52, 0.1, 2, 1] });

test("better scores earn more, and who is not seen ends a streak", () => {
  assert.deepEqual([null, 0, 30, 55, 75, 90].map(praise), ["not seen", "watch the teacher", "keep going", "good", "great", "perfect"]);
  assert.deepEqual([null, 29, 65, 100].map(starsOf), ["☆☆☆☆☆", "☆☆☆☆☆", "★★★☆☆", "★★★★★"]);
  assert.deepEqual([80, 75, 74, 99, null].reduce((all, one) => [...all, streakAfter(all.at(-1), one)], [0]), [0, 1, 2, 0, 1, 0]);
});

test("stars and praise change at their bounds, and the plan of a week is of four weeks, with tries of tomorrow's clock", () => {
  assert.deepEqual([49, 50, 64, 65, 79, 80, 89, 90].map((total) => starsOf(total).indexOf("☆")), [1, 2, 2, 3, 3, 4, 4, -1]);
  assert.deepEqual([89, 74, 54, 29].map(praise), ["great", "good", "keep going", "watch the teacher"]);
  const tries = (day) => [{ session: `${day}-120000-000`, phrases: [{ start_s: 0, total: 5 }] }];
  const tried = (day) => weekPlan([{ identity: "a", name: "a", phrase_s: 4, seconds: 9, tries: tries(day) }], new Date(2026, 2, 29)).length;
  assert.deepEqual(["20260228", "20260301", "20260330", "20260331"].map(tried), [0, 1, 1, 0]);
});

// What is seen for that long, in images 100 ms apart, from a time on; whether it was enough at the end, and before.
function seen(place, what, from_ms, lasts_ms) {
  const found = [];
  for (let at_ms = from_ms; at_ms <= from_ms + lasts_ms; at_ms += 100) found.push(place.see(what, at_ms));
  return [found.at(-1), found.slice(0, -1).some(Boolean)];
}

test("the dance waits for a second in place, longer where the camera sees the feet badly, for ever where no person is", () => {
  const place = new InPlace(), good = { joints: [], guidance: "" }, hinted = { joints: [], guidance: "your feet are hidden" };
  const nobody = { joints: null, guidance: "no person seen" };
  assert.deepEqual(seen(place, nobody, 0, 60000), [false, false]);
  assert.deepEqual([seen(place, good, 60100, 700), seen(place, nobody, 60900, 0)], [[false, false], [false, false]]);
  assert.deepEqual(seen(place, good, 61000, 1000), [true, false]);
  assert.deepEqual(seen(new InPlace(), hinted, 0, 8000), [true, false]);
});

test("what happened between two images far apart was not seen: no person is in place by it, or asks for a pause", () => {
  const place = new InPlace(), held = new HandsHeld(), good = { joints: [], guidance: "" };
  assert.ok(!place.see(good, 0) && !place.see(good, 5000) && !held.see(RAISED, 0, 1) && !held.see(RAISED, 5000, 1));
  assert.ok([10000, 15000, 20000].map((at) => place.see(good, at)).at(-1), "a slow machine takes longer");
});

test("hands held together above the head ask for a pause, once until they are let go, and longer in a slowed dance", () => {
  const joints = RAISED, held = new HandsHeld(), times = (from, to, speed) => Array.from({ length: (to - from) / 100 + 1 }, (_, k) => held.see(joints, from + 100 * k, speed));
  const apart = joints.with(7, [0.9, 0.1, 2, 1]), low = joints.with(7, [0.52, 0.4, 2, 1]), unseen = joints.with(7, [null, null, null, 0]);
  assert.deepEqual(times(0, 9000, 1).flatMap((pauses, k) => (pauses ? [k] : [])), [15]);
  for (const other of [apart, low, unseen, null]) {
    const others = new HandsHeld();
    assert.ok(Array.from({ length: 30 }, (_, k) => others.see(other, 100 * k, 1)).every((pauses) => !pauses));
    assert.ok(!held.see(other, 10000, 1) && !held.see(joints, 10001, 1) && !held.see(other, 10002, 1));
  }
  assert.deepEqual(times(20000, 23000, 0.5).flatMap((pauses, k) => (pauses ? [k] : [])), [30]);
});

test("a card meets the line at its own time and moves a beat's width a beat", () => {
  assert.equal(laneX(3, 3, 0.5, 1000), 120);
  assert.equal(laneX(3, 2, 0.5, 1000) - laneX(3, 2.5, 0.5, 1000), laneX(3, 2.5, 0.5, 1000) - 120);
});

test("practising speeds up at the goal, slows down far below it, and ends at full speed", () => {
  const practice = new Practice(80), speeds = [79.4, 79.6, 60, 40, 20, 85, 80, 92].map((total) => [practice.after(total), practice.speed][1]);
  assert.deepEqual(speeds, [75, 90, 90, 75, 75, 90, 100, 100]);
  assert.ok(practice.done && practice.after(92).endsWith("your goal of 80"));
});

test("the worst phrase is the one of the least score; phrases that were not seen, or are too short to be danced alone, do not count", () => {
  const phrases = [[0, 50], [4, null], [8.01, 30], [12, 10]].map(([start_s, total]) => ({ start_s, total }));
  const worst = (seconds, some = phrases) => worstPhrase(some, { phrase_s: 4, seconds });
  assert.deepEqual([worst(14.4), worst(14.5), worst(16, phrases.slice(1, 2))], [{ phrase: 2, total: 30 }, { phrase: 3, total: 10 }, null]);
});

test("the week's plan holds the three worst phrases of late, by their latest try, and none that reached the goal", () => {
  const one = (session, ...totals) => ({ session, phrases: totals.map((total, k) => ({ start_s: 4 * k, total })) });
  const dance = (identity, ...tries) => ({ identity, name: identity, phrase_s: 4, seconds: 13, tries });
  const dances = [dance("a", one("20260301-120000-000", 90, 40, null), one("20260228-120000-000", 10, 10, 50)),
    dance("b", one("20260302-120000-000", 30, 79.9, 81, 5)), dance("c", one("20260101-120000-000", 1))];
  dances[0].tries.unshift(one("20270301-120000-000", 5, 5, 5)); // when the clock was wrong
  const plan = weekPlan(dances, new Date(2026, 2, 3));
  assert.deepEqual(plan.map(({ text }) => text), ["b, phrase 1 (30 of 100)", "a, phrase 2 (40 of 100)", "a, phrase 3 (50 of 100)"]);
  assert.ok(plan[1].href.startsWith("#/dance/a?phrase=1&practise="));
  assert.deepEqual(weekPlan([dance("d", one("20260302-120000-000", 79.6, 79.4))], new Date(2026, 2, 3)).map(({ text }) => text),
    ["d, phrase 2 (79 of 100)"]); // 79.6 is shown as 80, the goal
  const third = { ...one("20260301-120000-000", 20), dancer: 2 }, first = { ...one("20260302-120000-000", 90), dancer: 0 };
  assert.deepEqual(weekPlan([dance("group", first, third)], new Date(2026, 2, 3)).map(({ href }) => href.split("&").at(-1)), ["dancer=2"]);
  const unmirrored = weekPlan([dance("stage", { ...one("20260301-120000-000", 20), mirrored: false })], new Date(2026, 2, 3));
  assert.ok(unmirrored[0].href.endsWith("&dancer=0&mirrored=0"));
});
