// What the pointer does on the map, and the zone that is being drawn or edited. The draft is kept
// here only, so that no message of the robot can overwrite it.

import { element, make } from "../core/dom.js";
import {
  distance,
  geometryOf,
  handlesOf,
  outlineOf,
  roundedPoint,
  simplify,
} from "../core/geometry.js";
import { t } from "../core/text/language.js";
import { addGoal } from "../mission/goals.js";
import { clearForm, describe, missingOf, readForm, showForm } from "./draft_form.js";
import { askPreview } from "./preview.js";

const DOUBLE_CLICK_MS = 400;
const DOUBLE_CLICK_M = 0.3;
const CLOSED_STROKE_M = 0.3;
const FREEHAND_TOLERANCE_M = 0.04;
const FREEHAND_TOLERANCE_PX = 1.5; // a hand is no steadier
const COARSER = 1.5;
// As many corners as the console takes.
export const MAX_CORNERS = 1000;
const MAX_UNDO = 200;
// What the hand does, and the keys that help it.
const CANCELS = t("Esc cancels.");
const FINISHES = t("Enter finishes the zone, Esc cancels.");
const FINISHES_TOO = t("Double-click or Enter finishes the zone, Backspace undoes, Esc cancels.");
const HINTS = {
  navigate: [],
  measure: [t("Click where the measurement ends."), CANCELS],
  place: [t("Drag or click in the direction in which it faces."), CANCELS],
  goal: [
    t("Click the floor to add a goal, drag to give it a heading."),
    t("Hover to see the path, Esc when done."),
  ],
  polygon: [t("Click the corners."), FINISHES_TOO],
  circle: [t("Click the centre, then the edge."), FINISHES],
  corridor: [t("Click along the line."), FINISHES_TOO],
  free: [t("Press and draw around the area."), FINISHES],
  edit: [
    t("Drag a corner, the zone, or a hollow mark to add a corner."),
    t("Delete removes a corner, Enter saves, Esc cancels."),
  ],
};

const WATCHED = new Set(["navigate", "measure"]); // what viewers can do on the map, too

export const draft = {
  mode: "navigate",
  number: 0, // another one for each draft that is begun
  tool: "polygon",
  id: null,
  version: null,
  asked: "", // what the next click is to point to, in the mode "point"
  corners: [],
  selected: -1,
  width: 0.6,
  preview: [],
  present: [],
  verdict: "",
  crossing: null,
};
export const isDrawing = () => draft.mode === "draw" || draft.mode === "edit";
const tool = () => (draft.tool === "free" ? "polygon" : draft.tool);
export const outline = () => outlineOf(tool(), draft.corners, draft.width);
export const isComplete = () => missingOf(draft) === "";

const listeners = [];
let undoSteps = [];
let redoSteps = [];
let lastClick = { ms: 0, x: 0, y: 0 };
let nextNumber = () => 1;

export const onDraft = (listener) => listeners.push(listener);
// Set the function that numbers the name of a new zone.
export const numberZonesBy = (count) => {
  nextNumber = count;
};

export function setMode(wanted, zone = null) {
  const isViewer = document.body.dataset.role === "viewer";
  const mode = isViewer && !WATCHED.has(wanted) ? "navigate" : wanted;
  Object.assign(draft, {
    mode,
    number: draft.number + 1,
    id: zone?.id ?? null,
    version: zone?.properties.version ?? null,
    selected: -1,
  });
  Object.assign(draft, zone ? handlesOf(zone) : { corners: [] });
  if (mode === "draw" && draft.corners.length === 0) draft.tool = element("draft-tool").value;
  [undoSteps, redoSteps] = [[], []];
  if (isDrawing()) showForm(draft, zone, t("Zone {number}", { number: nextNumber() }));
  else clearForm();
  for (const button of document.querySelectorAll("[data-mode]"))
    button.setAttribute("aria-checked", String(button.dataset.mode === mode));
  changed();
}

export function setTool(name) {
  if (draft.mode !== "draw") setMode("draw");
  snapshot();
  if ((draft.tool === "circle") !== (name === "circle")) draft.corners = [];
  draft.tool = name;
  changed();
}

// Start a draft from an outline that was found elsewhere, e.g. in the camera image.
export function propose(corners, name) {
  element("draft-tool").value = "polygon";
  setMode("draw");
  snapshot();
  draft.corners = corners.map(roundedPoint);
  if (name) element("draft-name").value = name;
  changed();
}

const PROPOSED_RADIUS_M = 0.5;

export function proposeCircle([x, y]) {
  element("draft-tool").value = "circle";
  setMode("draw");
  snapshot();
  draft.corners = [[x, y], [x + PROPOSED_RADIUS_M, y]].map(roundedPoint);
  changed();
}

