// Where a raised hand points, and how long it has stayed there.
import { clamp } from "./tools.js";

const NECK = 1, HANDS = [6, 7], HIPS = [9, 10], ASPECT = 4 / 3, SURE = 0.25;
// Where a hand points, in lengths from neck to hips about the neck: half of the width, and top and bottom; a hand that hangs is below.
const SIDE = 1, TOP = -0.75, BOTTOM = 0.65, EDGE = 0.15;
const HOLD_MS = 1200, LOST_MS = 300;

// How long what an image shows has lasted since the image before: what happened in a longer gap was not seen.
export const lasted_ms = (before_ms, now_ms) => (before_ms === null ? 0 : Math.min(now_ms - before_ms, LOST_MS));

// Where the learner points in a picture as they see it, mirrored or not: [x, y] from 0 to 1 from the left and the top, and which hand;
// null where no hand is raised. Of two hands the one that points already, or the higher one.
export function pointed(joints, mirrored, before = null) {
  const known = (joint) => joints[joint][0] !== null && joints[joint][3] >= SURE;
  if (!joints || ![NECK, ...HIPS].every(known)) return null;
  const [neck_x, neck_y] = joints[NECK], [hips_x, hips_y] = [0, 1].map((axis) => (joints[HIPS[0]][axis] + joints[HIPS[1]][axis]) / 2);
  const long = Math.hypot(ASPECT * (hips_x - neck_x), hips_y - neck_y);
  const found = HANDS.filter((hand) => long > 0 && known(hand)).map((hand) => {
    const across = ASPECT * (joints[hand][0] - neck_x) / long, down = (joints[hand][1] - neck_y) / long;
    return { hand, x: 0.5 + (mirrored ? -across : across) / (2 * SIDE), y: (down - TOP) / (BOTTOM - TOP) };
  }).filter(({ x, y }) => [x, y].every((one) => one >= -EDGE) && x <= 1 + EDGE && y <= 1);
  if (!found.length) return null;
  const { hand, x, y } = found.find((one) => one.hand === before) || found.reduce((a, b) => (b.y < a.y ? b : a));
  return { hand, x: clamp(x, 0, 1), y: clamp(y, 0, 1) };
}

// Holding: what is pointed at for HOLD_MS is chosen, once until something else is; a hand that is lost for a moment is held still.
// Where other things are offered, the one that appears under the hand must be left first.
export class Dwell {
  constructor() {
    this.renew();
  }

  renew() {
    Object.assign(this, { over: null, held_ms: 0, seen_ms: null, left_ms: null, blocked: undefined });
  }

  // over: what is pointed at, null for nothing. Returns what has been chosen now, or null.
  see(over, now_ms) {
    const passed_ms = lasted_ms(this.seen_ms, now_ms);
    this.seen_ms = now_ms;
    if (this.blocked === undefined && over !== null) this.blocked = over;
    if (over === null && this.over !== null) {
      this.left_ms ??= now_ms;
      if (now_ms - this.left_ms < LOST_MS) return null;
    }
    this.left_ms = null;
    if (over !== this.over) Object.assign(this, { over, held_ms: 0 });
    else if (over !== null) this.held_ms += passed_ms;
    if (over !== this.blocked) this.blocked = null;
    if (over === null || over === this.blocked || this.held_ms < HOLD_MS) return null;
    this.blocked = over;
    return over;
  }

  // From 0 to 1: how much of the time is over.
  get progress() {
    return this.over === null || this.over === this.blocked ? 0 : clamp(this.held_ms / HOLD_MS, 0, 1);
  }
}
