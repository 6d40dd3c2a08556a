// The connection to the process that watches the learner.
import assert from "node:assert/strict";
import { beforeEach, test } from "node:test";
import "./dom.mjs";

class Socket {
  static CONNECTING = 0;
  static OPEN = 1;
  static made = [];

  constructor(address) {
    Object.assign(this, { address, readyState: Socket.CONNECTING, sent: [], listeners: {} });
    Socket.made.push(this);
  }

  addEventListener(kind, listener) {
    (this.listeners[kind] ||= []).push(listener);
  }

  happen(kind, event) {
    if (kind === "open") this.readyState = Socket.OPEN;
    for (const listener of this.listeners[kind] || []) listener(event);
  }

  send(text) {
    this.sent.push(JSON.parse(text));
  }

  close() {
    this.happen("close");
  }
}
globalThis.WebSocket = Socket;
globalThis.location = { protocol: "http:", host: "127.0.0.1:1" };
const PAGE = "../../../../kpopnet/teacher/page/";
const { Live, ServerClock, liveFor } = await import(`${PAGE}live.js`);

let said;
const listen = () => new Live(new Proxy({}, { get: (_, kind) => (...content) => said.push([kind, ...content]) }));

beforeEach(() => {
  said = [];
  Socket.made = [];
});

test("what is said before the connection stands is sent in order", () => {
  const live = listen();
  live.send({ do: "prepare" });
  live.send({ do: "go" });
  assert.equal(Socket.made.length, 1);
  assert.equal(Socket.made[0].address, "ws://127.0.0.1:1/live");
  Socket.made[0].happen("open");
  live.send({ do: "stop" });
  assert.deepEqual(Socket.made[0].sent.map((one) => one.do), ["prepare", "go", "stop"]);
});

function frameOf(content) {
  const text = new TextEncoder().encode(JSON.stringify({ kind: "frame", ...content })), message = new Uint8Array(4 + text.length + 6);
  new DataView(message.buffer).setUint32(0, text.length, true);
  message.set(text, 4);
  message.set([2, 0, 1, 0, 7, 8], 4 + text.length);
  return message.buffer;
}

test("of the images that have come the newest alone is drawn, and the server hears of it", () => {
  const live = listen();
  live.send({ do: "prepare" });
  Socket.made[0].happen("open");
  const ahead_ms = 5000, now_ms = Date.now();
  live.receive(frameOf({ taken_ms: 0, sent_ms: ahead_ms + now_ms - 20, heard_ms: null }));
  live.receive(frameOf({ taken_ms: ahead_ms + now_ms - 40, sent_ms: ahead_ms + now_ms, heard_ms: [now_ms - 9, ahead_ms + now_ms - 9] }));
  assert.deepEqual(said, []);
  live.draw();
  live.draw();
  assert.deepEqual(said.map(([kind]) => kind), ["frame", "drawn"]);
  assert.deepEqual([...said[0][2]], [2, 0, 1, 0, 7, 8]);
  assert.ok(said[1][1] >= 40 - 1 && said[1][1] < 1000, said[1][1]);
  const [, drawn, ...others] = Socket.made[0].sent;
  assert.equal(drawn.do, "drawn");
  assert.ok(drawn.page_ms >= now_ms && others.length === 0);
});

test("an image of a server whose clock is behind is as old as it is", () => {
  const live = listen(), now_ms = Date.now(), behind_ms = 5000;
  live.send({ do: "prepare" });
  Socket.made[0].happen("open");
  live.receive(frameOf({ taken_ms: now_ms - behind_ms - 40, sent_ms: now_ms - behind_ms, heard_ms: [now_ms - 9, now_ms - behind_ms - 9] }));
  live.draw();
  assert.ok(said[1][1] >= 40 - 1 && said[1][1] < 1000, said[1][1]);
});

test("a text is followed after the image that came before it", () => {
  const live = listen();
  live.send({ do: "prepare" });
  Socket.made[0].happen("open");
  live.receive(frameOf({ taken_ms: 0, sent_ms: 1, heard_ms: null }));
  live.receive(JSON.stringify({ kind: "away", text: "plug it in" }));
  assert.deepEqual(said.map(([kind]) => kind), ["frame", "drawn", "away"]);
  assert.deepEqual(said[2][1], { kind: "away", text: "plug it in" });
});

