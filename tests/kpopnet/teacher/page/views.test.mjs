// What the views build, without a browser.
import assert from "node:assert/strict";
import { test } from "node:test";
import { allOf } from "./dom.mjs";

const PAGE = "../../../../kpopnet/teacher/page/";
const { controls, panels, taught } = await import(`${PAGE}panels.js`);
const { after, handsSwitch, letChoose } = await import(`${PAGE}hands.js`);
const { againAddress, asDanced, phraseAt } = await import(`${PAGE}practice.js`);
const { LOOPS, loopOf } = await import(`${PAGE}loops.js`);
const { inOrder, menu } = await import(`${PAGE}menu.js`);
const { greeting, myself, profilePage } = await import(`${PAGE}mine.js`);
const { line } = await import(`${PAGE}result.js`);
const { keepBegin, songAt, songPanel, songTempo } = await import(`${PAGE}song.js`);
const { partBars, remember } = await import(`${PAGE}tools.js`);

const OFFER = { sources: { simulated: "a simulated learner" }, skills: ["good"], faults: [""] };
const wanting = (dance, query) => controls({ others: [], ...dance }, OFFER, new URLSearchParams(query));

test("a last phrase that is cut short can be chosen, and is what a link asks for", () => {
  const asked = (seconds) => wanting({ phrase_s: 4, seconds }, "phrase=2&practise=80&go").phrase;
  assert.deepEqual(asked(10.6).options.map(({ value }) => value), ["", 0, 1, 2]);
  assert.equal(asked(10.6).value, "2");
  assert.deepEqual(asked(10.4).options.map(({ value }) => value), ["", 0, 1]); // 2.4 s are too short
  assert.deepEqual(wanting({ phrase_s: 2.4, seconds: 12 }, "").phrase.options.map(({ value }) => value), [""]); // at 200 beats a minute
  assert.deepEqual(wanting({ phrase_s: 24, seconds: 5 }, "").phrase.options.map(({ value }) => value), ["", 0]);
});

test("a link that asks for a speed has it", () => {
  remember("speed", 75);
  assert.deepEqual(["speed=50", ""].map((query) => Number(wanting({ phrase_s: 4, seconds: 8 }, query).speed.value)), [50, 75]);
  remember("speed", 100);
});

test("a dance is offered as a link asks for it, and otherwise as it was danced last", () => {
  const offer = { sources: { simulated: "", realsense: "", webcam: "" }, skills: ["good", "bad"], faults: ["", "late"] };
  const chosen = (query) => {
    const parts = controls({ others: [{}], phrase_s: 4, seconds: 19 }, offer, new URLSearchParams(query));
    return Object.fromEntries(Object.entries(parts).map(([name, { value, checked, type }]) => [name, type === "checkbox" ? checked : String(value)]));
  };
  const { skill, fault, dancer, seed, practise, loop } = chosen("skill=bad&fault=late&dancer=1&seed=7&practise=90&loop");
  assert.deepEqual([skill, fault, dancer, seed, practise, loop], ["bad", "late", "1", "7", "90", true]);
  for (const [name, value] of [["music", "house"], ["people", 2], ["source", "realsense"]]) remember(name, value);
  const { music, people, source, ...rest } = chosen("");
  assert.deepEqual([music, people, source, rest.skill, rest.fault, rest.dancer, rest.seed, rest.practise, rest.loop], ["house", "2", "realsense", "good", "", "0", "0", "", false]);
  for (const [name, value] of [["music", "tick"], ["people", 1], ["source", "simulated"]]) remember(name, value);
});

test("the page of a dance tells how hard it is, what latency is taken off for the camera, and asks for learners and dancers where there are several", () => {
  remember("latency.realsense", 0.12);
  const offer = { sources: { realsense: "", webcam: "", simulated: "" }, skills: ["good"], faults: [""] };
  const built = (others) => {
    const dance = { name: "Duet", others, phrase_s: 4, seconds: 19, difficulty: 4, bpm: 120 }, main = document.createElement("main"), parts = controls(dance, offer, new URLSearchParams());
    parts.source.value = "realsense";
    panels(main, dance, parts, document.createElement("div"));
    return { main, parts, get: (id) => allOf(main).find((one) => one.id === id) };
  };
  const { main, parts, get } = built([]), label = (built_) => allOf(built_.main).find(({ tag, children }) => tag === "label" && children.includes(built_.parts.dancer));
  assert.deepEqual([label({ main, parts }).hidden, label(built([{}])).hidden], [true, false]);
  assert.ok(allOf(main).some((one) => one["aria-label"] === "difficulty 4 of 5"));
  assert.equal(parts.phrase.children[2].textContent, "phrase 2, 0:04");
  for (const [source, told, alone] of [["realsense", /^120 ms of latency/, false], ["webcam", /not measured/, true], ["simulated", /not measured/, true]]) {
    Object.assign(parts.source, { value: source }).listeners.change();
    assert.match(get("latency").children[0], told);
    assert.equal(parts.people.disabled, alone);
  }
  remember("latency.realsense", null);
});

