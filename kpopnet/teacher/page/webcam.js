// The webcam of this browser as a learner's eye. MediaPipe's pose finds points of the body here; the points alone are sent.
import { el } from "./tools.js";
import { say } from "./words.js";

export const WEBCAM = "webcam";
const WITHOUT_DEPTH = "A webcam sees no depth: its scores are less sure. A depth camera adds places in metres, limbs in front of "
  + "or behind the body, and works in any light. The picture stays in this browser.";

const WIDTH = 640, HEIGHT = 480, KEPT = 8;
const OLDEST_MS = 60000; // as of before the computer slept: the server takes no older ones, and would end the lesson
const REFUSALS = {
  NotAllowedError: "the browser may not use the webcam; allow it beside the address of this page, then try again",
  NotFoundError: "no webcam was found; plug one in, or choose another camera",
  NotReadableError: "the webcam is used by another program; close that one, then try again",
};
const DIGITS = 4;

// The line that says what depth would add, as long as a webcam is chosen in a select of sources.
export function withoutDepth(source) {
  const line = el("p", { class: "quiet", id: "without-depth" }, say(WITHOUT_DEPTH));
  const show = () => { line.hidden = source.value !== WEBCAM; };
  source.addEventListener("change", show);
  show();
  return line;
}

// What the server is told of one picture: for each of MediaPipe's 33 points x, y, z in metres about the hips, its place in the
// picture from 0 to 1, and how visible it is, 0 outside the picture; [] without a person. `bars` is the share of the letterboxed
// picture's width and height that is no picture.
export function pointsOf({ poseLandmarks, poseWorldLandmarks }, bars = [0, 0]) {
  if (!poseLandmarks || !poseWorldLandmarks) return [];
  return poseWorldLandmarks.map(({ x, y, z }, k) => {
    const { x: u, y: v, visibility } = poseLandmarks[k];
    const inside = [u, v].every((place, axis) => place >= bars[axis] / 2 && place <= 1 - bars[axis] / 2);
    return [x, y, z, u, v, inside ? visibility : 0].map((value) => Number(value.toFixed(DIGITS)));
  });
}

export class Webcam {
  // seen(points, age_ms) is told of each picture, age_ms after it was taken; failed(text) why there are none.
  constructor(seen, failed) {
    Object.assign(this, { seen, failed, closed: false });
    // The last pictures, when each was taken in milliseconds of `performance.now`, the one that is looked at at the end.
    this.pictures = Array.from({ length: KEPT }, () => ({ taken: -Infinity, canvas: Object.assign(document.createElement("canvas"), { width: WIDTH, height: HEIGHT }) }));
    this.video = Object.assign(document.createElement("video"), { muted: true, playsInline: true });
    this.watch().catch((error) => this.closed
      || failed(REFUSALS[error.name] ? say(REFUSALS[error.name]) : say("the webcam failed: {reason}", { reason: error.message })));
  }

  async watch() {
    if (!navigator.mediaDevices) throw new Error(say("browsers give it to pages of their own machine alone; open http://127.0.0.1 there"));
    const wanted = { width: { ideal: WIDTH }, height: { ideal: HEIGHT }, frameRate: { ideal: 30 } };
    this.stream = await navigator.mediaDevices.getUserMedia({ video: wanted, audio: false });
    if (this.closed) return this.close();
    for (const track of this.stream.getTracks()) track.addEventListener("ended", () => this.closed || this.failed(say(REFUSALS.NotFoundError)));
    this.video.srcObject = this.stream;
    const [pose] = await Promise.all([loadPose(), this.video.play()]);
    await pose.anew();
    while (!this.closed) {
      const taken = await nextPicture(this.video);
      const bars = this.draw(taken), found = await pose.find(this.picture), age_ms = Math.max(performance.now() - taken, 0);
      if (!this.closed && age_ms < OLDEST_MS) this.seen(pointsOf(found, bars), age_ms);
    }
    return undefined;
  }

  get picture() {
    return this.pictures.at(-1).canvas;
  }

  // The picture taken at a moment: joints are drawn over the one in which they were found.
  pictureOf(taken) {
    return this.pictures.reduce((best, one) => (Math.abs(one.taken - taken) < Math.abs(best.taken - taken) ? one : best)).canvas;
  }

  // The whole of the video in the middle of the oldest picture, which becomes the newest; returns the share of the picture's width
  // and height beside it.
  draw(taken) {
    this.pictures.push(Object.assign(this.pictures.shift(), { taken }));
    const { videoWidth, videoHeight } = this.video, zoom = Math.min(WIDTH / videoWidth, HEIGHT / videoHeight);
    const [wide, high] = [zoom * videoWidth, zoom * videoHeight];
    this.picture.getContext("2d").drawImage(this.video, (WIDTH - wide) / 2, (HEIGHT - high) / 2, wide, high);
    return [1 - wide / WIDTH, 1 - high / HEIGHT];
  }

  close() {
    this.closed = true;
    for (const track of this.stream?.getTracks() || []) track.stop();
  }
}

// Waits for the next picture of a video; returns when it was taken, in milliseconds of `performance.now`.
function nextPicture(video) {
  return new Promise((take) => {
    video.requestVideoFrameCallback((now, { captureTime }) => take(captureTime ?? now));
  });
}

// MediaPipe's pose with its small network, in a thread of its own.
class Pose {
  constructor() {
    Object.assign(this, { waiting: [], failed: null });
    this.worker = new Worker(new URL("pose_worker.js", import.meta.url));
    this.worker.addEventListener("message", ({ data }) => {
      if (data.error) this.fail(say(data.error));
      else this.waiting.shift()[0](data.found);
    });
    this.worker.addEventListener("error", ({ message }) => this.fail(message || say("the teacher's program does not answer; is it still running?")));
  }

  // Whoever asked or asks is told; the next lesson begins another one.
  fail(text) {
    this.worker.terminate();
    [this.failed, loaded] = [new Error(text), null];
    for (const [, refuse] of this.waiting.splice(0)) refuse(this.failed);
  }

  ask(message, handed = []) {
    return new Promise((take, refuse) => {
      if (this.failed) throw this.failed;
      this.waiting.push([take, refuse]);
      this.worker.postMessage(message, handed);
    });
  }

  // Forgets who was seen.
  anew() {
    return this.ask({ anew: true });
  }

  // What is found in a canvas, for `pointsOf`; at_ms is the picture's time on any clock that goes forward.
  async find(canvas, at_ms) {
    const picture = await createImageBitmap(canvas);
    return this.ask({ picture, at_ms: at_ms ?? performance.now() }, [picture]);
  }
}

let loaded = null;

// The pose of the page, which takes a second to begin.
export function loadPose() {
  loaded ||= (async () => {
    const pose = new Pose();
    await pose.anew();
    return pose;
  })();
  return loaded;
}
