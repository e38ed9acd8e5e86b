// The pointer on the map: pan and zoom, goals with a heading, zones by corner or freehand.

import { element, setText } from "../core/dom.js";
import { isInside, midpoints, roundedPoint } from "../core/geometry.js";
import { acceptOffer, offer } from "../mission/goals.js";
import {
  clicked,
  draft,
  grabCorner,
  insertCorner,
  isDrawing,
  moveAll,
  moveCorner,
  outline,
  removeCorner,
  setFreehand,
  snapshot,
} from "../zones/draft.js";
import { askPreview } from "../zones/preview.js";
import { finish } from "../zones/store_draft.js";
import { redraw } from "./map.js";
import { canvas, clampToMap, pan, toPage, toWorld, view, zoom } from "./view.js";
import { sketch, world } from "./world.js";

const CLICK_PX = 4;
const GRAB_PX = 11;
const HEADING_PX = 18;
const WHEEL_PX = 500; // of the wheel, for a factor of e
const fingers = new Map(); // pointer id → its position on the canvas
let press = null;

const onMap = (point) => clampToMap(point, world.map);
const isNear = (point, event) => {
  const [x, y] = toPage(point);
  return Math.hypot(x - event.offsetX, y - event.offsetY) <= GRAB_PX;
};

// What a drag from here moves: `what` is a key of `MOVES`.
function targetOf(event) {
  if (event.button !== 0) return { what: "map" };
  if (draft.mode === "goal") return { what: "goal" };
  if (!isDrawing()) return { what: "map" };
  const corner = draft.corners.findIndex((point) => isNear(point, event));
  if (corner >= 0) return { what: "corner", index: corner };
  if (draft.mode === "draw" && draft.tool === "free" && draft.corners.length === 0)
    return { what: "stroke" };
  if (draft.mode === "edit" || draft.tool === "free") {
    const middle =
      draft.mode === "edit" &&
      midpoints(draft.tool, draft.corners).find((side) => isNear(side.at, event));
    if (middle) return { what: "middle", index: middle.after };
    const at = toWorld(event.offsetX, event.offsetY);
    if (isInside(at, outline()))
      return { what: "whole", corners: draft.corners.map((point) => [...point]) };
  }
  return { what: "map" };
}

const MOVES = {
  corner: (at) => moveCorner(press.index, onMap(at)),
  middle: (at) =>
    Object.assign(press, { what: "corner", index: insertCorner(press.index, onMap(at)) }),
  whole: (at) => {
    if (!press.hasSnapshot) snapshot();
    press.hasSnapshot = true;
    moveAll(at[0] - press.at[0], at[1] - press.at[1], press.corners);
  },
  stroke: (at) => {
    sketch.stroke.push(onMap(at));
    redraw();
  },
  goal: (at, dx, dy) => {
    sketch.heading = Math.hypot(dx, dy) > HEADING_PX ? Math.atan2(-dy, dx) : null;
    redraw();
  },
  map: (at, dx, dy) => pan(press.view, dx, dy),
};

canvas.addEventListener("pointerdown", (event) => {
  if (!world.map) return;
  fingers.set(event.pointerId, [event.offsetX, event.offsetY]);
  if (fingers.size > 1) {
    cancelPress(); // two fingers zoom: the first one did not click
    return;
  }
  const at = toWorld(event.offsetX, event.offsetY);
  press = {
    ...targetOf(event),
    at,
    x: event.offsetX,
    y: event.offsetY,
    button: event.button,
    moved: false,
    view: { ...view },
  };
  canvas.setPointerCapture(event.pointerId);
  if (press.what === "corner") grabCorner(press.index);
  if (press.what === "goal") placeGoal(at);
  if (press.what === "stroke") sketch.stroke = [at];
});

canvas.addEventListener("pointermove", (event) => {
  const at = toWorld(event.offsetX, event.offsetY);
  setText(element("where"), `x ${at[0].toFixed(2)}  y ${at[1].toFixed(2)} m`);
  if (!world.map) return;
  if (fingers.size === 2 && fingers.has(event.pointerId)) {
    pinch(event);
    return;
  }
  if (!press) {
    if (draft.mode === "goal" && event.pointerType === "mouse") placeGoal(at);
    return;
  }
  const [dx, dy] = [event.offsetX - press.x, event.offsetY - press.y];
  press.moved ||= Math.hypot(dx, dy) > CLICK_PX;
  if (press.moved) MOVES[press.what](at, dx, dy);
});

canvas.addEventListener("pointerup", (event) => {
  fingers.delete(event.pointerId);
  if (!press) return;
  const { what, moved, at, button, index } = press;
  const { heading, stroke } = sketch;
  press = null;
  if (what === "stroke") {
    sketch.stroke = [];
    if (moved) setFreehand(stroke);
  } else if (what === "goal") {
    cancelPress();
    click(at, heading);
  } else if (what === "middle") {
    insertCorner(index, onMap(toWorld(event.offsetX, event.offsetY)));
  } else if (!moved && button === 0) {
    if (offer.position && isNear(offer.position, event)) acceptOffer();
    else if (what !== "corner" || draft.mode === "draw") click(at);
  } else if (!moved && button === 2 && isDrawing()) {
    removeCorner(draft.corners.findIndex((point) => isNear(point, event)));
  }
});

canvas.addEventListener("pointercancel", (event) => {
  fingers.delete(event.pointerId);
  cancelPress();
});
canvas.addEventListener("pointerleave", () => {
  if (!press) cancelPress();
});
canvas.addEventListener("contextmenu", (event) => event.preventDefault());
canvas.addEventListener(
  "wheel",
  (event) => {
    event.preventDefault();
    zoom(Math.exp(-event.deltaY / WHEEL_PX), event.offsetX, event.offsetY);
  },
  { passive: false },
);

function click(at, heading = null) {
  if (clicked(...at, onMap(at), heading)) finish();
}

// Two fingers move the map with their middle and zoom it by their distance.
function pinch(event) {
  const span = () => {
    const [[ax, ay], [bx, by]] = fingers.values();
    return { x: (ax + bx) / 2, y: (ay + by) / 2, size: Math.hypot(ax - bx, ay - by) };
  };
  const before = span();
  fingers.set(event.pointerId, [event.offsetX, event.offsetY]);
  const after = span();
  pan({ ...view }, after.x - before.x, after.y - before.y);
  if (before.size > 0) zoom(after.size / before.size, after.x, after.y);
}

// Show a goal below the pointer, and the path to it from the last goal of the queue.
function placeGoal(at) {
  Object.assign(sketch, { goal: roundedPoint(at), heading: null, path: [], verdict: "" });
  const [x, y] = sketch.goal;
  const last = world.state?.queue.at(-1);
  const question = {
    goal: { x_m: x, y_m: y },
    ...(last ? { start: { x_m: last.x_m, y_m: last.y_m } } : {}),
  };
  askPreview(question, (answer) => {
    Object.assign(sketch, { path: answer.path, verdict: answer.text });
    redraw();
  });
  redraw();
}

// Forget what the pointer was placing.
export function cancelPress() {
  if (sketch.goal || sketch.stroke.length) askPreview(null);
  Object.assign(sketch, { goal: null, heading: null, path: [], verdict: "", stroke: [] });
  press = null;
  redraw();
}
