// Who is in control, this page's sign of life, and driving by hand. The console asks twice a second, the page answers: a page
// that is closed, frozen or cut off is silent, and what it last asked of the wheels is forgotten within a quarter of a second.

import { alsoStopsBy, connect, get, post } from "../core/api.js";
import { set, setText } from "../core/dom.js";
import { attempt, say } from "../core/toasts.js";
import { show as showUsers } from "../access/users.js";

const SEND_MS = 80;
const FORWARD_MPS = 0.4;
const BACK_MPS = 0.2;
const TURN_RADPS = 0.6;
const WAYS = { ArrowUp: [1, 0], ArrowDown: [-1, 0], ArrowLeft: [0, 1], ArrowRight: [0, -1] };
const element = (id) => document.getElementById(id);
const held = new Set();
let seen = null;
let timer = 0;

const live = connect("/control/live", {
  onMessage: (message) => {
    if (message.type === "refused") { letGo(); say(message.message); return; }
    live.send({ type: "here" });
    show(message);
  },
  onClose: whoAmI,
});

alsoStopsBy((by) => live.send({ type: "stop", by }));

// A session that has ended leaves a page that can do nothing: show the log-in instead.
async function whoAmI() {
  letGo();
  try { await get("/me"); } catch (error) { if (error.status === 401) location.reload(); }
}

function show(now) {
  const { you, holder, asking } = now;
  const viewer = you.role === "viewer";
  set(document.body.dataset, { role: you.role });
  for (const part of document.querySelectorAll(".left, [aria-label='Mode'], #beware, #beware-tools")) set(part, { inert: viewer });
  const who = now.yours ? "you" : holder ? "other" : "nobody";
  set(element("control").dataset, { who });
  const words = { you: "● You drive", other: `▲ ${holder?.name} drives`, nobody: "○ Nobody drives" }[who];
  const wish = now.yours && asking ? ` · ${asking.name} asks` : now.asked_by_you ? " · asked" : "";
  setText(element("control-text"), viewer ? `${words} · you watch` : words + wish);
  set(element("control-text"), { title: now.yours && asking ? `${asking.name} would like to drive` : words });
  set(element("control-take"), { hidden: viewer || now.yours });
  set(element("control-ask"), { hidden: Boolean(viewer || now.yours || !holder || now.asked_by_you) });
  set(element("control-give"), { hidden: !now.yours });
  element("control-give").classList.toggle("due", Boolean(now.yours && asking));
  set(element("logout"), { hidden: !you.logged_in });
  setText(element("account-button"), you.name);
  showUsers(you);
  if (seen !== null && seen.serial !== now.serial) tell(now);
  seen = now;
}

function tell(now) {
  if (seen.yours && !now.yours) {
    letGo();
    if (now.holder) say(`${now.holder.name} ${now.taken ? "has taken over control" : "is in control now"}. You watch; take over to drive.`);
    else say("You have given up control.", { good: true });
  } else if (now.yours && !seen.yours) say("You are in control.", { good: true });
  else if (now.yours && now.asking && !seen.asking) say(`${now.asking.name} asks for control: “Hand over”, or just drive on.`);
}

for (const action of ["take", "ask", "give"]) element(`control-${action}`).onclick = () => attempt(() => post(`/control/${action}`));

// ------------------------------------------------------------------------------------------------------- driving by hand

function send(v, w) { live.send({ type: "drive", v_mps: v, w_radps: w, t_ms: performance.now() }); }

function drive() {
  const [ahead, left] = [...held].reduce((sum, key) => [sum[0] + WAYS[key][0], sum[1] + WAYS[key][1]], [0, 0]);
  send(ahead > 0 ? FORWARD_MPS : ahead < 0 ? -BACK_MPS : 0, left * TURN_RADPS);
}

function hold(key) {
  if (held.has(key)) return;
  held.add(key);
  mark();
  drive();
  if (!timer) timer = setInterval(drive, SEND_MS);
}

function release(key) {
  if (!held.delete(key)) return;
  mark();
  if (held.size) drive();
  else letGo();
}

function letGo() {
  const drove = timer !== 0;
  clearInterval(timer);
  timer = 0;
  held.clear();
  mark();
  if (drove) send(0, 0);
}

function mark() { for (const button of document.querySelectorAll("[data-hand]")) button.setAttribute("aria-pressed", String(held.has(button.dataset.hand))); }

// For the page's key handlers: true when the key was one for driving. Only while the pad is open, so that nobody drives by mistake.
export function handKey(event, down) {
  if (!WAYS[event.key] || !element("byhand").open || document.body.dataset.role === "viewer") return false;
  if (down) hold(event.key);
  else release(event.key);
  return true;
}

export function togglePad() { element("byhand").open = !element("byhand").open; }

for (const button of document.querySelectorAll("[data-hand]")) {
  button.onpointerdown = (event) => { button.setPointerCapture(event.pointerId); hold(button.dataset.hand); };
  for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) button.addEventListener(end, () => release(button.dataset.hand));
  button.oncontextmenu = (event) => event.preventDefault();
}
// Opening is told of late, when a key may already be held.
element("byhand").addEventListener("toggle", () => { if (!element("byhand").open) letGo(); });
window.addEventListener("blur", () => { if (document.activeElement?.id !== "viewer") letGo(); });
window.addEventListener("pagehide", letGo);
document.addEventListener("visibilitychange", () => { if (document.hidden) letGo(); });
