// Who dances: names on this machine, a curve for each dance, what to practise this week, and one's data to take along or delete.
import { isAhead, isPart, weekPlan } from "./practice.js";
import { excerptOf, line, part, when } from "./result.js";
import { ask, el, remember, remembered } from "./tools.js";
import { say } from "./words.js";

const WIDE = 1000, HIGH = 150;

let asked = null; // who was asked for last, and the answer that is on its way

// The profile that dances in this browser, with its tries; null for a guest. The header and a view that ask at once ask once.
export function myself() {
  const who = remembered("who", "");
  if (asked?.who !== who) {
    const mine = asked = { who, found: find(who).finally(() => { if (asked === mine) asked = null; }) };
  }
  return asked.found;
}

async function find(who) {
  const label = document.getElementById("me");
  let found = null;
  if (who) {
    const names = await ask("/api/profiles");
    if (names[who]) found = { who, ...(await ask(`/api/profiles/${who}`)) };
    else remember("who", ""); // deleted in another window
  }
  if (remembered("who", "") === (found?.who ?? "")) label.textContent = found ? found.name : say("Who dances?"); // not another one by now
  return found;
}

export function greeting(found) {
  if (!found) return [];
  const now = new Date();
  const tries = found.dances.flatMap(({ name, seconds, tries: all }) => all.filter(({ session, total }) => total !== null && !isAhead(session, now))
    .map((one) => ({ ...one, name: isPart(one, seconds) ? `${name}, ${excerptOf(one, seconds)}` : name })));
  if (!tries.length) return [el("p", { id: "greeting" }, say("Hello {name}! What you dance now is kept under your name.", found))];
  const last = tries.reduce((a, b) => (b.session > a.session ? b : a)), plan = weekPlan(found.dances, now);
  return [el("p", { id: "greeting" }, el("b", {}, say("Welcome back, {name}!", found)), " ",
    say("Last: {name}, {total} of 100.", { name: last.name, total: Math.round(last.total) }), " ",
    plan.length ? el("a", { href: plan[0].href }, say("Practise {what}", { what: plan[0].text })) : "")];
}

export async function profilePage(main) {
  const [found, names] = [await myself(), await ask("/api/profiles")];
  const told = el("p", { class: "error", role: "alert", id: "error" });
  const name = el("input", { id: "name", maxLength: 40, required: true, autocomplete: "off" });
  const form = el("form", { class: "controls", onsubmit: add }, el("label", {}, say("new name"), name), el("button", { id: "add", type: "submit" }, say("Add")));
  main.append(
    el("h1", {}, found ? found.name : say("Who dances?")),
    el("div", { class: "controls", id: "names" }, ...Object.entries({ "": say("a guest"), ...names }).map(([who, text]) =>
      el("button", { type: "button", "aria-pressed": String(who === (found?.who ?? "")), onclick: () => choose(who) }, text))),
    form, told,
    el("p", { class: "quiet" }, say("Names and dances stay on this machine. Whoever uses it sees them; there is no password.")),
  );
  if (found) main.append(...about(found, told));
  main.append(el("p", {}, el("a", { href: "#/" }, say("To the dances"))));
  return () => {};

  function choose(who) {
    remember("who", who);
    if (form.isConnected) location.hash = "#/"; // or who has gone on by now would be taken back
  }

  async function add(event) {
    event.preventDefault();
    try {
      choose((await ask("/api/profiles", { method: "POST", body: JSON.stringify({ name: name.value.trim() }) })).who);
    } catch (error) {
      told.textContent = error.message;
    }
  }
}

function about(found, told) {
  const plan = weekPlan(found.dances, new Date());
  return [
    el("h2", {}, say("To practise this week")),
    plan.length ? el("ol", { id: "plan" }, ...plan.map(({ text, href }) => el("li", {}, el("a", { href }, text))))
      : el("p", {}, say("Nothing yet: dance a dance to its end.")),
    ...found.dances.flatMap(curve),
    el("h2", {}, say("Your data")),
    el("div", { class: "controls" }, el("a", { class: "button", id: "export", href: `/api/profiles/${found.who}.zip`, download: "" }, say("Save it all (.zip)")), deletion(found, told)),
  ];
}

// The scores of the tries of a dance, the newest on the right; of the whole dance, if it was danced.
function curve(dance) {
  const seen = dance.tries.filter(({ total }) => total !== null), whole = seen.filter(({ from_s, to_s }) => from_s === 0 && Math.abs((to_s || dance.seconds) - dance.seconds) < 1);
  const shown = (whole.length ? whole : seen).toReversed();
  if (!shown.length) return [];
  const x = (k) => (shown.length > 1 ? 20 + (WIDE - 40) * k / (shown.length - 1) : WIDE / 2), y = (value) => HIGH - 8 - (HIGH - 16) * value / 100;
  const totals = shown.map(({ total }) => total), best = Math.round(Math.max(...totals)), last = shown.at(-1);
  const counted = say(whole.length ? shown.length > 1 ? "{count} tries" : "{count} try" : shown.length > 1 ? "{count} tries of phrases" : "{count} try of phrases",
    { count: shown.length });
  const text = say("{tries}, best {best}, last {last} on {day}", { tries: counted, best, last: Math.round(last.total), day: when(last.session) });
  return [el("h2", {}, el("a", { href: `#/dance/${dance.identity}` }, dance.name)), el("p", { class: "quiet" }, text),
    part("svg", { class: "course curve", viewBox: `0 0 ${WIDE} ${HIGH}`, preserveAspectRatio: "none", role: "img", "aria-label": `${dance.name}: ${text}` },
      ...[25, 50, 75].map((value) => part("line", { class: "phrase", x1: 0, x2: WIDE, y1: y(value), y2: y(value) })),
      line(totals.map((_, k) => k), totals, x, y),
      ...totals.map((total, k) => part("line", { class: "dot", x1: x(k), x2: x(k), y1: y(total), y2: y(total) })))];
}

// Deleting asks once more; a double click, or a key that is held, is no second word.
function deletion(found, told) {
  let sure = false;
  const button = el("button", { type: "button", id: "delete", onkeydown: (event) => event.repeat && event.preventDefault(), onclick: async (event) => {
    if (event?.detail > 1) return;
    if (!sure) {
      sure = true;
      button.textContent = say("Delete {name} and all tries for good?", found);
      return;
    }
    try {
      await ask(`/api/profiles/${found.who}`, { method: "DELETE" });
      remember("who", "");
      if (button.isConnected) location.hash = "#/";
    } catch (error) {
      told.textContent = error.message;
    }
  } }, say("Delete it all"));
  return button;
}
