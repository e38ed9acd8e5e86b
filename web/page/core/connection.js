// Whether the robot's state still arrives.

import { element, set, setText } from "./dom.js";

const STALE_MS = 1000;
let arrivedMs = performance.now();
let hasState = false;

export function stateArrived() {
  arrivedMs = performance.now();
  hasState = true;
}

setInterval(() => {
  const ageMs = performance.now() - arrivedMs;
  const isStale = ageMs > STALE_MS;
  set(document.body.dataset, { connection: isStale ? "stale" : hasState ? "live" : "waiting" });
  setText(
    element("connection").lastElementChild,
    isStale ? "no connection" : hasState ? "live" : "connecting",
  );
  set(element("stale"), { hidden: !isStale });
  if (!isStale) return;
  setText(
    element("stale"),
    `NO CONNECTION for ${(ageMs / 1000).toFixed(0)} s: everything below is out of date. ` +
      "STOP is still sent; the robot stops by itself when it loses its own link.",
  );
}, 200);
