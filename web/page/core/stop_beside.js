// The stop of a page beside the console: its button, and the space bar wherever no text is written.

import { element } from "./dom.js";
import { stop } from "./stop.js";
import { t } from "./text/language.js";
import { notify } from "./toasts.js";

const TEXT = "input:not([type=checkbox]):not([type=range]):not([type=number]), textarea";

// Whether text is written in an element, so that keys belong to it.
export const isText = (target) => Boolean(target.matches?.(TEXT));

export function tellStopped() {
  notify(t("The robot is stopped. The stop is released in the console."), { good: true });
}

async function stopNow() {
  if (await stop("console button")) tellStopped();
}
element("stop").onclick = stopNow;
document.addEventListener(
  "keydown",
  (event) => {
    if (event.code !== "Space" || isText(event.target)) return;
    event.preventDefault();
    if (!event.repeat) stopNow();
  },
  { capture: true },
);
// A focused button is pressed when the key is released.
document.addEventListener(
  "keyup",
  (event) => {
    if (event.code === "Space" && !isText(event.target)) event.preventDefault();
  },
  { capture: true },
);
