// The map from above, layer by layer. It needs no graphics card, and the operator can do every task
// on it.

import { onListDraft } from "../beware/effect.js";
import { drawScheduler } from "../core/draw_scheduler.js";
import { boxAround } from "../core/geometry.js";
import { isLight, onTheme } from "../core/theme.js";
import { onOffer } from "../mission/goals.js";
import { onPathDraft, pathDraft } from "../mission/path_settings.js";
import { draft, isDrawing, onDraft } from "../zones/draft.js";
import { drawDraft, drawListDraft, drawPreview, drawScale, drawSketch } from "./drawing/draw_input.js";
import {
  drawCandidates,
  drawCommandedMotion,
  drawGoals,
  drawPeople,
  drawRobot,
} from "./drawing/draw_robot.js";
import { copyGround, isGroundCurrent, zonesChanged } from "./ground/ground.js";
import { drawCandidatePlaces, drawProposal, drawUncertainty } from "./drawing/draw_place.js";
import { drawPicked, drawSelection, drawZoneNames } from "./drawing/draw_selection.js";
import { clearLabels, placeLabel } from "./drawing/labels.js";
import { drawLayer, onLayers } from "./layers.js";
import { onSelect } from "./pointer/selection.js";
import { COLOURS, dot, fill, line, pen } from "./drawing/strokes.js";
import * as tiles from "./ground/tiles.js";
import {
  canvas,
  centreOnRobot,
  fit as fitTo,
  keepInSight,
  measure,
  onView,
  shows,
  size,
  toPage,
  view,
} from "./view.js";
import { looksAlike, takeValues, world } from "./world.js";

const UNSEEN_DASH = [5, 5];
const CAMERA_FILL = "#ffb70326";
const AROUND_M = 0.5; // around what is known
const CAMERA_EDGE = "#ffb70370";
// Functions that draw over the paths and below the robot; each gets the tools of this file.
export const overlays = [];
let drawnState = null;
let isWhole = false;
let shownSize = [0, 0];

export const redraw = drawScheduler("map", canvas, draw);

// Show what is known; or the whole map, if that is shown already.
export function fit() {
  if (!world.map) return;
  isWhole = view.isAuto && !isWhole;
  fitTo(isWhole ? wholeArea() : knownArea());
}

function wholeArea() {
  const { cols, rows, resolution_m: r, origin_x_m: left, origin_y_m: bottom } = world.map;
  return { left, right: left + cols * r, bottom, top: bottom + rows * r };
}

// What was seen, with the robot, its path, its goals and the zones.
function knownArea() {
  const { pose, queue = [] } = world.state ?? {};
  const area = tiles.knownArea(world.map);
  const lines = [
    world.path,
    queue.map((goal) => [goal.x_m, goal.y_m]),
    ...world.zones.map((zone) => zone.geometry.coordinates[0]),
    pose && pose.x_m !== null ? [[pose.x_m, pose.y_m]] : [],
    area ? [[area.left, area.bottom], [area.right, area.top]] : [],
  ];
  const known = boxAround(lines.flat());
  if (!known) return wholeArea();
  return {
    left: known.left - AROUND_M,
    right: known.right + AROUND_M,
    bottom: known.bottom - AROUND_M,
    top: known.top + AROUND_M,
  };
}

// The view grows with what is known until the operator moves it, but not below the pointer.
function growView() {
  if (isWhole && view.isAuto && !shows(wholeArea())) fitTo(wholeArea());
  if (!view.isAuto || isWhole || isDrawing() || canvas.matches(":hover")) return;
  const area = knownArea();
  if (!shows(area)) fitTo(area);
}

export function update(values) {
  const changed = takeValues(values);
  if (changed.includes("classes")) repaint();
  if (changed.includes("zones") || changed.includes("closed")) zonesChanged();
  if (world.map && !view.fitted && world.picture) fit();
  else if (values.picture || changed.includes("map")) growView();
  if (changed.length === 0 && looksAlike(world.state, drawnState) && isGroundCurrent()) return;
  centreOnRobot(world.state?.pose);
  redraw();
}

function draw() {
  drawnState = world.state;
  const ratio = window.devicePixelRatio || 1;
  const { width, height } = measure();
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  // Scale in px/m and the point in the middle in metres, for programs that drive the page.
  canvas.dataset.place = `${view.scale} ${view.x} ${view.y}`;
  pen.setTransform(1, 0, 0, 1, 0, 0);
  pen.clearRect(0, 0, canvas.width, canvas.height);
  if (!world.map) return;
  copyGround(ratio);
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  drawPaths();
  clearLabels();
  drawSelection();
  for (const paint of overlays) paint({ pen, line, dot, placeLabel, toPage });
  drawGoals();
  drawZoneNames();
  drawLayer("people", drawPeople);
  drawLayer("motion", drawCommandedMotion);
  drawUncertainty();
  drawRobot();
  drawCandidatePlaces();
  drawProposal();
  drawListDraft();
  drawPreview(pathDraft.path);
  if (isDrawing()) drawDraft();
  drawSketch();
  drawPicked();
  drawScale(height);
}

function drawPaths() {
  drawLayer("view", () => {
    fill(world.view, CAMERA_FILL);
    line(world.view, CAMERA_EDGE, 1, [3, 3], true);
  });
  drawLayer("driven", () => line(world.driven, COLOURS.driven, 2, [2, 4]));
  drawLayer("candidates", drawCandidates);
  drawLayer("path", () => {
    line(world.path, "#ffffffc0", 5);
    line(world.path, COLOURS.path, 3);
    for (const part of world.unseen) line(part, "#ffffff", 3, UNSEEN_DASH);
  });
  drawLayer("waypoints", () => {
    for (const point of world.waypoints) dot(point, 4, COLOURS.path, { diamond: true });
  });
}

// Whether a point was in the view before its size changed.
const wasInSight = ([x, y]) =>
  Math.abs(x - view.x) * view.scale < shownSize[0] / 2 &&
  Math.abs(y - view.y) * view.scale < shownSize[1] / 2;

// With another list, layer or theme the same cells look different.
function repaint() {
  tiles.repaint(world.classes, isLight());
  redraw();
}

new ResizeObserver(() => {
  const { pose } = world.state ?? {};
  const place = pose && pose.x_m !== null ? [pose.x_m, pose.y_m] : null;
  if (!view.fitted || !world.map || size.width === 0) redraw();
  else if (view.isAuto) fitTo(isWhole ? wholeArea() : knownArea());
  else if (place && wasInSight(place)) keepInSight(place);
  else redraw();
  shownSize = [size.width, size.height];
}).observe(canvas);
onDraft(() => {
  canvas.classList.toggle("pick", draft.mode !== "navigate");
  redraw();
});
onListDraft(redraw);
onLayers(repaint);
onTheme(repaint);
onView(redraw);
onOffer(redraw);
onPathDraft(redraw);
onSelect(redraw);
