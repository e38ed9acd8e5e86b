// Driving by hand with the pad or the arrow keys. A velocity is sent repeatedly while a key is
// held; the console forgets it a quarter of a second after the last one.

import { element } from "../core/dom.js";
import { isSwapped, swap } from "../insight/swap.js";
import { onControlLost, sendVelocity } from "./control.js";

const SEND_MS = 80;
const FORWARD_MPS = 0.4;
const REVERSE_MPS = 0.2;
const TURN_RADPS = 0.6;
// Key → (forward, left).
const DIRECTIONS = { ArrowUp: [1, 0], ArrowDown: [-1, 0], ArrowLeft: [0, 1], ArrowRight: [0, -1] };
const buttons = document.querySelectorAll("[data-drive]");
const pad = element("teleop");
const pressed = new Set();
let timer = 0;

function drive() {
  // Of a window that loses the focus while the 3D view has it, this page hears nothing, nor of the
  // key that is released then.
  if (!document.hasFocus()) {
    releaseAll();
    return;
  }
  const [forward, left] = [...pressed].reduce(
    (sum, key) => [sum[0] + DIRECTIONS[key][0], sum[1] + DIRECTIONS[key][1]],
    [0, 0],
  );
  const vMps = forward > 0 ? FORWARD_MPS : forward < 0 ? -REVERSE_MPS : 0;
  sendVelocity(vMps, left * TURN_RADPS);
}

function press(key) {
  if (pressed.has(key)) return;
  pressed.add(key);
  showPressed();
  timer ||= setInterval(drive, SEND_MS);
  drive(); // which may release all
}

function release(key) {
  if (!pressed.delete(key)) return;
  showPressed();
  if (pressed.size) drive();
  else releaseAll();
}

function releaseAll() {
  const wasDriving = timer !== 0;
  clearInterval(timer);
  timer = 0;
  pressed.clear();
  showPressed();
  if (wasDriving) sendVelocity(0, 0);
}

function showPressed() {
  for (const button of buttons)
    button.setAttribute("aria-pressed", String(pressed.has(button.dataset.drive)));
}

// Handle a key of the page; returns whether it was one for driving. Only while the pad is open, so
// that no key drives by mistake.
export function driveByKey(event, isDown) {
  if (!DIRECTIONS[event.key] || !pad.open || document.body.dataset.role === "viewer") return false;
  if (!isDown) release(event.key);
  else if (!event.repeat) press(event.key); // once all are released, a key is to be pressed again
  return true;
}

export function togglePad() {
  pad.open = !pad.open;
}

for (const button of buttons) {
  button.onpointerdown = (event) => {
    button.setPointerCapture(event.pointerId);
    press(button.dataset.drive);
  };
  for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) {
    button.addEventListener(end, () => release(button.dataset.drive));
  }
  button.oncontextmenu = (event) => event.preventDefault();
}
let wakeLock = null;
let wasSwapped = false;

// A screen that goes dark would end the drive.
async function keepAwake(isOn) {
  try {
    if (isOn) wakeLock = await navigator.wakeLock?.request("screen");
    else await wakeLock?.release();
  } catch {
    // this browser does not keep the screen on
  }
}

// By hand one drives by the camera image: it is large meanwhile.
// The event comes late after opening, when a key may already be held.
pad.addEventListener("toggle", () => {
  if (!pad.open) releaseAll();
  if (pad.open) wasSwapped = isSwapped();
  swap(pad.open || wasSwapped);
  if (pad.open) pad.scrollIntoView({ block: "nearest" }); // on a phone it opens below the edge
  keepAwake(pad.open);
});
window.addEventListener("blur", () => {
  if (document.activeElement?.id !== "viewer") releaseAll();
});
window.addEventListener("pagehide", releaseAll);
document.addEventListener("visibilitychange", () => {
  if (document.hidden) releaseAll();
});
onControlLost(releaseAll);
