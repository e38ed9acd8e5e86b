// What the operator is doing with the pointer: looking, picking goals, drawing a zone or editing one.
// The draft lives here and nowhere else, so the stream of the robot's state cannot touch it.

import { post, request } from "../core/api.js";
import { element } from "../core/dom.js";
import { clearForm, describe, note, readForm, showForm } from "./draft_form.js";
import { addGoal } from "../mission/goals.js";
import { ask } from "./preview.js";
import { distance, geometry, handles, outline, place, simplified } from "../core/geometry.js";
import { say } from "../core/toasts.js";

const DOUBLE_CLICK_MS = 400;
const SAME_PLACE_M = 0.3;
const FREE_HAND_M = 0.04;
const HINTS = {
  navigate: "",
  goal: "Click the floor to queue a goal, drag to give it a heading; rest the pointer to see the way. Esc when done.",
  polygon: "Click the corners. Double-click or Enter closes the zone, Backspace takes a corner back, Esc drops it.",
  circle: "Click the middle, then the rim. Enter stores it, Esc drops it.",
  corridor: "Click along the line. Double-click or Enter ends it, Backspace takes a point back, Esc drops it.",
  free: "Press and draw around the place. Enter stores it, Esc drops it.",
  edit: "Drag a corner, a hollow mark to add one, or the whole zone; Delete takes a corner away. Enter stores, Esc keeps the stored zone.",
};

export const draft = { mode: "navigate", tool: "polygon", id: null, version: null, corners: [], selected: -1, width: 0.6, preview: [], present: [], verdict: "" };
export const drawing = () => draft.mode === "draw" || draft.mode === "edit";
export const ring = () => outline(draft.tool === "free" ? "polygon" : draft.tool, draft.corners, draft.width);
const watchers = [];
let past = [];
let future = [];
let last = { at: 0, x: 0, y: 0 };
let nextNumber = () => 1;
let sending = null;

export const onDraft = (watcher) => watchers.push(watcher);
export const nameZonesBy = (counter) => { nextNumber = counter; };

export function setMode(mode, zone = null) {
  Object.assign(draft, { mode, id: zone?.id ?? null, version: zone?.properties.version ?? null, preview: [], present: [], verdict: "", selected: -1 });
  Object.assign(draft, zone ? handles(zone) : { corners: [] });
  if (mode === "draw" && draft.corners.length === 0) draft.tool = element("draft-tool").value;
  [past, future] = [[], []];
  if (drawing()) showForm(draft, zone, `Zone ${nextNumber()}`);
  else clearForm();
  for (const button of document.querySelectorAll("[data-mode]")) button.setAttribute("aria-checked", String(button.dataset.mode === mode));
  changed();
}

export function setTool(tool) {
  if (draft.mode !== "draw") setMode("draw");
  snapshot();
  if ((draft.tool === "circle") !== (tool === "circle")) draft.corners = [];
  draft.tool = tool;
  changed();
}

// A zone that comes from elsewhere, e.g. from the camera's picture: a draft like any other.
export function propose(corners, name) {
  element("draft-tool").value = "polygon";
  setMode("draw");
  snapshot();
  draft.corners = corners.map(place);
  if (name) element("draft-name").value = name;
  changed();
}

// A click on the floor, from the 3D view or the map. `onMap` is the nearest point of the map.
export function clicked(x, y, onMap, yaw = null) {
  const now = performance.now();
  const again = now - last.at < DOUBLE_CLICK_MS && Math.hypot(x - last.x, y - last.y) < SAME_PLACE_M;
  last = { at: again ? 0 : now, x, y };
  if (draft.mode === "goal" && !again) addGoal([x, y], yaw);
  else if (draft.mode === "draw" && draft.tool !== "free") {
    if (again && draft.tool !== "circle") { finish(); return; }
    snapshot();
    if (draft.tool === "circle" && draft.corners.length > 1) draft.corners = [];
    draft.corners.push(place(onMap));
    draft.selected = draft.corners.length - 1;
    changed();
  }
}

export function grab(index) { snapshot(); draft.selected = index; }

export function dragged(index, onMap) {
  if (!drawing() || !draft.corners[index]) return;
  const [old, next] = [draft.corners[index], place(onMap)];
  if (draft.tool === "circle" && index === 0 && draft.corners[1]) draft.corners[1] = place([draft.corners[1][0] + next[0] - old[0], draft.corners[1][1] + next[1] - old[1]]);
  draft.corners[index] = next;
  changed();
}

export function insert(after, onMap) {
  snapshot();
  draft.corners.splice(after + 1, 0, place(onMap));
  draft.selected = after + 1;
  changed();
  return after + 1;
}

export function shift(dx, dy, from = draft.corners) {
  draft.corners = from.map(([x, y]) => place([x + dx, y + dy]));
  changed();
}

export function remove(index = draft.selected) {
  if (!drawing() || !draft.corners[index] || draft.tool === "circle") return;
  snapshot();
  draft.corners.splice(index, 1);
  draft.selected = Math.min(index, draft.corners.length - 1);
  changed();
}

export function freeHand(points) {
  snapshot();
  const line = simplified(points, FREE_HAND_M);
  // The end of the stroke meets its beginning.
  if (line.length > 3 && distance(line[0], line[line.length - 1]) < SAME_PLACE_M) line.pop();
  draft.corners = line.map(place);
  changed();
}

export function snapshot() {
  past.push({ corners: draft.corners.map((corner) => [...corner]), tool: draft.tool, width: draft.width });
  past = past.slice(-200);
  future = [];
}

export function undo() { travel(past, future); }
export function redo() { travel(future, past); }
export const canUndo = () => past.length > 0;
export const canRedo = () => future.length > 0;

function travel(from, to) {
  if (!from.length) return;
  to.push({ corners: draft.corners, tool: draft.tool, width: draft.width });
  Object.assign(draft, from.pop());
  changed();
}

// Until a zone's answer has come its draft stands; nothing else is begun, for the answer would end that.
export const sent = () => sending;

export function finish() {
  if (drawing() && !sending) sending = store().finally(() => { sending = null; });
}

async function store() {
  const zone = asZone();
  try {
    if (draft.mode === "draw") await post("/zones", zone);
    else await request("PUT", `/zones/${encodeURIComponent(draft.id)}`, zone, { "If-Match": `"${draft.version}"` });
    say(`Zone “${zone.properties.name}” is stored and binds the robot${zone.properties.enabled ? "" : " when it is switched on"}.`, { good: true });
    if (drawing()) setMode("navigate");
  } catch (error) {
    if (error.body?.error?.code === "outdated") {
      draft.version = error.body.stored_version;
      note("Somebody else changed this zone meanwhile. Finish again to put yours in its place, Cancel to keep the stored one.", true);
    } else note(error.message, true);
    say(error.message);
  }
}

function asZone() {
  const tool = draft.tool === "free" ? "polygon" : draft.tool;
  return { type: "Feature", geometry: geometry(tool, draft.corners, draft.width), properties: readForm() };
}

export function changed() {
  describe(draft);
  element("hint").textContent = HINTS[draft.mode === "draw" ? draft.tool : draft.mode];
  Object.assign(draft, { preview: [], present: [], verdict: "" });
  tell();
  const enough = draft.corners.length >= { circle: 2, corridor: 2 }[draft.tool] || draft.corners.length >= 3;
  ask(drawing() && enough ? { zone: asZone(), replaces: draft.id } : null, (answer) => {
    Object.assign(draft, { preview: answer.path, present: answer.present, verdict: answer.text });
    describe(draft, answer);
    tell();
  });
}

function tell() { for (const watcher of watchers) watcher(draft); }
