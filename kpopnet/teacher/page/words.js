// What the page says, in the browser's language or another one that was chosen. English is the source: its texts stand in the code,
// and in the catalogues of the other languages as keys.
import de from "../../languages/de.mjs";
import ko from "../../languages/ko.mjs";
import { remember, remembered } from "./memory.js";

export const LANGUAGES = { en: "English", ko: "한국어", de: "Deutsch" };
const CATALOGUES = { en: {}, ko, de }, DECIMAL_COMMA = ["de"], DATES = { en: "en-GB", ko: "ko", de: "de" };
const RIGHT_TO_LEFT = /[\u0590-\u08ff\ufb1d-\ufdff\ufe70-\ufefc]/;
export const language = chosen();
if (globalThis.document) document.documentElement.lang = language;

// The language of the page itself, as of a report; or ?lang= in the address, which is remembered; or the browser's first that is known.
function chosen() {
  const known = (one) => one in LANGUAGES, asked = new URLSearchParams(globalThis.location?.search).get("lang");
  if (known(asked)) remember("language", asked);
  const wished = [globalThis.document?.documentElement.dataset.language, asked, remembered("language", null), ...(globalThis.navigator?.languages || [])];
  return wished.map((one) => String(one).split("-")[0]).find(known) || "en";
}

// A text by its English words, with what fills its gaps such as {name}; or, whole, as the server sends it (`keyed` of
// kpopnet/languages). What stands before "|" tells apart texts that are equal in English alone. Other texts are said as they are.
export function say(message, values = {}) {
  if (message === null || message === undefined) return "–"; // whoever sent it knew no more
  if (typeof message === "object") return say(message.say, message);
  const text = Object.hasOwn(CATALOGUES[language], message) ? CATALOGUES[language][message] : message.replace(/^\w+\|/, "");
  return text.replace(/\{(\w+)\}/g, (gap, name) => (Object.hasOwn(values, name) ? shown(values[name]) : gap));
}

function shown(value) {
  if (Array.isArray(value)) return value.map(shown).join(", ");
  if (typeof value === "object") return say(value);
  const text = String(value);
  if (RIGHT_TO_LEFT.test(text)) return `\u2068${text}\u2069`; // or the numbers beside it would be drawn on its other side
  return DECIMAL_COMMA.includes(language) && /^[+-]?\d+\.\d+$/.test(text) ? text.replace(".", ",") : text;
}

// Day and time of what Date.UTC gave; of 24 hours, since some browsers say "AM" in Korean.
export function dated(time_ms) {
  return new Intl.DateTimeFormat(DATES[language], { dateStyle: "medium", timeStyle: "short", hourCycle: "h23", timeZone: "UTC" }).format(time_ms);
}
