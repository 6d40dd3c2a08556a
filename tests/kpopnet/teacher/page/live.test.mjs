// The connection to the process that watches the learner.
import assert from "node:assert/strict";
import { beforeEach, test } from "node:test";

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
const { Live } = await import("../../../../kpopnet/teacher/page/live.js");

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

test("texts and frames reach who listens to their kind", () => {
  const live = listen(), text = new TextEncoder().encode(JSON.stringify({ kind: "frame", age_ms: 9 }));
  live.receive(JSON.stringify({ kind: "away", text: "plug it in" }));
  const message = new Uint8Array(4 + text.length + 6);
  new DataView(message.buffer).setUint32(0, text.length, true);
  message.set(text, 4);
  message.set([2, 0, 1, 0, 7, 8], 4 + text.length);
  live.receive(message.buffer);
  assert.deepEqual(said[0], ["away", { kind: "away", text: "plug it in" }]);
  assert.equal(said[1][1].age_ms, 9);
  assert.deepEqual([...said[1][2]], [2, 0, 1, 0, 7, 8]);
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
  live.close();
  for (const kind of ["preparing", "ready", "verdict", "away", "back", "done", "error"]) live.receive(JSON.stringify({ kind }));
  assert.deepEqual(said, []);
});