test("a part that was seen for some of the time says so", () => {
  const bars = partBars(), told = (coverage) => {
    bars.show({ "left arm": 80.4 }, { "left arm": coverage });
    return bars.list.children.map(({ children: [, number] }) => number.textContent).join("");
  };
  assert.deepEqual([told(0.5), told(1)], ["80, seen 50 %", "80"]);
});

test("the next dance is a whole one", () => {
  const dances = [{ identity: "a" }, { identity: "b" }, { identity: "x", broken: "damaged" }];
  assert.deepEqual(["a", "b"].map((one) => after(dances, one).identity), ["b", "a"]);
});

test("phrases are counted from where a recording's clock begins", () => {
  assert.deepEqual([12.3, 16.3, 20.3].map((start_s) => phraseAt(start_s, { phrase_s: 4, first_s: 12.3 })), [0, 1, 2]);
  assert.equal(phraseAt(6.8, { phrase_s: 3.429 }), 2); // tenths are told
});

test("dancers are counted from the left of who faces the screen, with the mirror and without it", () => {
  const { dancer, mirrored } = wanting({ phrase_s: 4, seconds: 8, others: [{}, {}] }, ""), told = () => dancer.options.map(({ textContent }) => textContent[0]).join("");
  assert.equal(told(), "123");
  mirrored.checked = false;
  mirrored.listeners.change();
  assert.equal(told(), "321");
});

test("who danced without the mirror dances again without it", () => {
  const checked = (query) => wanting({ phrase_s: 4, seconds: 8 }, query).mirrored.checked;
  assert.deepEqual(["", "mirrored=0", asDanced({ dancer: 1, mirrored: false }), asDanced({ mirrored: true })].map(checked), [true, false, false, true]);
  assert.equal(asDanced({ dancer: 2 }), "dancer=2");
});

test("a dance is danced again as it was: the same part, as fast, as in a mirror or not", () => {
  const dance = { phrase_s: 4, seconds: 12, first_s: 0.5 }, whole = { from_s: 0, to_s: 0, speed: 0.75 };
  assert.equal(againAddress("d", whole, dance, "mirrored=0"), "#/dance/d?speed=75&mirrored=0");
  assert.equal(againAddress("d", { from_s: 4.5, to_s: 8.5, speed: 1 }, dance, "dancer=0"), "#/dance/d?phrase=1&speed=100&dancer=0");
  assert.equal(againAddress("d", { ...whole, speed: 0.52 }, dance, ""), "#/dance/d?speed=50&"); // at half of a song's own tempo
  const again = wanting(dance, againAddress("d", { from_s: 4.5, to_s: 8.5, speed: 0.6 }, dance, asDanced({ mirrored: false })).split("?")[1]);
  assert.deepEqual([again.speed.value, again.phrase.value, again.mirrored.checked], ["60", "1", false]);
});

test("the header and the menu ask for the profile once, and again when it has changed", async () => {
  const asked = [];
  globalThis.fetch = async (path) => {
    asked.push(path);
    return Response.json(path === "/api/profiles" ? { p_1: "Mina" } : { name: "Mina", dances: [] });
  };
  localStorage.setItem("teach.who", '"p_1"');
  const [first, second] = await Promise.all([myself(), myself()]);
  assert.deepEqual([first.name, first, asked], ["Mina", second, ["/api/profiles", "/api/profiles/p_1"]]);
  await myself();
  assert.equal(asked.length, 4);
  localStorage.setItem("teach.who", '""');
  assert.equal(await myself(), null);
});

