// The pointer on the map: pan and zoom, select and drag, goals with a heading, zones by corner or
// freehand.

import { element, setText } from "../../core/dom.js";
import { isInside, midpoints, roundedPoint } from "../../core/geometry.js";
import { acceptOffer, dropOffer, offer } from "../../mission/goals.js";
import {
  clicked,
  draft,
  grabCorner,
  insertCorner,
  isDrawing,
  moveAll,
  moveCorner,
  onDraft,
  outline,
  removeCorner,
  setFreehand,
  setMode,
  snapshot,
} from "../../zones/draft.js";
import { askPreview } from "../../zones/preview.js";
import { finish } from "../../zones/store_draft.js";
import { redraw } from "../map.js";
import { moveGoal, openMenu } from "./map_menu.js";
import { finishAt, pointTo } from "./pick.js";
import { hover, isSelected, select, selectedItem } from "./selection.js";
import { targetAt } from "./targets.js";
import { canvas, pan, size, toPage, toWorld, view, zoom } from "../view.js";
import { sketch, sketchChanged, world } from "../world.js";

const CLICK_PX = 4;
const GRAB_PX = 11;
const HEADING_PX = 18;
const LONG_PRESS_MS = 500;
const WHEEL_PX = 500; // of the wheel, for a factor of e
const fingers = new Map(); // pointer id → its position on the canvas
let press = null;
let longPress = 0;

const isNear = (point, event) => {
  const [x, y] = toPage(point);
  return Math.hypot(x - event.offsetX, y - event.offsetY) <= GRAB_PX;
};

const isOnOffer = (event) => offer.position && isNear(offer.position, event);

// What a drag from here moves: `what` is a key of `MOVES`.
function targetOf(event) {
  if (event.button !== 0) return { what: "map" };
  if (draft.mode === "goal") return { what: "goal" };
  if (["measure", "place", "point"].includes(draft.mode)) return { what: "pick" };
  if (!isDrawing()) return grabOf(event);
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

// What a drag moves while nothing is drawn: a goal, or the zone that is selected.
function grabOf(event) {
  const target = targetAt([event.offsetX, event.offsetY]);
  if (document.body.dataset.role === "viewer") return { what: "map" };
  if (target?.kind === "goal") return { what: "flag", goal: target.item };
  if (target && target.kind === "zone" && isSelected("zone", target.id))
    return { what: "zone", zone: target.item };
  return { what: "map" };
}

// Where a dragged goal is now: the pointer may have grabbed its flag beside the position.
const draggedTo = ({ goal, at }, [x, y]) => [goal.x_m + x - at[0], goal.y_m + y - at[1]];

const MOVES = {
  flag: (at) => {
    sketch.movedGoal = press.goal.id;
    placeGoal(draggedTo(press, at));
  },
  zone: (at) => {
    setMode("edit", press.zone);
    Object.assign(press, { what: "whole", corners: draft.corners.map((point) => [...point]) });
    MOVES.whole(at);
  },
  pick: (at) => {
    pointTo(at);
    redraw();
  },
  corner: (at) => moveCorner(press.index, at),
  middle: (at) => Object.assign(press, { what: "corner", index: insertCorner(press.index, at) }),
  whole: (at) => {
    if (!press.hasSnapshot) snapshot();
    press.hasSnapshot = true;
    moveAll(at[0] - press.at[0], at[1] - press.at[1], press.corners);
  },
  stroke: (at) => {
    sketch.stroke.push(at);
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
    clearTimeout(longPress);
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
  if (event.pointerType === "touch" && draft.mode === "navigate")
    longPress = setTimeout(() => openMenuAt(event), LONG_PRESS_MS);
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
    if (event.pointerType === "mouse") moveFreely(event, at);
    return;
  }
  const [dx, dy] = [event.offsetX - press.x, event.offsetY - press.y];
  press.moved ||= Math.hypot(dx, dy) > CLICK_PX;
  if (!press.moved) return;
  clearTimeout(longPress);
  MOVES[press.what](at, dx, dy);
});

