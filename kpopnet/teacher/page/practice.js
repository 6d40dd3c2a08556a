// Practising one phrase: slowed down, faster each time that it reaches the goal, slower again where it fails by far.
import { say } from "./words.js";

export const SPEEDS = [25, 40, 50, 60, 75, 90, 100], STEPS = [75, 90, 100], GOALS = [60, 70, 80, 90], GOAL = 80;
const FAR = 25, LEAST_S = 2.5; // what the server scores at least

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

// Of the address of a dance: whom of a group one danced, and whether as in a mirror.
export const asDanced = ({ dancer, mirrored }) => `dancer=${dancer || 0}${mirrored === false ? "&mirrored=0" : ""}`;

// The same part of a dance once more, as fast as it was danced; one that followed a song was danced a little off the speeds to choose.
export function againAddress(identity, found, { seconds, phrase_s, first_s }, danced) {
  const nearest = SPEEDS.reduce((a, b) => (Math.abs(b - 100 * found.speed) < Math.abs(a - 100 * found.speed) ? b : a));
  const part = isPart(found, seconds) ? `phrase=${phraseAt(found.from_s, { phrase_s, first_s })}&` : "";
  return `#/dance/${identity}?${part}${found.speed ? `speed=${nearest}&` : ""}${danced}`;
}

export const isPart = ({ from_s, to_s }, seconds) => (to_s || seconds) - from_s < seconds;

export const practiseAddress = (dance, phrase, more = "") => `#/dance/${dance}?phrase=${phrase}&practise=${GOAL}&go${more}`;

// Whether a dance has a phrase of this number, from 0, that is long enough to be danced alone; the last one may be cut short, and
// in dances of more than 192 beats a minute all are too short.
export const practisable = (phrase, { phrase_s, seconds }) => Math.min(phrase_s, seconds - phrase * phrase_s) >= LEAST_S;
// The number of the phrase that begins at a time; `first_s` is where the first phrase of a recording begins.
export const phraseAt = (start_s, { phrase_s, first_s = 0 }) => Math.max(Math.round((start_s - first_s) / phrase_s), 0);

// Of the phrases that can be practised the one that went worst, or null: its number from 0, and its score.
export function worstPhrase(phrases, dance) {
  const known = phrases.filter(({ start_s, total }) => total !== null && practisable(phraseAt(start_s, dance), dance));
  if (!known.length) return null;
  const worst = known.reduce((a, b) => (b.total < a.total ? b : a));
  return { phrase: phraseAt(worst.start_s, dance), total: worst.total };
}

const RECENT_DAYS = 28, PLANNED = 3, DAY_MS = 86400000;
// A try's date may lie ahead: the clock was wrong once.
const day = (session) => Date.UTC(session.slice(0, 4), session.slice(4, 6) - 1, session.slice(6, 8));

const daysAgo = (session, now) => (Date.UTC(now.getFullYear(), now.getMonth(), now.getDate()) - day(session)) / DAY_MS;
export const isAhead = (session, now) => daysAgo(session, now) < -1;

// What to practise this week: of the dances of the last four weeks the phrases whose latest score is least and below the goal.
export function weekPlan(dances, now) {
  const latest = new Map();
  for (const dance of dances) {
    const { identity, name } = dance;
    for (const { session, phrases, dancer, mirrored } of dance.tries) { // the newest first
      if (daysAgo(session, now) > RECENT_DAYS || isAhead(session, now)) continue;
      for (const { start_s, total } of phrases) {
        const phrase = phraseAt(start_s, dance), key = `${identity}/${phrase}/${dancer || 0}`;
        if (total !== null && practisable(phrase, dance) && !latest.has(key)) latest.set(key, { identity, name, phrase, total, danced: asDanced({ dancer, mirrored }) });
      }
    }
  }
  const weak = [...latest.values()].filter(({ total }) => Math.round(total) < GOAL).sort((a, b) => a.total - b.total).slice(0, PLANNED);
  return weak.map(({ identity, name, phrase, total, danced }) => ({
    text: say("{name}, phrase {number} ({total} of 100)", { name, number: phrase + 1, total: Math.round(total) }),
    href: practiseAddress(identity, phrase, `&${danced}`),
  }));
}
