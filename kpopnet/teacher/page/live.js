// The connection to the process that watches.

export class Live {
  constructor(on) {
    this.on = on;
    this.socket = null;
  }

  send(message) {
    const text = JSON.stringify(message);
    this.connect();
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(text);
    else this.socket.addEventListener("open", () => this.socket.send(text), { once: true });
  }

  connect() {
    if (this.socket) return;
    this.socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/live`);
    this.socket.binaryType = "arraybuffer";
    this.socket.addEventListener("message", ({ data }) => this.receive(data));
    this.socket.addEventListener("close", () => {
      this.socket = null;
      this.on.lost();
    });
  }

  receive(data) {
    if (typeof data === "string") {
      const message = JSON.parse(data);
      return this.on[message.kind](message);
    }
    const length = new DataView(data).getUint32(0, true);
    const frame = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length)));
    return this.on.frame(frame, new Uint8Array(data, 4 + length));
  }

  close() {
    if (this.socket) {
      this.on = new Proxy({}, { get: () => () => {} });
      this.socket.close();
    }
  }
}