test("the header keeps the name of who was chosen last, whatever answer comes later", async () => {
  const label = document.createElement("a"), answers = [], found = document.getElementById;
  document.getElementById = () => label;
  globalThis.fetch = (path) => (path === "/api/profiles" ? Promise.resolve(Response.json({ p_a: "Ann", p_b: "Bo" })) : new Promise((take) => { answers.push(take); }));
  const asked = ["p_a", "p_b"].map((who) => { localStorage.setItem("teach.who", JSON.stringify(who)); return myself(); });
  await new Promise(globalThis.setImmediate);
  const reply = (name) => Response.json({ name, dances: [] });
  answers[1](reply("Bo"));
  await asked[1];
  answers[0](reply("Ann"));
  await asked[0];
  assert.equal(label.textContent, "Bo");
  localStorage.setItem("teach.who", '""');
  await myself();
  assert.equal(label.textContent, "Who dances?");
  document.getElementById = found;
});

test("a name that a Mac wrote is found as it is typed", async () => {
  const main = document.createElement("main");
  Object.assign(globalThis, { IntersectionObserver: class { observe() {} disconnect() {} }, matchMedia: () => ({ matches: true }) });
  const dances = ["É칠", "Duet"].map((name, k) => ({ identity: `own_${k}`, name: name.normalize("NFD"), difficulty: 1, seconds: 9, bpm: 120, own: true }));
  globalThis.fetch = async (path) => Response.json(path === "/api/offer" ? { sources: { simulated: "" } } : dances);
  const leave = await menu(main), [search, cards, ...selects] = ["search", "cards", "level", "order"].map((id) => allOf(main).find((one) => one.id === id));
  leave(); // ends its timer
  assert.deepEqual(selects.map((one) => one["aria-label"]), ["difficulty", "order"]);
  assert.deepEqual([selects[0].children[2], allOf(cards.children[0])[2]].map((one) => one["aria-label"]), ["difficulty 2 of 5", "difficulty 1 of 5"]);
  search.value = "é칠";
  search.listeners.input();
  assert.deepEqual(cards.children.map((card) => card.href), ["#/dance/own_0"]);
});

test("learners dance as the group stands, from their own left, with the mirror and without it, and are told whom", () => {
  const parts = wanting({ phrase_s: 4, seconds: 8, others: [{}, {}] }, "dancer=1"), { mirrored, dancer } = parts;
  const told = (people) => taught(parts, people).map((k) => dancer.options[k].textContent[0]).join("");
  assert.deepEqual([1, 2, 3].map(told), ["2", "23", "123"]);
  mirrored.checked = false; // who stands on the left dances the one further right on the screen
  mirrored.listeners.change();
  assert.deepEqual([1, 2, 3].map(told), ["2", "21", "321"]);
  assert.deepEqual(taught(wanting({ phrase_s: 4, seconds: 8, others: [{}] }, ""), 3), [0, 1, 1]);
});