test("a page that came encrypted connects so; a new connection has a clock of its own, and an image of a lesson that was left is not drawn", () => {
  location.protocol = "https:";
  const live = listen(), now_ms = Date.now();
  live.send({ do: "prepare" });
  assert.equal(Socket.made[0].address, "wss://127.0.0.1:1/live");
  Object.assign(location, { protocol: "http:" });
  Socket.made[0].happen("open");
  live.receive(frameOf({ taken_ms: 0, sent_ms: now_ms + 9000000, heard_ms: null })); // a server whose clock is hours ahead
  live.leave();
  live.on = new Proxy({}, { get: (_, kind) => (...content) => said.push([kind, ...content]) });
  live.draw();
  assert.deepEqual(said, []);
  Socket.made[0].happen("close");
  live.send({ do: "prepare" });
  Socket.made[1].happen("open");
  live.receive(frameOf({ taken_ms: now_ms - 40, sent_ms: now_ms, heard_ms: null }));
  live.draw();
  assert.ok(said.at(-1)[1] >= 39 && said.at(-1)[1] < 1000, `${said.at(-1)}`);
});

test("the clocks are compared by the quickest messages", () => {
  const clock = new ServerClock(), ahead_ms = 1234;
  assert.equal(clock.since(60, 100), 40);
  for (const [sent_ms, took_ms] of [[0, 300], [100, 4], [200, 90]]) clock.heard([sent_ms, sent_ms + took_ms + ahead_ms]);
  for (const [sent_ms, took_ms] of [[10, 700], [110, 6], [210, 50]]) clock.arrived(sent_ms + ahead_ms, sent_ms + took_ms);
  assert.ok(Math.abs(clock.since(ahead_ms + 100, 180) - 80) <= 6);
  const same = new ServerClock();
  same.heard([0, 300]);
  same.arrived(10, 710);
  assert.equal(same.since(60, 100), 40); // late messages do not move clocks that agree
});

test("a clock that is set is known again after a few messages", () => {
  for (const ahead_ms of [0, 1234]) for (const set_ms of [-10000, 10000]) {
    const clock = new ServerClock();
    let at_ms = 0, step_ms = 0, heard = null;
    const images = () => { // one tells that the page has drawn the one before
      for (let k = 0; k < 5; k++) {
        clock.arrived(at_ms + ahead_ms, at_ms + 3 + step_ms);
        if (heard) clock.heard(heard);
        heard = [at_ms + 10 + step_ms, at_ms + 13 + ahead_ms];
        at_ms += 33;
      }
    };
    images();
    step_ms = set_ms;
    images();
    assert.ok(Math.abs(clock.since(at_ms + ahead_ms, at_ms + 40 + step_ms) - 40) <= 3, `${ahead_ms} ${set_ms}`);
  }
});

test("a lost connection is told, and the next message makes another one", () => {
  const live = listen();
  live.send({ do: "prepare" });
  Socket.made[0].happen("open");
  Socket.made[0].happen("close");
  assert.deepEqual(said, [["lost"]]);
  live.send({ do: "prepare" });
  assert.equal(Socket.made.length, 2);
});

test("who leaves hears nothing more, whatever kind it is", () => {
  const live = listen();
  live.send({ do: "prepare" });
  Socket.made[0].happen("open");
  live.leave();
  for (const kind of ["preparing", "ready", "verdict", "away", "back", "done", "error"]) live.receive(JSON.stringify({ kind }));
  assert.deepEqual(said, []);
  assert.equal(Socket.made[0].sent.at(-1).do, "stop");
});

test("views hand on one connection, and hear what they listen for alone", () => {
  const first = liveFor({}), heard = [];
  first.send({ do: "prepare" });
  first.leave();
  const second = liveFor({ done: (message) => heard.push(message.kind) });
  second.send({ do: "prepare" });
  for (const kind of ["ready", "done"]) second.receive(JSON.stringify({ kind }));
  assert.deepEqual([Socket.made.length, heard], [1, ["done"]]);
});

test("a view that arrives when the page shows another one leaves that one's connection and lesson alone", async () => {
  const answers = { "/api/dances": [{ seconds: 60, name: "a" }], "/api/body": { vertices_m: "", faces: "", weight_bones: "", weights: "" } };
  globalThis.fetch = async (path) => Response.json(answers[path] || { sources: {}, others: [] });
  const heard = [], shown = liveFor({ error: ({ text }) => heard.push(text) });
  shown.send({ do: "prepare" });
  const sent = shown.socket.sent.length;
  for (const name of ["stage", "calibrate", "menu"]) {
    const { [name]: late } = await import(`${PAGE}${name}.js`);
    (await late({ isConnected: false }, "a", new URLSearchParams("go")))();
  }
  shown.receive(JSON.stringify({ kind: "error", text: "camera" }));
  assert.deepEqual([heard, shown.socket.sent.length], [["camera"], sent]);
});
