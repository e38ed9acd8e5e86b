// The pointer on the map: look around, place goals with a heading, draw by corner or by hand, move what was drawn. Two fingers zoom.

import { clicked, draft, dragged, drawing, freeHand, grab, insert, ring, shift, snapshot, remove } from "../zones/draft.js";
import { setText } from "../core/dom.js";
import { offer, takeOffer } from "../mission/goals.js";
import { hand, redraw, world } from "./map.js";
import { ask } from "../zones/preview.js";
import { inside, middles, place } from "../core/geometry.js";
import { canvas, onMap as clamped, pan, toPage, toWorld, view, zoom } from "./view.js";

const CLICK_PX = 4;
const GRAB_PX = 11;
const HEADING_PX = 18;
const fingers = new Map(); // pointer → where it touches the canvas
let pressed = null;

const onMap = (at) => clamped(at, world.map);
const near = (point, { offsetX: x, offsetY: y }) => { const [px, py] = toPage(point); return Math.hypot(px - x, py - y) <= GRAB_PX; };

// What is under the pointer decides what a drag moves; anything else moves the map.
function aim(event) {
  const at = toWorld(event.offsetX, event.offsetY);
  if (event.button !== 0) return { what: "map" };
  if (draft.mode === "goal") return { what: "goal" };
  if (!drawing()) return { what: "map" };
  const corner = draft.corners.findIndex((point) => near(point, event));
  if (corner >= 0) return { what: "corner", index: corner };
  if (draft.mode === "draw" && draft.tool === "free" && draft.corners.length === 0) return { what: "stroke" };
  if (draft.mode === "edit" || draft.tool === "free") {
    const middle = draft.mode === "edit" && middles(draft.tool, draft.corners).find((side) => near(side.at, event));
    if (middle) return { what: "middle", index: middle.after };
    if (inside(at, ring())) return { what: "whole", corners: draft.corners.map((point) => [...point]) };
  }
  return { what: "map" };
}

// Two fingers move the map with their middle and zoom it by their distance.
function pinch(event) {
  const span = () => { const [[ax, ay], [bx, by]] = fingers.values(); return { x: (ax + bx) / 2, y: (ay + by) / 2, size: Math.hypot(ax - bx, ay - by) }; };
  const before = span();
  fingers.set(event.pointerId, [event.offsetX, event.offsetY]);
  const after = span();
  pan({ ...view }, after.x - before.x, after.y - before.y);
  if (before.size > 0) zoom(after.size / before.size, after.x, after.y);
}

canvas.addEventListener("pointerdown", (event) => {
  if (!world.map) return;
  fingers.set(event.pointerId, [event.offsetX, event.offsetY]);
  if (fingers.size > 1) { letGo(); return; } // what the first finger began was no click
  pressed = { ...aim(event), x: event.offsetX, y: event.offsetY, button: event.button, moved: false, from: { ...view } };
  pressed.at = toWorld(event.offsetX, event.offsetY);
  canvas.setPointerCapture(event.pointerId);
  if (pressed.what === "corner") grab(pressed.index);
  if (pressed.what === "goal") { Object.assign(hand, { goal: place(pressed.at), heading: null }); showWay(); }
  if (pressed.what === "stroke") hand.stroke = [pressed.at];
});

canvas.addEventListener("pointermove", (event) => {
  const at = toWorld(event.offsetX, event.offsetY);
  setText(document.getElementById("where"), `x ${at[0].toFixed(2)}  y ${at[1].toFixed(2)} m`);
  if (!world.map) return;
  if (fingers.size === 2 && fingers.has(event.pointerId)) { pinch(event); return; }
  if (!pressed) { if (draft.mode === "goal" && event.pointerType === "mouse") hover(at); return; }
  const [dx, dy] = [event.offsetX - pressed.x, event.offsetY - pressed.y];
  pressed.moved ||= Math.hypot(dx, dy) > CLICK_PX;
  if (!pressed.moved) return;
  const moves = {
    corner: () => dragged(pressed.index, onMap(at)),
    middle: () => { Object.assign(pressed, { what: "corner", index: insert(pressed.index, onMap(at)) }); },
    whole: () => { if (!pressed.held) { snapshot(); pressed.held = true; } shift(at[0] - pressed.at[0], at[1] - pressed.at[1], pressed.corners); },
    stroke: () => { hand.stroke.push(onMap(at)); redraw(); },
    goal: () => { hand.heading = Math.hypot(dx, dy) > HEADING_PX ? Math.atan2(-dy, dx) : null; redraw(); },
    map: () => pan(pressed.from, dx, dy),
  };
  moves[pressed.what]();
});

canvas.addEventListener("pointerup", (event) => {
  fingers.delete(event.pointerId);
  if (!pressed) return;
  const { what, moved, at, button, index } = pressed;
  pressed = null;
  if (what === "stroke") { const stroke = hand.stroke; hand.stroke = []; if (moved) freeHand(stroke); } else if (what === "goal") {
    const yaw = hand.heading;
    letGo();
    clicked(...at, onMap(at), yaw);
  } else if (what === "middle") insert(index, onMap(toWorld(event.offsetX, event.offsetY)));
  else if (!moved && button === 0) {
    if (offer.place && near(offer.place, event)) takeOffer();
    else if (what !== "corner" || draft.mode === "draw") clicked(...at, onMap(at));
  } else if (!moved && button === 2 && drawing()) remove(draft.corners.findIndex((point) => near(point, event)));
});
canvas.addEventListener("pointercancel", (event) => { fingers.delete(event.pointerId); pressed = null; letGo(); });
canvas.addEventListener("pointerleave", () => { if (!pressed) letGo(); });
canvas.addEventListener("contextmenu", (event) => event.preventDefault());
canvas.addEventListener("wheel", (event) => { event.preventDefault(); zoom(Math.exp(-event.deltaY / 500), event.offsetX, event.offsetY); }, { passive: false });

function hover(at) {
  Object.assign(hand, { goal: place(at), heading: null, way: [], verdict: "" });
  showWay();
  redraw();
}

// The way to the goal that is being placed, from where the robot will be by then.
function showWay() {
  const [x, y] = hand.goal;
  const last = world.state?.queue.at(-1);
  const question = { goal: { x_m: x, y_m: y }, ...(last ? { start: { x_m: last.x_m, y_m: last.y_m } } : {}) };
  ask(question, (answer) => { Object.assign(hand, { way: answer.path, verdict: answer.text }); redraw(); });
}

export function letGo() {
  if (hand.goal || hand.stroke.length) ask(null);
  Object.assign(hand, { goal: null, heading: null, way: [], verdict: "", stroke: [] });
  pressed = null;
  redraw();
}