test("a song that was read more slowly than the one chosen after it leaves that one's beats alone, and what is kept of it", async () => {
  const waiting = {}; // files that are being read, by their tempo: what ends it
  Object.assign(URL, { createObjectURL: () => "", revokeObjectURL() {} });
  globalThis.OfflineAudioContext = class {
    decodeAudioData = (bpm) => new Promise((read, fail) => {
      const loop = bpm ? loopOf(Object.keys(LOOPS)[0], bpm, 22050) : [0], samples = Float32Array.from({ length: 20 * 22050 }, (_, k) => loop[k % loop.length]);
      waiting[bpm] = [() => read({ getChannelData: () => samples }), () => fail(Object.assign(new Error("no sound"), { name: "EncodingError" }))];
    });
  };
  let find; // what the thread beside the page does with a message
  Object.assign(globalThis, { addEventListener: (kind, listener) => { find = listener; }, Worker: class extends Map {
    constructor() { super(); }

    addEventListener(kind, listener) { this.set(kind, listener); }

    postMessage(data) {
      globalThis.postMessage = (reply) => this.get("message")({ data: reply });
      find({ data });
    }

    terminate() {}
  } });
  await import(`${PAGE}beats_worker.js`);
  const panel = songPanel(() => {}), file = (name, bpm) => ({ name, arrayBuffer: async () => bpm });
  const [slow, broken, chosen] = [panel.take(file("slow", 98)), panel.take(file("broken", 101)), panel.take(file("chosen", 124))];
  await new Promise(globalThis.setImmediate); // all are being read
  for (const [bpm, how] of [[124, 0], [98, 0], [101, 1]]) waiting[bpm][how]();
  await Promise.all([slow, broken, chosen]);
  assert.ok(Math.abs(songTempo() - 124) < 0.5, songTempo());
  assert.match(panel.panel.children.find(({ id }) => id === "song-told").textContent, /^chosen: 12/);
  const silent = panel.take(file("silent", 0)); // nothing beats in it
  await new Promise(globalThis.setImmediate);
  waiting[0][0]();
  await silent;
  assert.equal(panel.panel.children.find(({ id }) => id === "song-told").textContent, "no beats were found in it; tap them");
  const again = panel.take(file("chosen", 124)); // whose beats are remembered
  await new Promise(globalThis.setImmediate);
  waiting[124][0]();
  await again;
  const earlier = panel.panel.children.at(-1).children.at(-1).children.find(({ id }) => id === "earlier");
  for (let k = 0; k < 9; k++) earlier.listeners.click();
  const { at_s, rate } = songAt(0, 1), one_s = JSON.parse(localStorage.getItem("teach.song.chosen")).one_s;
  assert.ok(one_s >= 0 && at_s === one_s && rate === 1, "the dance begins on a one that the song has");
  const half = panel.panel.children.at(-1).children.at(-1).children.find(({ id }) => id === "half");
  for (let k = 0; k < 9; k++) half.listeners.click();
  assert.equal(songTempo().toFixed(0), "31", "no dance follows fewer than 20 beats a minute");
  localStorage.setItem("teach.song.kept", '{"bpm": 0.01, "one_s": 9}'); // of a version that let it be halved without end
  const found = panel.take(file("kept", 90));
  await new Promise(globalThis.setImmediate);
  waiting[90][0]();
  await found;
  assert.ok(Math.abs(songTempo() - 90) < 0.5, songTempo());
  assert.deepEqual(["slow", "broken", "chosen"].map((name) => localStorage.getItem(`teach.song.${name}`) !== null), [false, false, true]);
});

test("taps on the beats, from the one on, say them, again after a pause; the one is moved by beats and by a bar", () => {
  Object.assign(URL, { createObjectURL: () => "", revokeObjectURL() {} });
  globalThis.OfflineAudioContext = class { decodeAudioData = () => new Promise(() => {}); };
  let changed = 0;
  const { panel, take } = songPanel(() => { changed++; }), get = (id) => allOf(panel).find((one) => one.id === id), audio = get("song");
  const press = (id) => get(id).listeners.click(), tap = (...times_s) => times_s.forEach((at_s) => { audio.currentTime = at_s; press("tap"); });
  const beats = () => { const { at_s, rate } = songAt(3, 0.8); return [songTempo(), at_s - 3, rate].map((one) => Number(one.toFixed(3))); };
  Object.assign(audio, { paused: true, play() { audio.paused = false; } });
  take({ name: "tapped", arrayBuffer: () => new Promise(() => {}) });
  tap(1, 2, 2.5, 3); // the first one begins to play it
  assert.equal(get("song-told").textContent, "3 of 4 taps");
  tap(3.5);
  assert.deepEqual([beats(), changed], [[120, 2, 0.8], 2]);
  keepBegin("own_1", "tapped", 8); // it was recorded to this song, and cut
  keepBegin("own_2", "another", 8);
  assert.deepEqual(["own_1", "own_2", "own_3"].map((identity) => songAt(3, 1, identity).at_s), [13, 5, 5]);
  tap(10, 10.6, 11.2, 11.8);
  assert.deepEqual(beats(), [100, 10, 0.8]);
  for (const [id, one_s] of [["later", 10.6], ["bar", 13], ["earlier", 12.4]]) {
    press(id);
    assert.deepEqual(beats(), [100, one_s, 0.8]);
  }
  tap(4, 4.6); // it was sought back
  assert.equal(get("song-told").textContent, "2 of 4 taps");
});

