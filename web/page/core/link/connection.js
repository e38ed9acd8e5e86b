// Whether the robot's state still arrives.

import { element, set, setText } from "../dom.js";
import { t } from "../text/language.js";

const STALE_MS = 1000;
const CHECKED_MS = 200;
const WORDS = { live: t("live"), stale: t("no connection"), waiting: t("connecting") };
const listeners = [];
let arrivedMs = performance.now();
let hasState = false;

// Called with the seconds since the last state while there is no connection.
export const onStale = (listener) => listeners.push(listener);

export function stateArrived() {
  arrivedMs = performance.now();
  hasState = true;
}

setInterval(() => {
  const ageMs = performance.now() - arrivedMs;
  const isStale = ageMs > STALE_MS;
  const connection = isStale ? "stale" : hasState ? "live" : "waiting";
  set(document.body.dataset, { connection });
  setText(element("connection").lastElementChild, WORDS[connection]);
  if (isStale) for (const listener of listeners) listener(ageMs / 1000);
}, CHECKED_MS);
