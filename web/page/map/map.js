// The map from above, layer by layer. It needs no graphics card, and the operator can do every task
// on it.

import { drawScheduler } from "../core/draw_scheduler.js";
import { isLight, onTheme } from "../core/theme.js";
import { onOffer } from "../mission/goals.js";
import { draft, isDrawing, onDraft } from "../zones/draft.js";
import { drawDraft, drawScale, drawSketch } from "./draw_input.js";
import {
  drawCandidates,
  drawCommandedMotion,
  drawGoals,
  drawPeople,
  drawRobot,
} from "./draw_robot.js";
import { copyGround, isGroundCurrent, zonesChanged } from "./ground.js";
import { drawLayer, onLayers } from "./layers.js";
import { COLOURS, dot, fill, line, pen, tag } from "./strokes.js";
import * as tiles from "./tiles.js";
import { canvas, centreOnRobot, fit as fitTo, onView, toPage, view } from "./view.js";
import { looksAlike, takeValues, world } from "./world.js";

const CAMERA_FILL = "#ffb70326";
const CAMERA_EDGE = "#ffb70370";
// Functions that draw over the paths and below the robot; each gets the tools of this file.
export const overlays = [];
let drawnState = null;

export const redraw = drawScheduler("map", canvas, draw);
export const fit = () => fitTo(world.map);

export function update(values) {
  const changed = takeValues(values);
  if (changed.includes("classes")) repaint();
  if (changed.includes("zones") || changed.includes("closed")) zonesChanged();
  if (world.map && !view.fitted) fit();
  if (changed.length === 0 && looksAlike(world.state, drawnState) && isGroundCurrent()) return;
  centreOnRobot(world.state?.pose);
  redraw();
}

function draw() {
  drawnState = world.state;
  const ratio = window.devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
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
  for (const paint of overlays) paint({ pen, line, dot, tag, toPage });
  drawGoals();
  drawLayer("people", drawPeople);
  drawLayer("motion", drawCommandedMotion);
  drawRobot();
  if (isDrawing()) drawDraft();
  drawSketch();
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
  });
  drawLayer("waypoints", () => {
    for (const point of world.waypoints) dot(point, 4, COLOURS.path, { diamond: true });
  });
}

// With another list, layer or theme the same cells look different.
function repaint() {
  tiles.repaint(world.classes, isLight());
  redraw();
}

new ResizeObserver(() => {
  if (view.fitted) redraw();
  else fit();
}).observe(canvas);
onDraft(() => {
  canvas.classList.toggle("pick", draft.mode !== "navigate");
  redraw();
});
onLayers(repaint);
onTheme(repaint);
onView(redraw);
onOffer(redraw);
