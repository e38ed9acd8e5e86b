// A sign for whatever takes longer than a second, with its name and how long it has taken.

import { set, setText } from "./dom.js";

const SHOWN_AFTER_MS = 1000;
const running = new Map();
const box = document.createElement("div");
box.className = "progress";
box.setAttribute("role", "status");
box.dataset.testid = "progress";
box.hidden = true;
const bar = document.createElement("progress");
const words = document.createElement("span");
box.append(bar, words);
document.body.append(box);

export async function during(promise, what) {
  const key = Symbol(what);
  running.set(key, { what, since: performance.now() });
  try { return await promise; } finally { running.delete(key); show(); }
}

function show() {
  const now = performance.now();
  const slow = [...running.values()].filter((one) => now - one.since > SHOWN_AFTER_MS);
  set(box, { hidden: slow.length === 0 });
  if (slow.length) setText(words, `waiting for ${slow.map((one) => `${one.what} (${((now - one.since) / 1000).toFixed(0)} s)`).join(", ")}`);
}

setInterval(show, 250);
