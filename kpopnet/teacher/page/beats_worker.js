// Finds the beats of a song in a thread of its own.
import { beatsOf } from "./beats.js";

globalThis.addEventListener("message", ({ data: { samples, rate } }) => {
  try {
    globalThis.postMessage({ found: beatsOf(samples, rate) });
  } catch ({ message }) {
    globalThis.postMessage({ error: message });
  }
});
