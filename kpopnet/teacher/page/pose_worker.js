// MediaPipe's pose in a thread of its own: the page is drawn and hears the scores while a picture is looked at.
const VENDOR = "vendor/mediapipe/";

class Script extends EventTarget {
  setAttribute(name, value) {
    this[name] = value;
  }
}

// MediaPipe's program is one for pages: it adds scripts to a document, which are imported here, draws on a canvas of it, and
// alerts where the browser has no WebGL.
globalThis.window = globalThis;
globalThis.alert = (text) => { throw new Error(text); };
globalThis.document = {
  createElement: (kind) => (kind === "canvas" ? new OffscreenCanvas(1, 1) : new Script()),
  body: {
    appendChild(script) {
      importScripts(script.src);
      script.dispatchEvent(new Event("load"));
    },
  },
};

const canDraw = ["webgl2", "webgl"].some((kind) => new OffscreenCanvas(1, 1).getContext(kind));
importScripts(`${VENDOR}pose.js`);
const pose = new globalThis.Pose({ locateFile: (name) => VENDOR + name });
// Its smoothing over time would delay the points; the scorer has its own.
pose.setOptions({ modelComplexity: 0, smoothLandmarks: false, useCpuInference: true });
let found = {};
pose.onResults(({ image, poseLandmarks, poseWorldLandmarks }) => {
  image?.close();
  found = { poseLandmarks, poseWorldLandmarks };
});

// Answers each message, in their order: {anew} forgets who was seen, {picture, at_ms} finds the points of a picture.
async function answer({ anew, picture, at_ms }) {
  try {
    if (!canDraw) throw new Error("this browser has no WebGL in its threads; recent versions of Chrome, Edge, Firefox and Safari have");
    await pose.initialize();
    if (anew) pose.reset();
    if (picture) await pose.send({ image: picture }, at_ms);
    globalThis.postMessage({ found });
  } catch (error) {
    globalThis.postMessage({ error: String(error?.message || error) });
  } finally {
    picture?.close();
  }
}

let last = Promise.resolve();
globalThis.addEventListener("message", ({ data }) => { last = last.then(() => answer(data)); });
