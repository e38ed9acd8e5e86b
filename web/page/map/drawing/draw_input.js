// What the operator is drawing on the map, and the scale bar.

import { midpoints } from "../../core/geometry.js";
import { decimal } from "../../core/text/language.js";
import { isLight } from "../../core/theme.js";
import { listDraft } from "../../beware/effect.js";
import { draft, outline } from "../../zones/draft.js";
import { placeLabel } from "./labels.js";
import { arrow, COLOURS, cross, dot, fill, flag, line, pen } from "./strokes.js";
import { size, toPage, view } from "../view.js";
import { sketch, world } from "../world.js";

const HEADING_M = 0.6;
const SCALES_M = [1, 2, 5, 10, 20, 50, 100];
const MIN_SCALE_PX = 60;
const SELECTED = "#ff7b00";

export function drawPreview(path) {
  line(path, "#00000080", 5, [8, 6]);
  line(path, COLOURS.draft, 3, [8, 6]);
}

// The effect of a draft of the beware list: cells that appear are filled, those that go are hollow.
export function drawListDraft() {
  const { appear, go, path } = listDraft;
  if (!appear.length && !go.length && !path.length) return;
  const size = world.map.resolution_m * view.scale;
  pen.fillStyle = "#ff2ed1cc";
  pen.strokeStyle = "#2ea043";
  pen.lineWidth = 1.5;
  for (const cell of appear) {
    const [x, y] = toPage(cell);
    pen.fillRect(x - size / 2, y - size / 2, size, size);
  }
  for (const cell of go) {
    const [x, y] = toPage(cell);
    pen.strokeRect(x - size / 2, y - size / 2, size, size);
  }
  drawPreview(path);
}

export function drawDraft() {
  const { corners, preview, tool, selected } = draft;
  const ring = outline();
  drawPreview(preview);
  fill(ring, "#ffb70333");
  line(ring, COLOURS.draft, 2.5, [], ring.length > 2);
  if (tool === "corridor") line(corners, COLOURS.draft, 1, [4, 4]);
  if (draft.crossing) cross([draft.crossing.x_m, draft.crossing.y_m], 9, COLOURS.bad);
  if (draft.mode === "edit")
    for (const { at } of midpoints(tool, corners)) dot(at, 4.5, COLOURS.draft, { hollow: true });
  corners.forEach((corner, i) =>
    dot(corner, i === selected ? 8 : 6, i === selected ? SELECTED : COLOURS.draft),
  );
}

export function drawSketch() {
  line(sketch.stroke, COLOURS.draft, 3);
  if (!sketch.goal) return;
  drawPreview(sketch.path);
  flag(sketch.goal, "+", COLOURS.draft);
  if (sketch.heading !== null) arrow(sketch.goal, sketch.heading, HEADING_M, COLOURS.draft);
  if (!sketch.verdict) return;
  const [x, y] = toPage(sketch.goal);
  placeLabel(sketch.verdict, [x, y + 18], { colour: "#ffe3a3", isForced: true });
}

export function drawScale(height) {
  const metres = SCALES_M.find((m) => m * view.scale > MIN_SCALE_PX) ?? SCALES_M.at(-1);
  const [x, y] = [size.width - metres * view.scale - 14, height - 14];
  const [ink, ground] = isLight() ? ["#1d2733", "#ffffffcc"] : ["#e6ebf2", "#0b0f15cc"];
  // A wall below it may have its colour.
  pen.fillStyle = ground;
  pen.fillRect(x - 5, y - 19, metres * view.scale + 10, 27);
  pen.fillStyle = ink;
  pen.fillRect(x, y, metres * view.scale, 3);
  pen.font = "12px sans-serif";
  pen.textAlign = "left";
  pen.textBaseline = "bottom";
  pen.fillText(`${decimal(metres)} m`, x, y - 2);
}