test("a song of which no beats were found in it is tapped; one that cannot be read is not", async () => {
  const ended = [];
  Object.assign(URL, { createObjectURL: () => "", revokeObjectURL: () => ended.push("file") });
  globalThis.OfflineAudioContext = class {
    decodeAudioData = async (read) => (read ? { getChannelData: () => [] } : Promise.reject(Object.assign(new Error("no sound"), { name: "EncodingError" })));
  };
  globalThis.Worker = class {
    addEventListener(kind, listener) { this[kind] = listener; }

    postMessage() { this.message({ data: { found: { bpm: 100, one_s: 21.6 } } }); }

    terminate() { ended.push("thread"); }
  };
  const { panel, take } = songPanel(() => {}), get = (id) => allOf(panel).find((one) => one.id === id), tools = panel.children.at(-1);
  get("song").duration = 20;
  for (const [read, told] of [[true, /tap them$/], [false, /cannot read it/]]) {
    await take({ name: "one", arrayBuffer: async () => read });
    assert.match(get("song-told").textContent, told);
    assert.deepEqual([tools.hidden, tools.open], [!read, true]);
  }
  assert.deepEqual(ended, ["file", "thread", "file"]);
  get("song").duration = NaN;
});

test("what becomes known of a song that was chosen in a view that was left is told in the next one", async () => {
  const read = [], changed = [];
  globalThis.OfflineAudioContext = class { decodeAudioData = () => new Promise((take, fail) => { read.push(take, fail); }); };
  localStorage.setItem("teach.song.mine", '{"bpm": 90, "one_s": 1}');
  for (const [fails, shown] of [[false, "mine: 90.0 beats a minute, the one at 1.00 s"], [true, "mine: this browser cannot read it; choose an audio file"]]) {
    const left = songPanel(() => changed.push("left")), taken = left.take({ name: "mine", arrayBuffer: async () => null });
    const { panel } = songPanel(() => changed.push("next"));
    await new Promise(globalThis.setImmediate);
    read.splice(0)[Number(fails)](Object.assign(new Error("no sound"), { name: "EncodingError" }));
    await taken;
    assert.equal(allOf(panel).find(({ id }) => id === "song-told").textContent, shown);
  }
  assert.deepEqual(changed, ["left", "next", "left"]); // where it was chosen, the beats of the song before go
});

// Chooses the same file twice in an input for files, which tells of a change of its value alone.
function chooseTwice(input, file) {
  for (let k = 0; k < 2; k++) {
    if (input.value) continue;
    Object.assign(input, { value: file.name, files: [file] });
    input.listeners.change();
  }
}

test("a song or a dance that is chosen again is read again", async () => {
  Object.assign(URL, { createObjectURL: () => "", revokeObjectURL() {} });
  let read = 0;
  const ofSong = allOf(songPanel(() => {}).panel).find(({ id }) => id === "song-file");
  chooseTwice(ofSong, { name: "a.mp3", arrayBuffer: () => { read++; return new Promise(() => {}); } });
  assert.equal(read, 2);

  const sent = [], main = Object.assign(document.createElement("main"), { isConnected: true });
  Object.assign(globalThis, { IntersectionObserver: class { disconnect() {} }, matchMedia: () => ({ matches: true }) });
  globalThis.fetch = async (path, { body }) => {
    if (body) sent.push(body);
    return Response.json(body ? { error: "damaged" } : path === "/api/offer" ? { sources: { simulated: "" } } : [], { status: body ? 400 : 200 });
  };
  const leave = await menu(main), file = { name: "mine.bvh" };
  chooseTwice(allOf(main).find(({ type }) => type === "file"), file);
  leave(); // ends its timer
  assert.deepEqual(sent, [file, file]);
});

test("the line of a course has gaps where nothing was compared", () => {
  const same = (value) => value;
  assert.equal(line([0, 1, 2, 3, 4, 5], [null, 1, 2, null, 3, 4], same, same).d, "M1,1L2,2M4,3L5,4");
});

test("a try to the end of a dance is one of the whole dance, however its end was told", async () => {
  const main = document.createElement("main"), one = (day, to_s, total) => ({ session: `202603${day}-120000-000`, from_s: 0, to_s, total, phrases: [] });
  const tries = [one("03", 4, 5), one("02", 0, 50), one("01", 60, 100)]; // the newest first
  const dances = [{ identity: "d", name: "D", seconds: 60, phrase_s: 4, tries }];
  globalThis.fetch = async (path) => Response.json(path === "/api/profiles" ? { p_1: "Mina" } : { name: "Mina", dances });
  localStorage.setItem("teach.who", '"p_1"');
  await profilePage(main);
  localStorage.setItem("teach.who", '""');
  assert.ok(allOf(main).some(({ textContent }) => textContent === "2 tries, best 100, last 50 on 2 Mar 2026, 12:00"));
  assert.equal(allOf(main).find((one) => one.class === "line").d, "M20,8L980,75"); // the newest on the right, better ones above
});