// The mouse moves without a button.
function moveFreely(event, at) {
  if (draft.mode === "goal") placeGoal(at);
  else if (sketch.measure || sketch.robot) MOVES.pick(at);
  else if (draft.mode === "navigate") {
    const target = targetAt([event.offsetX, event.offsetY]);
    canvas.classList.toggle("point", target !== null);
    if (hover(target)) redraw();
  }
}

function openMenuAt({ offsetX, offsetY }) {
  cancelPress();
  openMenu([offsetX, offsetY]);
}

canvas.addEventListener("pointerup", (event) => {
  fingers.delete(event.pointerId);
  clearTimeout(longPress);
  if (!press) return;
  const { what, moved, at, button, index, goal } = press;
  const here = toWorld(event.offsetX, event.offsetY);
  const to = goal && draggedTo(press, here);
  const { heading, stroke } = sketch;
  press = null;
  if (what === "stroke") {
    sketch.stroke = [];
    if (moved) setFreehand(stroke, 1 / view.scale);
  } else if (what === "goal") {
    cancelPress();
    if (!moved && isOnOffer(event)) acceptOffer();
    else click(at, heading);
  } else if (what === "middle") {
    insertCorner(index, toWorld(event.offsetX, event.offsetY));
  } else if (what === "pick") {
    finishAt(here);
    redraw();
  } else if (what === "flag" && moved) {
    cancelPress();
    moveGoal(goal, roundedPoint(to));
  } else if (!moved && button === 0) {
    if (isOnOffer(event)) acceptOffer();
    else if (draft.mode === "navigate") select(targetAt([event.offsetX, event.offsetY]));
    else if (what !== "corner" || draft.mode === "draw") click(at);
  } else if (!moved && button === 2) {
    if (isDrawing()) removeCorner(draft.corners.findIndex((point) => isNear(point, event)));
    else openMenuAt(event);
  }
});

canvas.addEventListener("pointercancel", (event) => {
  fingers.delete(event.pointerId);
  clearTimeout(longPress);
  cancelPress();
});
canvas.addEventListener("pointerleave", () => {
  if (!press) cancelPress();
  if (hover(null)) redraw();
  setText(element("where"), "");
});
canvas.addEventListener("dblclick", (event) => {
  const target = targetAt([event.offsetX, event.offsetY]);
  const isViewer = document.body.dataset.role === "viewer";
  if (draft.mode === "navigate" && target?.kind === "zone" && !isViewer)
    setMode("edit", target.item);
});
// The menu key, for what is selected or the middle of the map.
canvas.addEventListener("keydown", (event) => {
  if (event.key !== "ContextMenu" && !(event.key === "F10" && event.shiftKey)) return;
  event.preventDefault();
  openMenu(selectedPixel(), { byKeyboard: true });
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

function selectedPixel() {
  const item = selectedItem();
  const place =
    item?.place ?? (item?.x_m !== undefined ? [item.x_m, item.y_m] : item?.geometry?.coordinates[0][0]);
  return place ? toPage(place) : [size.width / 2, size.height / 2];
}

function click(at, heading = null) {
  if (clicked(...at, heading)) finish();
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
export function placeGoal(at) {
  Object.assign(sketch, { goal: roundedPoint(at), heading: null, path: [], verdict: "" });
  const [x, y] = sketch.goal;
  const last = sketch.movedGoal === null ? world.state?.queue.at(-1) : null;
  const question = {
    goal: { x_m: x, y_m: y },
    ...(last ? { start: { x_m: last.x_m, y_m: last.y_m } } : {}),
  };
  askPreview(question, (answer) => {
    Object.assign(sketch, { path: answer.path, verdict: answer.text });
    redraw();
    sketchChanged();
  });
  redraw();
  sketchChanged();
}

// Forget what the pointer was placing.
export function cancelPress() {
  const wasGoal = sketch.goal !== null;
  if (wasGoal || sketch.stroke.length) askPreview(null);
  Object.assign(sketch, { goal: null, heading: null, path: [], verdict: "", stroke: [] });
  sketch.movedGoal = null;
  press = null;
  redraw();
  if (wasGoal) sketchChanged();
}

onDraft(() => isDrawing() && dropOffer());
