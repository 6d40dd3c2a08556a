// The views by the address after #: the menu, a dance, a try, and the rest.
import { calibrate } from "./calibrate.js";
import { after, chosenSource, handsFree, handsSwitch, letChoose, watch } from "./hands.js";
import { inOrder, menu } from "./menu.js";
import { myself, profilePage } from "./mine.js";
import { record } from "./record.js";
import { result } from "./result.js";
import { stage } from "./stage.js";
import { ask, el, remember, remembered } from "./tools.js";
import { LANGUAGES, language, say } from "./words.js";

const main = document.getElementById("main");
const BEGUN = "begun";
let leave = null, turn = 0; // what ends the view, and whether it `stays` when another one is asked for

// `moved`: the address has changed. What had the focus is gone then: reading goes on at the new view's heading. A dance that began
// by itself does so again by a reload, but not when one comes back to it.
async function show(moved) {
  const mine = ++turn;
  if (leave) leave();
  leave = null;
  letChoose([]);
  const [path, query = ""] = location.hash.replace(/^#\/?/, "").split("?");
  const [kind, identity, , name] = path.split("/");
  const place = el("div"); // of its own: a view that arrives too late is not seen
  main.replaceChildren(place);
  try {
    let end;
    if (kind === "dance" && name) end = afterDance(await result(place, identity, name), await byHand(place, identity).catch(() => () => {})); // the result stays without
    else if (kind === "me") end = await profilePage(place);
    else if (kind === "record") end = await record(place);
    else if (kind === "calibrate") end = await calibrate(place);
    else if (kind === "dance" && identity) {
      const wanted = new URLSearchParams(query);
      if (moved && history.state === BEGUN) wanted.delete("go");
      else if (wanted.has("go")) history.replaceState(BEGUN, "");
      end = await stage(place, identity, wanted);
    } else end = await menu(place);
    if (mine === turn) leave = end;
    else end();
  } catch (error) {
    if (mine !== turn) return;
    main.replaceChildren(el("p", { class: "error", role: "alert" }, error.message), el("a", { href: "#/", onclick: () => { if (location.hash === "#/") show(); } }, say("To the dances")));
  }
  if (mine !== turn) return;
  document.title = [main.querySelector("h1")?.firstChild?.textContent, say("Dance teacher")].filter(Boolean).join(" · ");
  main.dataset.ready = location.hash;
  if (!moved) return;
  const head = main.querySelector("h1") || main;
  head.tabIndex = -1;
  head.focus({ preventScroll: true });
}

const afterDance = (...ends) => () => ends.forEach((end) => end());

// What can be chosen by hand beside a result; returns what ends it.
async function byHand(place, identity) {
  if (!handsFree()) return () => {};
  const [dances, { sources }] = await Promise.all([ask("/api/dances"), ask("/api/offer")]), go = (where) => () => { location.hash = where; };
  if (!place.isConnected) return () => {};
  letChoose([
    { id: "again", text: say("Dance again"), act: go(`${place.querySelector("#again").hash}&go`) },
    { id: "next", text: say("Next dance"), act: go(`#/dance/${after(inOrder(dances), identity).identity}`) },
    { id: "menu", text: say("To the dances"), act: go("#/") },
  ]);
  return watch(dances.find((one) => one.identity === identity), chosenSource(sources));
}

document.title = say("Dance teacher");
for (const node of document.querySelectorAll("[data-say]")) node.textContent = say(node.textContent);
const languages = document.getElementById("language");
languages.append(...Object.entries(LANGUAGES).map(([key, text]) => el("option", { value: key, lang: key }, text)));
languages.value = language;
languages.addEventListener("change", () => {
  remember("language", languages.value);
  history.replaceState("language", "", `/${location.hash}`); // without ?lang=
  location.reload();
});
if (history.state === "language") { // by the keyboard the next one may be wanted
  history.replaceState(null, "");
  languages.focus();
}
// A dance, a recording or a measurement goes on: what is busy is not shown anew.
const shownAnew = () => main.querySelector("[data-busy]") || show();
languages.before(handsSwitch(shownAnew));
addEventListener("storage", ({ key }) => { if (key === "teach.who") myself().catch(() => {}); }); // chosen in another tab
const theme = document.getElementById("theme"), showTheme = () => { document.documentElement.dataset.theme = theme.value; };
for (const [id, otherwise, apply] of [["theme", "auto", showTheme], ["palette", "brightness", shownAnew]]) {
  const select = document.getElementById(id);
  select.value = remembered(id, otherwise);
  select.addEventListener("change", () => {
    remember(id, select.value);
    apply();
  });
}
showTheme();
document.querySelector(".skip").addEventListener("click", (event) => {
  event.preventDefault(); // #main is no view
  main.focus();
});
// By a link, the Back key or a hand; a view that would lose something may ask first, and stay.
addEventListener("hashchange", (event) => {
  if (leave?.stays?.()) history.pushState(null, "", event.oldURL);
  else show(event);
});
myself().catch(() => {}); // whose name the header shows
show();
