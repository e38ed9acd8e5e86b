// The part of the world that the map shows: all of it, the robot's surroundings, or what the
// operator chooses.

import { element } from "../core/dom.js";

const FIT_SHARE = 0.97;
const CLOSE_SCALE = 60;
const [MIN_SCALE, MAX_SCALE] = [2, 800];
const BORDER_SHARE = 0.05; // of a cell
export const canvas = element("map");
// Pixels per metre, the point in the middle in metres, and whether the view follows the robot.
export const view = { scale: 40, x: 0, y: 0, fitted: false, follows: false };
const listeners = [];
export const onView = (listener) => listeners.push(listener);
const changed = () => {
  for (const listener of listeners) listener();
};

// Differs between views for which the ground has to be drawn again.
export const viewKey = () =>
  `${canvas.clientWidth} ${canvas.clientHeight} ${window.devicePixelRatio || 1} ${view.scale} ${view.x} ${view.y}`;

export const toWorld = (px, py) => [
  view.x + (px - canvas.clientWidth / 2) / view.scale,
  view.y - (py - canvas.clientHeight / 2) / view.scale,
];
export const toPage = ([x, y]) => [
  canvas.clientWidth / 2 + (x - view.x) * view.scale,
  canvas.clientHeight / 2 - (y - view.y) * view.scale,
];

// Show the whole map.
export function fit(map) {
  const box = canvas.getBoundingClientRect();
  if (!map || box.width === 0) return;
  const { cols, rows, resolution_m: r, origin_x_m: x, origin_y_m: y } = map;
  const scale = Math.min(box.width / (cols * r), box.height / (rows * r)) * FIT_SHARE;
  Object.assign(view, { scale, x: x + (cols * r) / 2, y: y + (rows * r) / 2, fitted: true });
  follow(false);
}

export function follow(on) {
  view.follows = on;
  if (on && view.scale < CLOSE_SCALE) view.scale = CLOSE_SCALE;
  changed();
}

export function centreOn([x, y]) {
  Object.assign(view, {
    x,
    y,
    scale: Math.max(view.scale, CLOSE_SCALE),
    fitted: true,
    follows: false,
  });
  changed();
}

export function centreOnRobot(pose) {
  if (view.follows && pose && pose.x_m !== null) Object.assign(view, { x: pose.x_m, y: pose.y_m });
}

// Zoom around a pixel of the canvas, by default its middle.
export function zoom(factor, px = canvas.clientWidth / 2, py = canvas.clientHeight / 2) {
  const [x, y] = toWorld(px, py);
  view.scale = Math.min(Math.max(view.scale * factor, MIN_SCALE), MAX_SCALE);
  const [nextX, nextY] = toWorld(px, py);
  view.x += x - nextX;
  view.y += y - nextY;
  changed();
}

// Move the view by pixels from where it was.
export function pan(from, dx, dy) {
  Object.assign(view, { x: from.x - dx / view.scale, y: from.y + dy / view.scale, follows: false });
  changed();
}

// The nearest point of the map, just inside its border.
export function clampToMap(
  [x, y],
  { cols, rows, resolution_m: r, origin_x_m: left, origin_y_m: bottom },
) {
  const border = r * BORDER_SHARE;
  const clamp = (value, low, high) => Math.min(Math.max(value, low + border), high - border);
  return [clamp(x, left, left + cols * r), clamp(y, bottom, bottom + rows * r)];
}
