// The lane: cards of the coming moves and the beats, which move with the dance; a card meets the line when the teacher is in its pose.
import { sketch } from "./sketch.js";
import { clamp } from "./tools.js";
import { say } from "./words.js";

const LINE = 0.12; // where now is, from the left
const BEAT_PX = 84, PHRASE_BEATS = 8;
const EVERY_MS = 30;
const CARD = 0.84, PASSED_BEATS = 1.5;

// Where a time of the dance lies on a lane of this width, in pixels.
export const laneX = (at_s, time_s, beat_s, width) => LINE * width + BEAT_PX * (at_s - time_s) / beat_s;

export class Lane {
  // moves: at_s and points_cm of the pose of each move; free_s: from when to when all may dance what they like.
  constructor(canvas, moves, beat_s, free_s) {
    Object.assign(this, { canvas, moves, beat_s, free_s, shown: null, next: 0 });
  }

  draw(time_s, from_s, to_s, mirrored) {
    const { clientWidth: width, clientHeight: height } = this.canvas, now_ms = performance.now();
    const style = getComputedStyle(this.canvas), colour = (name) => style.getPropertyValue(`--${name}`);
    const key = [time_s, from_s, to_s, width, height, mirrored, colour("ink")].join();
    if (key === this.shown || !width || now_ms < this.next) return;
    [this.shown, this.next] = [key, now_ms + EVERY_MS];
    const ratio = Math.min(devicePixelRatio, 2), pen = this.canvas.getContext("2d");
    if (this.canvas.width !== Math.round(width * ratio) || this.canvas.height !== Math.round(height * ratio)) {
      [this.canvas.width, this.canvas.height] = [Math.round(width * ratio), Math.round(height * ratio)];
    }
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    const at = (one_s) => laneX(one_s, time_s, this.beat_s, width), inside = (x) => x > -height && x < width + height;
    for (const [begin_s, end_s] of this.free_s) {
      const [left, right] = [begin_s, end_s].map((one_s) => clamp(at(clamp(one_s, from_s, to_s)), 0, width));
      pen.fillStyle = colour("bar");
      pen.fillRect(left, height * 0.1, right - left, height * 0.76);
      pen.fillStyle = colour("ink");
      pen.font = `${height * 0.3}px sans-serif`;
      pen.textAlign = "center";
      pen.textBaseline = "middle";
      pen.fillText(say("free"), (left + right) / 2, height * 0.48, right - left);
    }
    for (let beat = Math.ceil(from_s / this.beat_s - 1e-6); beat * this.beat_s < to_s + 1e-6; beat++) {
      const x = at(beat * this.beat_s), first = beat % PHRASE_BEATS === 0;
      if (!inside(x)) continue;
      pen.fillStyle = colour(first ? "quiet" : "line");
      pen.fillRect(x - 1, first ? 0 : height * 0.86, first ? 3 : 2, height);
    }
    const since = ((time_s / this.beat_s) % 1 + 1) % 1, wide = 3 + 5 * (1 - since) ** 2; // it beats
    pen.fillStyle = colour("accent");
    pen.fillRect(LINE * width - wide / 2, 0, wide, height); // behind the pose that is due
    for (const { at_s, points_cm } of this.moves) {
      const x = at(at_s), passed = (time_s - at_s) / this.beat_s;
      if (!inside(x) || at_s < from_s || at_s > to_s || passed > PASSED_BEATS) continue;
      if (this.free_s.some(([begin_s, end_s]) => at_s >= begin_s && at_s < end_s)) continue;
      const now = Math.abs(passed) < 0.5, size = height * CARD;
      pen.globalAlpha = passed > 0 ? 1 - passed / PASSED_BEATS : 1;
      pen.beginPath();
      pen.roundRect(x - size * 0.4, (height - size) / 2, size * 0.8, size, 8);
      pen.fillStyle = colour(now ? "accent" : "bar");
      pen.fill();
      sketch(pen, points_cm, { x, y: height / 2, scale: size / 205, ink: colour(now ? "on-accent" : "ink"), mirrored });
    }
    pen.globalAlpha = 1;
  }
}
