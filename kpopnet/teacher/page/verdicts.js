// What is made of the scores of the moves while dancing: words, stars and the streak; whether a person is in place to begin, or
// asks for a pause.
import { lasted_ms } from "./pointing.js";
import { say } from "./words.js";

const PRAISE = [[90, "verdict|perfect"], [75, "verdict|great"], [55, "verdict|good"], [30, "keep going"], [-Infinity, "watch the teacher"]];
const STARS_FROM = [30, 50, 65, 80, 90];
const STREAK_FROM = 75;
const HELD_MS = 1500, ASPECT = 4 / 3, HEAD = 0, NECK = 1, RIGHT_HAND = 6, LEFT_HAND = 7, TORSO = 8;
const STEADY_MS = 1000, HINTED_MS = 8000;

export function praise(total) {
  return say(total === null ? "not seen" : PRAISE.find(([from]) => total >= from)[1]);
}

export function starsOf(total) {
  const count = STARS_FROM.filter((from) => total >= from).length;
  return "★".repeat(count) + "☆".repeat(STARS_FROM.length - count);
}

// How many moves in a row were great, by the score of the latest.
export const streakAfter = (streak, total) => (total !== null && total >= STREAK_FROM ? streak + 1 : 0);

// For how long something holds, from the first image that shows it on; null while none does.
const longer = (before_ms, holds, passed_ms) => (holds ? (before_ms === null ? 0 : before_ms + passed_ms) : null);

// In place is who is seen for a second without a word of where to stand, or for eight in spite of one: a room may allow no better.
export class InPlace {
  constructor() {
    this.last_ms = this.seen_ms = this.good_ms = null;
  }

  see({ joints, guidance }, now_ms) {
    const passed_ms = lasted_ms(this.last_ms, now_ms);
    this.last_ms = now_ms;
    this.seen_ms = longer(this.seen_ms, joints, passed_ms);
    this.good_ms = longer(this.good_ms, joints && !guidance, passed_ms);
    return (this.good_ms ?? 0) >= STEADY_MS || (this.seen_ms ?? 0) >= HINTED_MS;
  }
}

// Hands together above the head, held: once each time. In 50 dances of the collection that is at most 0.9 s; a slowed dance holds
// it longer, and so must who asks for a pause.
export class HandsHeld {
  constructor() {
    this.last_ms = this.held_ms = null;
  }

  see(joints, now_ms, speed) {
    const at = (joint) => [ASPECT * joints[joint][0], joints[joint][1]];
    const far = (a, b) => Math.hypot(...at(a).map((value, axis) => value - at(b)[axis]));
    const together = joints && [RIGHT_HAND, LEFT_HAND].every((hand) => joints[hand][1] !== null && joints[hand][1] < joints[HEAD][1])
      && far(RIGHT_HAND, LEFT_HAND) < far(NECK, TORSO);
    this.held_ms = longer(this.held_ms, together, lasted_ms(this.last_ms, now_ms));
    this.last_ms = now_ms;
    if (!together || !(this.held_ms >= HELD_MS / Math.min(speed, 1))) return false;
    this.held_ms = -Infinity; // until they are let go
    return true;
  }
}
