// What is selected or below the pointer, and what is measured, on the map.

import { boxAround, distance } from "../../core/geometry.js";
import { decimal, number, t } from "../../core/text/language.js";
import { draft } from "../../zones/draft.js";
import { colourOf } from "../../zones/zones.js";
import { placeLabel, shortened } from "./labels.js";
import { strength } from "../layers.js";
import { isLit, selectedItem, selection } from "../pointer/selection.js";
import { arrow, COLOURS, dot, line, pen } from "./strokes.js";
import { toPage, view } from "../view.js";
import { sketch, world } from "../world.js";

const RING_PX = 14;
const NAMED_FROM_PX = 36; // a smaller zone is named only below the pointer
const ROBOT_ARROW_M = 0.8;

const ringOf = (zone) => zone.geometry.coordinates[0].slice(0, -1);

function boxOf(ring) {
  const { left, right, bottom, top } = boxAround(ring.map(toPage));
  return { left, right, top: bottom, bottom: top }; // down the page y grows
}

export function drawZoneNames() {
  if (strength("zones") === 0) return;
  for (const zone of [...world.zones, ...world.closed]) {
    if (zone.id === draft.id) continue;
    const { enabled, name, max_speed_mps: limit } = zone.properties;
    const isNamed = isLit("zone", zone.id);
    const { left, right, top, bottom } = boxOf(ringOf(zone));
    if (!isNamed && right - left < NAMED_FROM_PX && bottom - top < NAMED_FROM_PX) continue;
    const text = `${isNamed ? name : shortened(name)}${limit ? ` ≤ ${decimal(limit)} m/s` : ""}${enabled ? "" : ` (${t("off")})`}`;
    const middle = [(left + right) / 2, (top + bottom) / 2];
    placeLabel(text, middle, {
      colour: enabled ? "#fff" : "#aab4c2",
      around: { left, right, top, bottom },
      isForced: isNamed,
    });
  }
}

function ring([x, y], radius, colour) {
  pen.beginPath();
  pen.arc(x, y, radius, 0, 2 * Math.PI);
  for (const [width, style] of [
    [5, "#000000b0"],
    [2.5, colour],
  ]) {
    pen.lineWidth = width;
    pen.strokeStyle = style;
    pen.stroke();
  }
}

export function drawSelection() {
  const item = selectedItem();
  if (!item) return;
  if (selection.kind === "zone") {
    if (item.id === draft.id) return;
    line(ringOf(item), "#000000b0", 8, [], true);
    line(ringOf(item), "#ffffff", 5.5, [], true);
    line(ringOf(item), colourOf(item), 2.5, [], true);
  } else if (selection.kind === "goal") {
    ring(toPage([item.x_m, item.y_m]), RING_PX, "#fff");
  } else if (selection.kind === "person") {
    ring(toPage([item.x_m, item.y_m]), item.radius_m * view.scale + 4, "#fff");
  } else {
    ring(toPage(item.place), RING_PX, COLOURS.draft);
    const [x, y] = toPage(item.place);
    placeLabel(`${item.class_name} ${Math.round(100 * item.confidence)} %`, [x, y + 26], {
      colour: "#ffe3a3",
      isForced: true,
    });
  }
}

export function drawPicked() {
  const { measure, robot } = sketch;
  if (measure) {
    const { from, to } = measure;
    line([from, to], "#000000a0", 5);
    line([from, to], "#fff", 2.5);
    dot(from, 4, COLOURS.draft);
    dot(to, 4, COLOURS.draft);
    const [x, y] = toPage([(from[0] + to[0]) / 2, (from[1] + to[1]) / 2]);
    placeLabel(`${number(distance(from, to), 2)} m`, [x, y - 16], { colour: "#fff", isForced: true });
  }
  if (!robot) return;
  dot(robot.at, 6, COLOURS.robot);
  arrow(robot.at, robot.yaw, ROBOT_ARROW_M, COLOURS.robot);
}
