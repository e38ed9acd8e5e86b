// What the page and the 3D view tell each other: clicks, the draft, the display, marks.

import { connect } from "../core/link/api.js";
import {
  clicked,
  draft,
  grabCorner,
  isDrawing,
  MAX_CORNERS,
  moveCorner,
  onDraft,
  outline,
} from "../zones/draft.js";
import { finish } from "../zones/store_draft.js";
import { address, drawViewerNow, setConnected } from "./viewer.js";
import { goalMark, sketch } from "../map/world.js";

const MAX_PREVIEW_POINTS = 4000;
const MAX_NOTE = 200;
// Modes that the 3D view knows; the others are of the map alone.
const VIEW_MODES = new Set(["goal", "draw", "edit"]);
let onOpen = () => {};
let onClose = () => {};
let onPointer = () => {};
let display = null;

// Called when the link is open again and the console has forgotten the marks.
export const onLinkOpen = (act) => {
  onOpen = act;
};

export const onLinkClose = (act) => {
  onClose = act;
};

// Called with the answer to `askFloor`.
export const onFloor = (act) => {
  onPointer = act;
};

const link = connect(address, {
  onOpen: () => {
    sendDraft();
    if (display) link.send(display);
    onOpen();
  },
  onClose: () => onClose(),
  onMessage: (message) => {
    if (message.type === "click") {
      // A click of a goal comes from the pointer, with its heading.
      if (draft.mode !== "goal" && clicked(message.x_m, message.y_m)) finish();
    } else if (message.type === "drag") {
      if (message.phase === "start") grabCorner(message.index);
      moveCorner(message.index, [message.x_m, message.y_m]);
    }
    else if (message.type === "pointer") onPointer(message.phase, message.place);
    else if (message.type === "viewer") setConnected(message.connected);
  },
});

export const mark = (lines, place) => link.send({ type: "mark", lines, place });

// Ask for the floor below the pointer: shares of the width and the height of the view.
export const askFloor = (phase, right, down) => link.send({ type: "pointer", phase, right, down });

// Turn the camera of the 3D view: `at` is "overview", "top", "robot", or "place" with a point.
export function look(at, place) {
  link.send(place ? { type: "look", at, place } : { type: "look", at });
  drawViewerNow();
}

// What this page shows; sent again when the link was lost.
export function showDisplay(options) {
  display = { type: "show", ...options };
  link.send(display);
  drawViewerNow();
}

// Of a draft with more corners than a zone may have a part is sent: a message with all of them would
// be refused, and end the link.
export function sendDraft() {
  const isGoal = draft.mode === "goal";
  const path = isGoal ? sketch.path : draft.preview;
  const ring = isGoal ? goalMark() : isDrawing() ? outline() : [];
  link.send({
    type: "draft",
    mode: VIEW_MODES.has(draft.mode) ? draft.mode : "navigate",
    corners: draft.corners.slice(0, MAX_CORNERS),
    outline: ring.slice(0, 2 * MAX_CORNERS),
    path: path.slice(0, MAX_PREVIEW_POINTS),
    note: isGoal ? sketch.verdict.slice(0, MAX_NOTE) : "",
  });
  drawViewerNow();
}

onDraft(sendDraft);
