// The page of `kpopnet score`: a result and both movements, which the page itself holds.
import { bodyOf } from "./body.js";
import { showResult } from "./result.js";

const { body, ...given } = JSON.parse(document.getElementById("given").textContent);
showResult(document.getElementById("main"), { ...given, body: bodyOf(body) });
