// The thread of MediaPipe's pose, whose program the test plays.
import assert from "node:assert/strict";
import { test } from "node:test";

const said = [], imported = [], heard = [], closed = [];
let onFound, listen;
Object.assign(globalThis, {
  importScripts: (src) => imported.push(src),
  postMessage: (message) => said.push(message),
  addEventListener: (_, listener) => { listen = listener; },
  OffscreenCanvas: class {
    getContext(kind) { return kind === "webgl" ? {} : null; }
  },
  Pose: class {
    setOptions(options) { heard.push(options); }

    onResults(found) { onFound = found; }

    async initialize() {
      this.started ||= new Promise((take) => {
        const script = document.createElement("script");
        script.setAttribute("src", "wasm.js");
        script.addEventListener("load", take);
        document.body.appendChild(script);
      });
      await this.started;
    }

    reset() { heard.push("anew"); }

    async send({ image }, at_ms) {
      if (!image.points) throw new Error("out of memory");
      heard.push(at_ms);
      await new Promise((go) => { setTimeout(go, image.takes_ms); });
      onFound({ poseLandmarks: image.points, poseWorldLandmarks: image.points, image: { close: () => closed.push("seen") } });
    }
  },
});
await import("../../../../kpopnet/teacher/page/pose_worker.js");

test("messages are answered in their order, whatever one takes, and a failure in words", async () => {
  const close = () => closed.push("picture");
  for (const data of [
    { anew: true }, { picture: { points: [1], takes_ms: 20, close }, at_ms: 30 }, { picture: { close }, at_ms: 60 }, { picture: { points: [2], takes_ms: 0, close }, at_ms: 90 },
  ]) listen({ data });
  while (said.length < 4) await new Promise((go) => { setTimeout(go, 5); });
  const points = (value) => ({ found: { poseLandmarks: [value], poseWorldLandmarks: [value] } });
  assert.deepEqual(said, [{ found: {} }, points(1), { error: "out of memory" }, points(2)]);
  assert.deepEqual(heard.slice(1), ["anew", 30, 90]);
  await new Promise((go) => { setTimeout(go); });
  assert.deepEqual(closed, ["seen", "picture", "picture", "seen", "picture"]); // a browser keeps what is not closed for long
  assert.equal(heard[0].smoothLandmarks, false);
  assert.deepEqual(imported, ["vendor/mediapipe/pose.js", "wasm.js"]);
});

test("without WebGL in the thread every message is answered by what the browser lacks", async () => {
  const before = said.length, { getContext } = OffscreenCanvas.prototype;
  OffscreenCanvas.prototype.getContext = () => null;
  await import("../../../../kpopnet/teacher/page/pose_worker.js?without");
  OffscreenCanvas.prototype.getContext = getContext;
  listen({ data: { anew: true } });
  while (said.length === before) await new Promise((go) => { setTimeout(go, 5); });
  assert.match(said.at(-1).error, /no WebGL in its threads/);
});

test("the program gets a canvas of this thread, and its alert is an error", () => {
  assert.ok(document.createElement("canvas") instanceof OffscreenCanvas);
  assert.throws(() => alert("no WebGL"), /no WebGL/);
});