test("who comes back is told of the latest try, and who was deleted in another window is a guest", async () => {
  const dance = (name, session) => ({ identity: name, name, seconds: 60, phrase_s: 4, tries: [{ session, total: 50, from_s: 0, to_s: 60, phrases: [] }] });
  const dances = ["20260301", "20260303", "20260302"].map((day, k) => dance("ABC"[k], `${day}-120000-000`));
  assert.ok(greeting({ name: "Mina", dances })[0].textContent.includes("Last: B, 50 of 100."));
  globalThis.fetch = async () => Response.json({ p_2: "Jun" });
  localStorage.setItem("teach.who", '"p_1"');
  assert.equal(await myself(), null);
  assert.equal(localStorage.getItem("teach.who"), '""');
});

test("who comes back is told of a scored try that is not ahead of time, of a part by its excerpt, and what to practise", () => {
  const day = (days) => `${new Date(Date.now() + days * 86400000).toISOString().slice(0, 10).replaceAll("-", "")}-120000-000`;
  const tried = (days, total, more = {}) => ({ session: day(days), total, from_s: 0, to_s: 60, phrases: [], ...more });
  const tries = [tried(400, 99), tried(-1, null), tried(-2, 50.4, { from_s: 4, to_s: 8, phrases: [{ start_s: 4, total: 50 }] }), tried(-3, 80)];
  const [{ children: [welcome, , last, , practise] }] = greeting({ name: "Mina", dances: [{ identity: "d", name: "Duet", seconds: 60, phrase_s: 4, tries }] });
  assert.deepEqual([welcome.textContent, last, practise.textContent], ["Welcome back, Mina!", "Last: Duet, 0:04 – 0:08, 50 of 100.", "Practise Duet, phrase 2 (50 of 100)"]);
  assert.match(practise.href, /^#\/dance\/d\?phrase=1&practise=80&go/);
});

test("a profile without tries has nothing to practise; one that cannot be deleted stays, and why is told", async () => {
  const main = document.createElement("main");
  globalThis.fetch = async (path, { method } = {}) =>
    Response.json(method ? { error: "the disk is full" } : path === "/api/profiles" ? { p_1: "Mina" } : { name: "Mina", dances: [] }, { status: method ? 500 : 200 });
  localStorage.setItem("teach.who", '"p_1"');
  await profilePage(main);
  assert.ok(allOf(main).some(({ textContent }) => textContent.startsWith("Nothing yet")));
  const get = (id) => allOf(main).find((found) => found.id === id);
  for (let press = 0; press < 2; press++) await get("delete").listeners.click();
  assert.deepEqual([get("error").textContent, localStorage.getItem("teach.who")], ["the disk is full", '"p_1"']);
  localStorage.setItem("teach.who", '""');
});

test("a profile is deleted at the second press", async () => {
  const main = document.createElement("main"), asked = [];
  globalThis.location = { hash: "" };
  globalThis.fetch = async (path, { method } = {}) => {
    asked.push(`${method || "GET"} ${path}`);
    return Response.json(path === "/api/profiles" ? { p_1: "Mina" } : { name: "Mina", dances: [] });
  };
  localStorage.setItem("teach.who", '"p_1"');
  await profilePage(main);
  const button = allOf(main).find(({ id }) => id === "delete");
  await button.listeners.click();
  assert.deepEqual([asked.includes("DELETE /api/profiles/p_1"), localStorage.getItem("teach.who")], [false, '"p_1"']);
  await button.listeners.click();
  assert.deepEqual([asked.at(-1), localStorage.getItem("teach.who")], ["DELETE /api/profiles/p_1", '""']);
});

test("a double click, or Enter that is held, does not delete a profile; who has left the page by the answer stays where they are", async () => {
  const main = document.createElement("main"), asked = [], answers = [];
  globalThis.location = { hash: "#/me" };
  globalThis.fetch = (path, { method } = {}) => {
    if (method) return new Promise((take) => { asked.push(method); answers.push(take); });
    return Promise.resolve(Response.json(path === "/api/profiles" ? { p_1: "Mina" } : { name: "Mina", dances: [] }));
  };
  localStorage.setItem("teach.who", '"p_1"');
  await profilePage(main);
  const { listeners } = allOf(main).find(({ id }) => id === "delete");
  let held = true;
  listeners.keydown({ repeat: true, preventDefault() { held = false; } });
  for (const detail of [1, 2, 3]) listeners.click({ detail });
  assert.deepEqual([held, asked], [false, []]);
  const under_way = [listeners.click({ detail: 1 }), allOf(main).find(({ tag }) => tag === "form").listeners.submit({ preventDefault() {} })];
  for (const one of allOf(main)) one.isConnected = false;
  location.hash = "#/dance/d";
  for (const answer of answers) answer(Response.json({ who: "p_2" }));
  await Promise.all(under_way);
  assert.deepEqual([asked, location.hash], [["DELETE", "POST"], "#/dance/d"]);
  localStorage.setItem("teach.who", '""');
});

test("one's own dances come first and damaged ones last", () => {
  const dances = [{ name: "x", broken: "damaged" }, { name: "a", difficulty: 3, own: false }, { name: "b", difficulty: 5, own: true }, { name: "c", difficulty: 1, own: false }];
  assert.deepEqual(["name", "difficulty"].map((order) => inOrder(dances, order).map(({ name }) => name).join("")), ["bacx", "bcax"]);
});

// The menu of these dances for a test, with their thumbnails in view, and its elements by their id; `added` answers a file.
async function menuOf(t, dances, added = null, less = false) {
  const main = document.createElement("main"), inView = [];
  Object.assign(globalThis, {
    location: { hash: "" }, matchMedia: () => ({ matches: less }), getComputedStyle: () => ({ color: "black" }),
    IntersectionObserver: class {
      constructor(tell) { this.tell = tell; }

      observe(target) { inView.push((isIntersecting) => this.tell([{ target, isIntersecting }])); }

      disconnect() {}
    },
    fetch: async (path, { method } = {}) => {
      if (method) return added(new URLSearchParams(path.split("?")[1]));
      const points = (x) => Array(30).fill(0).with(0, x); // the head to one side
      return Response.json(path === "/api/offer" ? { sources: { simulated: "" } } : path.endsWith("/preview") ? [10, 20, 30].map(points) : dances);
    },
  });
  const leave = await menu(main), get = (id) => allOf(main).find((one) => one.id === id);
  t.after(leave); // ends its timer
  return { main, leave, inView, get, shown: () => get("cards").children.map((card) => card["data-dance"]).join("") };
}

const one = (identity, more = {}) => ({ identity, name: identity, difficulty: 1, seconds: 60, bpm: 120, own: false, ...more });

test("the menu is in the order that was chosen, by tempo or length too, also at the next visit", async (t) => {
  const dances = [one("a", { bpm: 90, seconds: 30 }), one("b", { bpm: 80, seconds: 50 }), one("c", { bpm: 100, seconds: 40 })];
  for (const [order, found] of [["length", "acb"], ["tempo", "bac"]]) {
    const { get, shown } = await menuOf(t, dances);
    get("order").value = order;
    get("order").listeners.change();
    assert.equal(shown(), found);
    const next = await menuOf(t, dances);
    assert.deepEqual([next.get("order").value, next.shown()], [order, found]);
  }
  remember("order", "name");
});

test("a search finds what has every word and says how many; a damaged dance says why, and leads nowhere", async (t) => {
  const { main, get, shown } = await menuOf(t, [one("a", { name: "Blue moon", own: true }), one("b", { name: "Blue sun" }), { identity: "x", name: "Moon blue", broken: "cut short" }]);
  get("search").value = "MOON blue";
  get("search").listeners.input();
  assert.deepEqual([shown(), allOf(main).find(({ role }) => role === "status").textContent], ["ax", "2 of 3 dances"]);
  const [card, damaged] = get("cards").children;
  assert.equal(card.children.at(-1).textContent, "1:00 · 120 bpm · yours");
  assert.deepEqual([damaged.href, damaged.children.at(-1).textContent], [undefined, "damaged: cut short"]);
});

test("a file is added under its name without the ending, and a refusal is told", async (t) => {
  const titles = [], { main } = await menuOf(t, [], (query) => {
    titles.push([query.get("file"), query.get("title")]);
    return Response.json({ error: "it is damaged" }, { status: 400 });
  });
  for (const name of ["my.own.bvh", ".bvh"]) Object.assign(allOf(main).find(({ type }) => type === "file"), { files: [{ name }] }).listeners.change();
  await new Promise(globalThis.setImmediate);
  assert.deepEqual(titles, [["my.own.bvh", "my.own"], [".bvh", "My dance"]]);
  assert.equal(allOf(main).find(({ role }) => role === "status").textContent, "it is damaged");
});

test("a thumbnail in view moves as in a mirror, ten times a second, stands where less motion is wished, and is left alone out of view", async (t) => {
  t.mock.timers.enable({ apis: ["setInterval"] });
  for (const [less, seen] of [[false, [20, 30, 10]], [true, [10, 10, 10]]]) {
    const heads = [], { get, inView, leave } = await menuOf(t, [one("a")], null, less), canvas = get("cards").children[0].children[0];
    const pen = new Proxy({}, { get: (_, name) => (name === "arc" ? (x) => heads.push(Math.round((80 - x) / 0.52)) : () => {}) });
    canvas.getContext = () => pen;
    for (const told of inView) told(true);
    await new Promise(globalThis.setImmediate);
    t.mock.timers.tick(300);
    assert.deepEqual(heads, seen);
    for (const told of inView) told(false);
    t.mock.timers.tick(300);
    assert.equal(heads.length, 3);
    leave();
  }
});

test("a hand is offered whole dances alone, a search's from its first on, and watched for until the menu is left", async (t) => {
  const asked = [], fields = () => document.body.children[0].children[0].children.map((field) => field["data-target"]).join("");
  globalThis.WebSocket = class {
    static OPEN = 1;

    readyState = 1;

    addEventListener() {}

    send(text) { asked.push(JSON.parse(text)); }
  };
  globalThis.requestAnimationFrame = () => {};
  Object.assign(document, { addEventListener() {} });
  document.body.children = [];
  handsSwitch(() => {});
  remember("hands", true);
  const { get, leave } = await menuOf(t, [{ identity: "x", name: "x", broken: "damaged" }, ...[..."abcdef"].map((name) => one(name))]);
  document.body.children[0].children[0].children.at(-1).click(); // more
  assert.equal(fields(), "efmore");
  get("level").value = "1";
  get("level").listeners.change();
  assert.deepEqual([fields(), asked[0].lesson.dance], ["abcdmore", "a"]);
  leave();
  assert.equal(asked.at(-1).do, "stop");
  letChoose([]);
  remember("hands", false);
});

test("a hand is offered four dances at a time, round and round, and the menu that is left draws and opens nothing", async (t) => {
  t.mock.timers.enable({ apis: ["setInterval"] });
  const main = document.createElement("main"), answers = [];
  let drawn = 0, observed = true;
  Object.assign(globalThis, {
    location: { hash: "" }, matchMedia: () => ({ matches: false }), getComputedStyle: () => ({ color: drawn++ }),
    IntersectionObserver: class { observe() {} disconnect() { observed = false; } },
  });
  Object.assign(document, { addEventListener() {} });
  document.body.children = [];
  handsSwitch(() => {});
  const dances = Array.from({ length: 8 }, (_, k) => ({ identity: `d_${k}`, name: `${k}`, difficulty: 1 + k % 2, seconds: 9, bpm: 120 }));
  globalThis.fetch = (path, { method } = {}) => (method ? new Promise((answer) => { answers.push(answer); })
    : Promise.resolve(Response.json(path === "/api/offer" ? { sources: { simulated: "" } } : dances)));
  const leave = await menu(main), fields = () => document.body.children[0].children[0].children, named = () => fields().map((one) => one["data-target"][2]).join("");
  const pages = [0, 1, 2].map(() => {
    const shown = named();
    fields().at(-1).click();
    return shown;
  });
  assert.deepEqual(pages, ["0123r", "4567r", "0123r"]); // "r" of "more"
  const [level, cards] = ["level", "cards"].map((id) => allOf(main).find((one) => one.id === id));
  level.value = "1";
  level.listeners.change();
  assert.deepEqual(cards.children.map((card) => card["data-dance"][2]), ["0", "2", "4", "6"]);
  const file = allOf(main).find(({ type }) => type === "file");
  Object.assign(file, { files: [{ name: "mine.bvh" }] }).listeners.change();
  t.mock.timers.tick(100);
  assert.equal(drawn, 1);
  leave();
  for (const one of allOf(main)) one.isConnected = false;
  answers[0](Response.json({ identity: "mine" }));
  await new Promise(globalThis.setImmediate);
  t.mock.timers.tick(1000);
  assert.deepEqual([drawn, observed, location.hash], [1, false, ""]);
  letChoose([]);
});
