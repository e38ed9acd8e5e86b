// A sign for work that takes longer than a second: what it waits for, and how long it has taken.

import { make, set, setText } from "../dom.js";
import { t } from "../text/language.js";

const SHOWN_AFTER_MS = 1000;
const running = new Map();
const words = make("span");
const box = make(
  "div",
  { class: "progress", role: "status", hidden: "", "data-testid": "progress" },
  make("progress"),
  words,
);
document.body.append(box);

export async function showProgress(promise, name) {
  const key = Symbol(name);
  running.set(key, { name, sinceMs: performance.now() });
  try {
    return await promise;
  } finally {
    running.delete(key);
    show();
  }
}

function show() {
  const now = performance.now();
  const slow = new Map(); // name → the longest wait; insertion order is by start
  for (const { name, sinceMs } of running.values()) {
    if (now - sinceMs > SHOWN_AFTER_MS && !slow.has(name))
      slow.set(name, ((now - sinceMs) / 1000).toFixed(0));
  }
  set(box, { hidden: slow.size === 0 });
  const names = [...slow].map(([name, seconds]) => `${name} (${seconds} s)`).join(", ");
  if (slow.size) setText(words, t("waiting for {names}", { names }));
}

setInterval(show, 250);
