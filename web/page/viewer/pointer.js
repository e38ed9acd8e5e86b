// A goal in the 3D view, by mouse or finger: the path under the pointer, a click for the goal, a
// drag for its heading. The console says which point of the floor is below the pointer.

import { clicked, draft } from "../zones/draft.js";
import { finish } from "../zones/store_draft.js";
import { cancelPress, placeGoal } from "../map/pointer/pointer.js";
import { onFrame } from "./viewer.js";
import { askFloor, onFloor, onLinkClose, sendDraft } from "./link.js";
import { onSketch, sketch } from "../map/world.js";

const HEADING_PX = 18;
const HOVER_MS = 100;
let press = null; // pixel where the pointer went down, and the floor there
let askedMs = 0;

const isPicking = () => draft.mode === "goal" && document.body.dataset.role !== "viewer";

// A drag may end beside the view; the console takes shares of it.
const share = (at) => Math.min(Math.max(at, 0), 1);

function ask(phase, { clientX, clientY, view }) {
  askFloor(phase, share(clientX / view.innerWidth), share(clientY / view.innerHeight));
}

// The view itself neither turns nor clicks while a goal is picked with the first button.
function take(event) {
  event.stopPropagation();
  event.preventDefault();
}

const HANDLERS = {
  pointerdown: (event) => {
    if (event.button !== 0 || !event.isPrimary) return;
    take(event);
    press = { x: event.clientX, y: event.clientY, at: null };
    ask("down", event);
  },
  pointermove: (event) => {
    if (press) take(event);
    const now = performance.now();
    if (now - askedMs < HOVER_MS || (!press && event.buttons)) return;
    askedMs = now;
    if (!press) ask("hover", event);
    else if (Math.hypot(event.clientX - press.x, event.clientY - press.y) > HEADING_PX)
      ask("turn", event);
  },
  pointerup: (event) => {
    if (!press) return;
    take(event);
    const isTurn = Math.hypot(event.clientX - press.x, event.clientY - press.y) > HEADING_PX;
    if (isTurn) ask("turn", event);
    ask("up", event);
  },
  pointercancel: forget,
};

function forget() {
  if (!press) return;
  press = null;
  cancelPress();
}

onFrame((inside) => {
  for (const [name, handle] of Object.entries(HANDLERS))
    inside.addEventListener(name, (event) => isPicking() && handle(event), { capture: true });
});

onFloor((phase, place) => {
  if (!isPicking()) press = null;
  else if (phase === "up") set();
  else if (!place) return;
  else if (phase === "turn") turn(place);
  else {
    if (phase === "down" && press) press.at = place;
    placeGoal(place);
  }
});

function turn([x, y]) {
  if (!press?.at) return;
  sketch.heading = Math.atan2(y - press.at[1], x - press.at[0]);
  sendDraft();
}

function set() {
  const [at, heading] = [press?.at, sketch.heading];
  press = null;
  cancelPress();
  if (at && clicked(...at, heading)) finish();
}

onSketch(sendDraft);
onLinkClose(forget); // the answers are lost with it
