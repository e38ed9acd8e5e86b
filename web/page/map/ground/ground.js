// What does not move below the robot: cells, grid lines and zones. Drawn once for a part of the
// world, and copied from then on.

import { draft } from "../../zones/draft.js";
import { colourOf } from "../../zones/zones.js";
import { drawLayer } from "../layers.js";
import { COLOURS, drawGrid, drawOn, fill, line, pen, texture } from "../drawing/strokes.js";
import * as tiles from "./tiles.js";
import { canvas, toPage, view, viewKey } from "../view.js";
import { world } from "../world.js";

const ground = { canvas: new OffscreenCanvas(1, 1), key: "" };
let zonesVersion = 0;

export function zonesChanged() {
  zonesVersion += 1;
}

const currentKey = () => `${viewKey()} ${tiles.paintCount} ${zonesVersion} ${draft.id}`;
export const isGroundCurrent = () => ground.key === currentKey();

// Copy the ground onto the page; `ratio` is pixels of the screen per pixel of the page.
export function copyGround(ratio) {
  if (!isGroundCurrent()) drawGround(ratio);
  pen.drawImage(ground.canvas, 0, 0);
}

function drawGround(ratio) {
  Object.assign(ground.canvas, { width: canvas.width, height: canvas.height });
  drawOn(ground.canvas.getContext("2d"), () => {
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    drawCells();
    drawGrid();
    drawLayer("zones", () => {
      for (const zone of [...world.zones, ...world.closed])
        if (zone.id !== draft.id) drawZone(zone);
    });
  });
  ground.key = currentKey();
}

function drawCells() {
  if (!world.picture) return;
  const { cols, rows, resolution_m: r, origin_x_m: x, origin_y_m: y } = world.map;
  const [left, top] = toPage([x, y + rows * r]);
  pen.imageSmoothingEnabled = view.scale * r < 2;
  pen.imageSmoothingQuality = "high";
  pen.drawImage(world.picture, left, top, cols * r * view.scale, rows * r * view.scale);
}

function drawZone(zone) {
  const corners = zone.geometry.coordinates[0].slice(0, -1);
  const { enabled, kind } = zone.properties;
  const isLimit = kind === "speed-limit";
  const colour = colourOf(zone);
  // What a zone to stay in forbids lies outside of it, where the cells show it.
  if (enabled && kind !== "stay-inside") fill(corners, texture(colour, isLimit));
  const dash = enabled ? (isLimit ? [10, 4] : []) : [6, 5];
  line(corners, enabled ? colour : COLOURS.driven, 2.5, dash, true);
}