// A click on the floor, from the 3D view or the map.
// Returns whether it finished the drawing.
export function clicked(x, y, yaw = null) {
  const now = performance.now();
  const isDouble =
    now - lastClick.ms < DOUBLE_CLICK_MS &&
    Math.hypot(x - lastClick.x, y - lastClick.y) < DOUBLE_CLICK_M;
  lastClick = { ms: isDouble ? 0 : now, x, y };
  if (draft.mode === "goal" && !isDouble) addGoal([x, y], yaw);
  if (draft.mode !== "draw" || draft.tool === "free") return false;
  if (isDouble && draft.tool !== "circle") return true;
  snapshot();
  if (draft.tool === "circle" && draft.corners.length > 1) draft.corners = [];
  draft.corners.push(roundedPoint([x, y]));
  draft.selected = draft.corners.length - 1;
  changed();
  return false;
}

export function grabCorner(index) {
  snapshot();
  draft.selected = index;
}

export function moveCorner(index, at) {
  if (!isDrawing() || !draft.corners[index]) return;
  const [old, next] = [draft.corners[index], roundedPoint(at)];
  if (draft.tool === "circle" && index === 0 && draft.corners[1]) {
    const [x, y] = draft.corners[1];
    draft.corners[1] = roundedPoint([x + next[0] - old[0], y + next[1] - old[1]]);
  }
  draft.corners[index] = next;
  changed();
}

// Insert a corner; returns its index.
export function insertCorner(after, at) {
  snapshot();
  draft.corners.splice(after + 1, 0, roundedPoint(at));
  draft.selected = after + 1;
  changed();
  return after + 1;
}

export function moveAll(dx, dy, from = draft.corners) {
  draft.corners = from.map(([x, y]) => roundedPoint([x + dx, y + dy]));
  changed();
}

export function removeCorner(index = draft.selected) {
  if (!isDrawing() || !draft.corners[index] || draft.tool === "circle") return;
  snapshot();
  draft.corners.splice(index, 1);
  draft.selected = Math.min(index, draft.corners.length - 1);
  changed();
}

// `pixelM` is the size in metres of a pixel of the map on which the stroke was drawn.
export function setFreehand(points, pixelM) {
  snapshot();
  let tolerance = Math.max(FREEHAND_TOLERANCE_M, FREEHAND_TOLERANCE_PX * pixelM);
  let line = simplify(points, tolerance);
  while (line.length > MAX_CORNERS) {
    tolerance *= COARSER;
    line = simplify(points, tolerance);
  }
  // The end of the stroke meets its beginning.
  if (line.length > 3 && distance(line[0], line[line.length - 1]) < CLOSED_STROKE_M) line.pop();
  draft.corners = line.map(roundedPoint);
  changed();
}

export function snapshot() {
  undoSteps.push({
    corners: draft.corners.map((corner) => [...corner]),
    tool: draft.tool,
    width: draft.width,
  });
  undoSteps = undoSteps.slice(-MAX_UNDO);
  redoSteps = [];
}

export const undo = () => step(undoSteps, redoSteps);
export const redo = () => step(redoSteps, undoSteps);
export const canUndo = () => undoSteps.length > 0;
export const canRedo = () => redoSteps.length > 0;

function step(from, to) {
  if (!from.length) return;
  to.push({ corners: draft.corners, tool: draft.tool, width: draft.width });
  Object.assign(draft, from.pop());
  changed();
}

// The draft as the API takes a zone.
export const asZone = () => ({
  type: "Feature",
  geometry: geometryOf(tool(), draft.corners, draft.width),
  properties: readForm(),
});

// Show the draft as it is now, and ask what it would do to the path.
export function changed() {
  describe(draft);
  const hints = { ...HINTS, point: [draft.asked, CANCELS] };
  const [act, keys] = hints[draft.mode === "draw" ? draft.tool : draft.mode];
  element("hint").replaceChildren(...(act ? [act, make("span", { class: "keys" }, ` ${keys}`)] : []));
  Object.assign(draft, { preview: [], present: [], verdict: "", crossing: null });
  notifyListeners();
  askPreview(
    isDrawing() && isComplete() ? { zone: asZone(), replaces: draft.id } : null,
    (answer) => {
      Object.assign(draft, {
        preview: answer.path,
        present: answer.present,
        verdict: answer.text,
        crossing: answer.crossing ?? null,
      });
      describe(draft, answer);
      notifyListeners();
    },
  );
}

function notifyListeners() {
  for (const listener of listeners) listener(draft);
}
