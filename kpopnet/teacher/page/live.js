// The connection to the process that watches.
import { clamp } from "./tools.js";
import { WEBCAM, Webcam } from "./webcam.js";

// How far the server's clock is ahead of this page's, in milliseconds: not at all, as on one machine, unless messages show
// otherwise. One of the page is heard after it was sent, and one of the server arrives after it was sent: two bounds.
export class ServerClock {
  constructor() {
    [this.least, this.most] = [-Infinity, Infinity];
  }

  heard([page_ms, server_ms]) {
    this.most = Math.min(this.most, server_ms - page_ms);
    if (this.most < this.least) this.least = -Infinity; // of before a clock was set
  }

  arrived(server_ms, page_ms) {
    this.least = Math.max(this.least, server_ms - page_ms);
    if (this.least > this.most) this.most = Infinity;
  }

  // How long ago a moment of the server was at one of this page, in milliseconds.
  since(server_ms, page_ms) {
    return page_ms + clamp(0, this.least, this.most) - server_ms;
  }
}

export class Live {
  constructor(on) {
    this.on = on;
    this.socket = this.newest = this.webcam = null;
  }

  send(message) {
    if (message.do === "prepare" || message.do === "stop") this.watch(message.lesson?.source === WEBCAM);
    const text = JSON.stringify(message);
    this.connect();
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(text);
    else this.socket.addEventListener("open", () => this.socket.send(text));
  }

  // Opens this browser's webcam for a lesson whose source it is, and closes it at its end.
  watch(wanted) {
    this.webcam?.close();
    this.webcam = wanted ? new Webcam((points, age_ms) => this.send({ do: "see", points, age_ms }), (text) => this.on.error({ text })) : null;
  }

  connect() {
    if (this.socket) return;
    this.clock = new ServerClock();
    this.socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/live`);
    this.socket.binaryType = "arraybuffer";
    this.socket.addEventListener("message", ({ data }) => this.receive(data));
    this.socket.addEventListener("close", () => {
      this.socket = this.newest = null;
      this.watch(false);
      this.on.lost();
    });
  }

  receive(data) {
    if (typeof data === "string") {
      this.draw(); // first, as the server sent it first
      const message = JSON.parse(data);
      return this.on[message.kind](message);
    }
    const length = new DataView(data).getUint32(0, true);
    const frame = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length)));
    this.clock.arrived(frame.sent_ms, Date.now());
    if (frame.heard_ms) this.clock.heard(frame.heard_ms);
    this.newest = [frame, new Uint8Array(data, 4 + length)];
    return undefined;
  }

  // Draws the newest image if it is not drawn yet. The server sends another one when it hears of it: none waits for a slow page.
  draw() {
    if (!this.newest) return;
    const [frame, picture] = this.newest;
    this.newest = null;
    const age_ms = this.clock.since(frame.taken_ms, Date.now());
    this.on.frame(frame, this.webcam?.pictureOf(performance.now() - age_ms) || picture);
    const page_ms = Date.now();
    this.on.drawn(this.clock.since(frame.taken_ms, page_ms));
    if (this.socket) this.send({ do: "drawn", page_ms });
  }

  // Ends the lesson; nothing of it is heard any more.
  leave() {
    this.on = hearing({});
    this.newest = null;
    if (this.socket) this.send({ do: "stop" });
  }
}

// Listeners, of which some may be missing.
const hearing = (on) => new Proxy(on, { get: (all, kind) => all[kind] || (() => {}) });
let shared = null;

// The page's one connection, which views hand on: one lesson has ended, and let go of the camera, before the next begins.
export function liveFor(on) {
  shared ||= new Live(on);
  shared.on = hearing(on);
  return shared;
}
