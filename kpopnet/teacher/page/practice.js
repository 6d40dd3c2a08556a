// Practising one phrase: slowed down, faster each time that it reaches the goal, slower again where it fails by far.
import { say } from "./words.js";

export const STEPS = [75, 90, 100], GOALS = [60, 70, 80, 90], GOAL = 80;
const FAR = 25;

export class Practice {
  constructor(goal) {
    Object.assign(this, { goal, step: 0, done: false });
  }

  // Percent of the dance's tempo.
  get speed() {
    return STEPS[this.step];
  }

  // What follows from the score of a round, in words.
  after(total) {
    const round = { total: Math.round(total), percent: this.speed, goal: this.goal };
    if (Math.round(total) >= this.goal) {
      this.done = this.step === STEPS.length - 1;
      if (this.done) return say("{total} of 100 at {percent} %: you reached your goal of {goal}", round);
      this.step++;
      return say("{total} of 100 at {percent} %, goal reached: now {next} %", { ...round, next: this.speed });
    }
    if (total < this.goal - FAR && this.step > 0) {
      this.step--;
      return say("{total} of 100 at {percent} %: slower again, {next} %", { ...round, next: this.speed });
    }
    return say("{total} of 100 at {percent} %: once more, {goal} is the goal", round);
  }
}

export const practiseAddress = (dance, phrase, more = "") => `#/dance/${dance}?phrase=${phrase}&practise=${GOAL}&go${more}`;

// The phrase that went worst, or null: its number from 0, and its score.
export function worstPhrase(phrases, phrase_s) {
  const known = phrases.filter(({ total }) => total !== null);
  if (!known.length) return null;
  const worst = known.reduce((a, b) => (b.total < a.total ? b : a));
  return { phrase: Math.max(Math.round(worst.start_s / phrase_s), 0), total: worst.total };
}

const RECENT_DAYS = 28, PLANNED = 3, DAY_MS = 86400000;
const day = (session) => Date.UTC(session.slice(0, 4), session.slice(4, 6) - 1, session.slice(6, 8));

// What to practise this week: of the dances of the last four weeks the phrases whose latest score is least and below the goal.
export function weekPlan(dances, now) {
  const latest = new Map(), today = Date.UTC(now.getFullYear(), now.getMonth(), now.getDate());
  for (const { identity, name, phrase_s, tries } of dances) {
    for (const { session, phrases } of tries) { // the newest first
      if (today - day(session) > RECENT_DAYS * DAY_MS) continue;
      for (const { start_s, total } of phrases) {
        const phrase = Math.max(Math.round(start_s / phrase_s), 0), key = `${identity}/${phrase}`;
        if (total !== null && !latest.has(key)) latest.set(key, { identity, name, phrase, total });
      }
    }
  }
  const weak = [...latest.values()].filter(({ total }) => total < GOAL).sort((a, b) => a.total - b.total).slice(0, PLANNED);
  return weak.map(({ identity, name, phrase, total }) =>
    ({ text: say("{name}, phrase {number} ({total} of 100)", { name, number: phrase + 1, total: Math.round(total) }), href: practiseAddress(identity, phrase) }));
}
