// A dance: the teacher in 3D, the learner beside, and everything that is said while dancing.
import { tempoRatio } from "./beats.js";
import { View, loadBody, movementOf } from "./body.js";
import { LearnerView } from "./learner.js";
import { Lane } from "./lane.js";
import { after, follow, handsFree, letChoose, rest, watching } from "./hands.js";
import { liveFor } from "./live.js";
import { inOrder } from "./menu.js";
import { alone, controls, panels, taught } from "./panels.js";
import { Practice, asDanced } from "./practice.js";
import { songAt, songPanel, songTempo } from "./song.js";
import { Sound } from "./sound.js";
import { OF_LEARNERS, ask, clamp, clock, el, keyOf, latencyOf, remember, remembered, swatch, tell } from "./tools.js";
import { HandsHeld, InPlace, praise, starsOf, streakAfter } from "./verdicts.js";
import { say } from "./words.js";

const COUNTS = 4;
const AGAIN_S = 2;
const FAINT = 0.35;
const SLOWEST = 0.25, FASTEST = 1.5; // of a lesson

export async function stage(main, identity, wanted) {
  const [dance, body, offer] = await Promise.all([ask(`/api/dances/${identity}`), loadBody(), ask("/api/offer")]);
  if (!main.isConnected) return () => {}; // the page shows another view by now, which has the connection
  const beat_s = 60 / dance.bpm, sound = new Sound();
  const state = { running: false, ready: false, start: 0, start_s: 0, speed: 1, from_s: 0, to_s: dance.seconds, closed: false,
    place: null, practice: null, streak: 0, paused_s: null };
  const hands = new HandsHeld(), pointsOf = (total) => (total === null ? "–" : String(Math.round(total)));
  let members = [];
  const parts = controls(dance, offer, wanted);
  const song = songPanel(showSong), follows = el("p", { id: "follows" }), shown = panels(main, dance, parts, song.panel);
  const view = new View(shown.teacher), learner = new LearnerView(shown.learner);
  const lane = new Lane(shown.lane, dance.moves, beat_s, dance.free_s);
  const group = [dance, ...dance.others].map((one) => {
    const dancer = view.add(body, "teacher", one.place_m[0]);
    dancer.group.position.z = -one.place_m[1];
    return Object.assign(dancer, { movement: movementOf(one) });
  });
  if (group.length > 1) view.fit(group.map((one) => one.group.position));
  view.mirror(parts.mirrored.checked);
  const live = liveFor({ preparing, ready, frame, drawn, verdict, away, paused, back, done, error, lost });

  parts.start.addEventListener("click", () => (state.running ? stop("") : startAnew()));
  shown.beginNow.addEventListener("click", () => begin());
  parts.pause.addEventListener("click", ({ detail }) => {
    if (detail) parts.pause.blur(); // after the mouse, the space bar stops; after the keyboard it presses the button again
    pause();
  });
  parts.full.addEventListener("click", fullScreen);
  parts.practise.addEventListener("change", choosePractice);
  parts.mirrored.addEventListener("change", () => { view.mirror(parts.mirrored.checked); nameTaught(); });
  parts.music.addEventListener("change", () => { remember("music", parts.music.value); showSong(); });
  parts.phrase.addEventListener("change", () => { if (!state.running) showExcerpt(); });
  for (const one of [parts.dancer, parts.people, parts.source]) one.addEventListener("change", showDanced);
  const onKey = (event) => {
    const key = keyOf(event);
    if (event.ctrlKey || event.metaKey || event.altKey || (event.repeat && !key.startsWith("Arrow"))) return; // the browser's
    // A button keeps the focus after a click: only the space bar is its own then.
    const taken = key === " " ? "input, select, button, a, summary, audio" : "input:not([type=checkbox]), select, audio";
    if (event.target.closest(taken)) return;
    if (key === " ") parts.start.click();
    else if (key === "ArrowLeft") view.turn(-0.2);
    else if (key === "ArrowRight") view.turn(0.2);
    else if (key === "m") parts.mirrored.click();
    else if (key === "f") fullScreen();
    else if (key === "p") pause();
    else return;
    event.preventDefault();
  };
  document.addEventListener("keydown", onKey);
  const onDrag = (event) => {
    const [dropped] = event.dataTransfer.files;
    if (event.type === "drop" && dropped && !state.running) chooseSong(dropped);
    event.preventDefault();
  };
  for (const kind of ["dragover", "drop"]) document.addEventListener(kind, onDrag);
  song.panel.append(follows);
  showSong();
  showDanced();
  showExcerpt();
  requestAnimationFrame(animate);
  choosePractice();
  if (wanted.has("go")) startAnew();
  else if (handsFree()) live.send(watching(dance, parts.source.value));
  return () => {
    state.closed = true;
    document.removeEventListener("keydown", onKey);
    for (const kind of ["dragover", "drop"]) document.removeEventListener(kind, onDrag);
    sound.close();
    live.leave();
    view.close();
  };

  // Dancers of a group whom no learner dances are faint.
  function showDanced() {
    const all = taught(parts, peopleOf());
    group.forEach(({ mesh }, k) => {
      const danced = all.includes(k);
      Object.assign(mesh.material, { transparent: !danced, opacity: danced ? 1 : FAINT, needsUpdate: true });
    });
    Object.assign(lane, { moves: [dance, ...dance.others][all[0]].moves, shown: null });
    view.changed = true;
  }

  function showExcerpt() {
    const phrase = parts.phrase.value;
    state.from_s = phrase === "" ? 0 : Number(phrase) * dance.phrase_s;
    state.to_s = phrase === "" ? dance.seconds : Math.min(state.from_s + dance.phrase_s, dance.seconds);
  }

  // How much faster than at its own tempo the dance is, before the learner's choice of speed: it follows the song's beats. A
  // dance of the user's own was danced to its own song.
  function followed() {
    return parts.music.value === "song" && songTempo() && !dance.own ? tempoRatio(songTempo(), dance.bpm) : 1;
  }

  function chooseSong(file) {
    parts.music.value = "song";
    showSong();
    song.take(file);
  }

  function showSong() {
    song.panel.hidden = parts.music.value !== "song";
    follows.textContent = followed() === 1 ? "" : say("The dance follows it, at {percent} % of its own tempo.", { percent: Math.round(100 * followed()) });
  }

  function fullScreen() {
    if (document.fullscreenElement) document.exitFullscreen();
    else shown.stage.requestFullscreen?.().catch(({ message }) => { shown.error.textContent = message; });
  }

  // Practising is of one phrase: the first, unless one is chosen.
  function choosePractice() {
    if (parts.practise.value && parts.phrase.value === "" && parts.phrase.options.length > 1) parts.phrase.value = "0";
    if (!state.running) showExcerpt();
  }

  function startAnew() {
    state.practice = parts.practise.value ? new Practice(Number(parts.practise.value)) : null;
    state.place = new InPlace();
    shown.practice.textContent = state.practice
      ? say("slowed to {percent} %, faster when you reach {goal}", { percent: state.practice.speed, goal: state.practice.goal }) : "";
    shown.stage.scrollIntoView({ block: "nearest" });
    start();
  }

  function speed() {
    return clamp(Number(parts.speed.value) / 100 * followed(), SLOWEST, FASTEST);
  }

  // What another round may change: the lesson is prepared anew then.
  function asked() {
    return [speed(), parts.phrase.value, parts.skill.value, parts.fault.value, parts.seed.value, remembered("who", "")].join();
  }

  // What the server hears at the start alone, of whom and by what, stays as it is until the dance ends.
  function hold(running) {
    for (const one of [parts.mirrored, parts.dancer, parts.source, song.panel.querySelector("#song-file")]) one.disabled = running;
    parts.people.disabled = running || alone(parts.source.value);
  }

  function start() {
    if (state.practice) parts.speed.value = state.practice.speed;
    sound.wake();
    showExcerpt();
    Object.assign(state, { speed: speed(), asked: asked() });
    if (!state.practice) remember("speed", parts.speed.value);
    remember("source", parts.source.value);
    remember("people", Number(parts.people.value));
    showMembers();
    Object.assign(state, { running: true, ready: false, start: 0, paused_s: null });
    main.dataset.busy = "";
    parts.start.textContent = say("Stop");
    hold(true);
    shown.error.textContent = "";
    shown.preparing.hidden = false;
    live.send({
      do: "prepare",
      lesson: {
        dance: identity, source: parts.source.value, skill: parts.skill.value, fault: parts.fault.value, seed: Number(parts.seed.value) || 0,
        speed: state.speed, from_s: state.from_s, to_s: state.to_s, mirrored: parts.mirrored.checked,
        latency_s: latencyOf(parts.source.value) || 0, people: peopleOf(), dancer: Number(parts.dancer.value), who: remembered("who", ""),
      },
    });
  }

  // The camera goes on watching for a hand that points, unless this view is left, or it was the camera that failed.
  function stop(message, watches = true) {
    if (state.paused_s !== null) shown.words.textContent = ""; // how to go on
    if (state.practice) parts.speed.value = remembered("speed", 100);
    Object.assign(state, { running: false, ready: false, start: 0, place: null, practice: null, paused_s: null });
    delete main.dataset.busy;
    readWords(true);
    history.replaceState(null, "", location.hash.replace(/\bgo&|[?&]go$/, "")); // or it would begin by itself when one comes back
    shown.beginNow.hidden = true;
    clearTimeout(state.again);
    sound.stop();
    rest("");
    live.send(watches && handsFree() ? watching(dance, parts.source.value) : { do: "stop" });
    parts.start.textContent = say("Start");
    hold(false);
    shown.preparing.hidden = true;
    shown.count.textContent = shown.guide.textContent = "";
    shown.error.textContent = message;
  }

  // What can be chosen by hand just now: nothing while dancing.
  function choices() {
    const stopping = { id: "stop", text: say("Stop"), act: () => stop("") };
    if (state.paused_s !== null) return [{ id: "resume", text: say("Go on"), act: pause }, { id: "again", text: say("Dance again"), act: startAnew }, stopping];
    if (state.running) return state.start ? [] : [stopping];
    return [{ id: "start", text: say("Start"), act: startAnew },
      { id: "next", text: say("Next dance"), act: async () => { location.hash = `#/dance/${after(inOrder(await ask("/api/dances")), identity).identity}`; } },
      { id: "menu", text: say("To the dances"), act: () => { location.hash = "#/"; } }];
  }

  function preparing({ fraction, text }) {
    if (!state.running) return;
    shown.bar.value = fraction;
    tell(shown.preparingText, say(text));
  }

  function ready() {
    shown.preparing.hidden = true;
    if (!state.running) return undefined;
    if (!state.place) return begin(); // a person was
    shown.beginNow.hidden = false;
    return undefined;
  }

  // What is resumed goes on from the beat before, so that the counts, too, are on the dance's beats.
  function begin(what = "go", resumed_s = state.from_s) {
    const from_s = what === "resume" ? Math.max(Math.floor(resumed_s / beat_s + 1e-6) * beat_s, state.from_s) : resumed_s;
    const in_s = COUNTS * beat_s / state.speed + 0.3, ratio = followed();
    Object.assign(state, { ready: true, place: null, start: performance.now() + 1000 * in_s, start_s: from_s, reason: "", paused_s: null });
    shown.beginNow.hidden = true;
    shown.words.textContent = shown.verdict.textContent = "";
    readWords(false);
    if (what === "go") showStreak(0);
    live.send({ do: what, in_s: in_s + (resumed_s - from_s) / state.speed });
    sound.play({
      in_s: (state.start - performance.now()) / 1000, from_s, to_s: state.to_s, beat_s, speed: state.speed, counts: COUNTS,
      music: parts.music.value === "song" ? songAt(from_s / ratio, state.speed / ratio, identity) || "tick" : parts.music.value,
    });
  }

  // While one dances words change all the time, and a screen reader reads the verdicts alone.
  function readWords(on) {
    shown.words.ariaLive = on ? "polite" : "off";
  }

  function frame(content, picture) {
    if (!state.running && !handsFree()) return; // it was on its way when the dance was stopped
    const everybody = [content, ...(content.others || [])], all = everybody.every(({ joints }) => joints);
    const people = everybody.length > 1 ? everybody.map((one, k) => ({ ...one, outline: OF_LEARNERS[k] })) : everybody;
    learner.show(picture, { people }, parts.mirrored.checked);
    everybody.forEach(({ so_far, time_s }, k) => {
      if (members[k] && time_s !== null) [members[k].score.textContent, members[k].stars.textContent] = [pointsOf(so_far), starsOf(so_far)];
    });
    if (state.running) tell(shown.guide, say(content.guidance));
    if (state.place && !shown.beginNow.hidden) {
      tell(shown.words, say(all ? "there you are" : "stand before the camera: the dance begins when you are seen"));
      if (state.place.see({ ...content, joints: all ? content.joints : null }, performance.now())) begin();
    }
    if (hands.see(content.joints, performance.now(), state.speed)) pause();
    letChoose(choices());
    follow(content.joints, parts.mirrored.checked, performance.now());
    if (!state.running || content.time_s === null) return;
    shown.stars.textContent = starsOf(content.so_far);
    shown.score.textContent = pointsOf(content.so_far);
    tell(shown.words, say(content.words) === state.reason ? "" : say(content.words)); // the verdict says it already
    shown.bars.show(content.parts);
  }

  function notSaved(result) {
    return result.not_saved ? say(result.not_saved) : "";
  }

  // Another round, unless it is stopped before.
  function later(again) {
    clearTimeout(state.again);
    state.again = setTimeout(() => { if (state.running && !state.closed) again(); }, 1000 * AGAIN_S);
  }

  function drawn(age_ms) {
    shown.age.textContent = say("{ms} ms ago", { ms: Math.round(age_ms) });
  }

  function done(result) {
    if (!state.running) return undefined; // it was on its way when the dance was stopped
    sound.stop();
    readWords(true);
    shown.words.textContent = result.total === null ? say(result.hints[0]) : say("{total} of 100", { total: Math.round(result.total) });
    shown.score.textContent = result.total === null ? "–" : Math.round(result.total);
    shown.error.textContent = notSaved(result);
    if (state.practice && result.total !== null) {
      shown.practice.textContent = state.practice.after(result.total);
      if (state.practice.done) return finishPractice(notSaved(result));
      state.start = 0;
      later(start);
      return undefined;
    }
    if (parts.loop.checked && result.total !== null) {
      state.start = 0;
      shown.count.textContent = say("again");
      later(() => (asked() === state.asked ? begin() : start()));
      return undefined;
    }
    stop(result.total === null ? say(result.hints[0]) : notSaved(result), !result.session);
    if (result.session) location.hash = `#/dance/${identity}/try/${result.session}`;
    return undefined;
  }

  function finishPractice(message) {
    parts.practise.value = "";
    stop(message);
    shown.practice.append(" ", el("a", { href: `#/dance/${identity}?${asDanced({ dancer: parts.dancer.value, mirrored: parts.mirrored.checked })}`, onclick: () => { parts.phrase.value = ""; showExcerpt(); } }, say("Dance the whole dance")));
  }

  function showStreak(streak) {
    state.streak = streak;
    shown.streak.textContent = streak > 1 ? say("{count} in a row", { count: streak }) : "";
  }

  function verdict({ number, end_s, total, words, member = 0 }) {
    if (members[member]) members[member].verdict.textContent = [praise(total), say(words)].filter(Boolean).join(", ");
    if (member) return;
    const reason = say(words), after_ms = performance.now() - state.start - 1000 * (end_s - state.start_s) / state.speed;
    shown.verdict.dataset.afterMs = Math.round(after_ms);
    shown.verdict.replaceChildren(say("move {number}: ", { number }), el("b", {}, praise(total)), el("i", {}, reason ? ", " : ""), el("span", {}, reason));
    showStreak(streakAfter(state.streak, total));
    state.reason = reason;
    if (shown.words.textContent === reason) shown.words.textContent = "";
  }

  // How many dance beside each other, and a line for each where there are several: in a group also whom they dance.
  function peopleOf() {
    return alone(parts.source.value) ? 1 : Number(parts.people.value);
  }

  function nameTaught() {
    const all = taught(parts, peopleOf());
    shown.members.querySelectorAll("small").forEach((line, k) => { line.textContent = `${say("dancer")}: ${parts.dancer.options[all[k]].textContent} `; });
  }

  function showMembers() {
    members = peopleOf() > 1 ? OF_LEARNERS.slice(0, peopleOf()).map((colour) => ({ colour, score: el("b", {}, "–"), stars: el("i"), verdict: el("span") })) : [];
    shown.members.replaceChildren(...members.map(({ colour, score, stars, verdict: said }) => el("li", {}, swatch(colour), score, stars, " ", group.length > 1 ? el("small") : null, said)));
    nameTaught();
    shown.stage.classList.toggle("several", members.length > 0);
  }

  // The camera sends nothing: the dance stands still, and goes on when it is back.
  function away({ text }) {
    if (state.start) state.start_s += Math.max(performance.now() - state.start, 0) / 1000 * state.speed;
    state.start = 0;
    sound.stop();
    rest("");
    shown.guide.textContent = say(text);
    shown.count.textContent = "";
  }

  // Asks for a pause, or goes on after one.
  function pause() {
    if (state.paused_s !== null) begin("resume", state.paused_s);
    else if (state.start) live.send({ do: "pause" });
  }

  function paused({ from_s }) {
    if (!state.running) return;
    away({ text: "" });
    Object.assign(state, { paused_s: from_s, start_s: from_s });
    readWords(true);
    shown.words.textContent = say("paused: hands together above your head, or p, to go on");
  }

  function back({ from_s }) {
    shown.guide.textContent = "";
    if (state.running && state.paused_s === null && from_s !== null) begin("resume", from_s);
  }

  function error({ text }) {
    stop(say(text), false);
  }

  function lost() {
    const text = say("the teacher's program does not answer; is it still running?");
    if (state.running) stop(text, false);
    else if (handsFree()) rest(text);
  }

  function animate(now) {
    if (state.closed) return;
    const held = state.paused_s !== null;
    parts.pause.hidden = !held && !state.start;
    tell(parts.pause, say(held ? "Go on" : "Pause"));
    let time_s = state.ready ? state.start_s : state.from_s;
    if (state.start) {
      const left_s = (state.start - now) / 1000;
      time_s = state.start_s - left_s * state.speed;
      const beats = Math.ceil(left_s * state.speed / beat_s);
      shown.count.textContent = left_s > 0 && beats <= COUNTS ? String(COUNTS + 1 - beats) : "";
      shown.time.textContent = say("{time} of {end}", { time: clock(Math.min(Math.max(time_s, state.start_s), state.to_s)), end: clock(dance.seconds) });
    }
    view.draw(Math.min(Math.max(time_s, state.from_s), state.to_s));
    lane.draw(time_s, state.from_s, state.to_s, parts.mirrored.checked);
    live.draw();
    requestAnimationFrame(animate);
  }
}
