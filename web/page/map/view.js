// The part of the world that the map shows: all of it, the robot's surroundings, or what the
// operator chooses.

import { element } from "../core/dom.js";

const FIT_SHARE = 0.97;
const CLOSE_SCALE = 60;
const [MIN_SCALE, MAX_SCALE] = [2, 800];
const IN_SIGHT_PX = 60;
export const canvas = element("map-canvas");
const MAX_FITTED_SCALE = 100;
let fittedScale = MIN_SCALE;
// Pixels per metre, the point in the middle in metres, whether the view was ever fitted, follows the
// robot, and still shows what it was fitted to (the operator has not moved it since).
export const view = { scale: 40, x: 0, y: 0, fitted: false, follows: false, isAuto: false };
// Width and height of the canvas in pixels of the page, as of the newest drawing or change of size:
// to ask the canvas for every point costs as much as to draw it.
export const size = {};
export const measure = () =>
  Object.assign(size, { width: canvas.clientWidth, height: canvas.clientHeight });
measure();
new ResizeObserver(measure).observe(canvas);
const listeners = [];
export const onView = (listener) => listeners.push(listener);
const changed = () => {
  for (const listener of listeners) listener();
};

// Differs between views for which the ground has to be drawn again.
export const viewKey = () =>
  `${size.width} ${size.height} ${window.devicePixelRatio || 1} ${view.scale} ${view.x} ${view.y}`;

export const toWorld = (px, py) => [
  view.x + (px - size.width / 2) / view.scale,
  view.y - (py - size.height / 2) / view.scale,
];
export const toPage = ([x, y]) => [
  size.width / 2 + (x - view.x) * view.scale,
  size.height / 2 - (y - view.y) * view.scale,
];

// Show an area: { left, right, bottom, top } in metres.
export function fit({ left, right, bottom, top }) {
  const { width, height } = size;
  if (width === 0) return;
  const scale = Math.min(width / (right - left), height / (top - bottom)) * FIT_SHARE;
  fittedScale = Math.min(scale, MAX_FITTED_SCALE);
  Object.assign(view, {
    scale: fittedScale,
    x: (left + right) / 2,
    y: (bottom + top) / 2,
    fitted: true,
  });
  follow(false);
  view.isAuto = true;
}

// Whether all of an area is shown.
export function shows({ left, right, bottom, top }) {
  const [shownLeft, shownTop] = toWorld(0, 0);
  const [shownRight, shownBottom] = toWorld(size.width, size.height);
  return left >= shownLeft && right <= shownRight && bottom >= shownBottom && top <= shownTop;
}

// Move the view as little as possible, so that a point is inside it, away from its edge.
export function keepInSight([x, y]) {
  const room = Math.min(size.width, size.height) / 2 / view.scale;
  const margin = Math.min(IN_SIGHT_PX / view.scale, room);
  const clamp = (value, reach) => Math.min(Math.max(value, -reach), reach);
  const [dx, dy] = [x - view.x, y - view.y];
  const reach = [size.width, size.height].map((px) => px / 2 / view.scale - margin);
  Object.assign(view, {
    x: view.x + dx - clamp(dx, reach[0]),
    y: view.y + dy - clamp(dy, reach[1]),
  });
  changed();
}

export function follow(on) {
  Object.assign(view, { follows: on, isAuto: false });
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
    isAuto: false,
  });
  changed();
}

export function centreOnRobot(pose) {
  if (view.follows && pose && pose.x_m !== null) Object.assign(view, { x: pose.x_m, y: pose.y_m });
}

// Zoom around a pixel of the canvas, by default its middle. A large map that is fitted is smaller than
// at the least scale; it is zoomed out no farther than that.
export function zoom(factor, px = size.width / 2, py = size.height / 2) {
  const [x, y] = toWorld(px, py);
  view.isAuto = false;
  const least = Math.min(MIN_SCALE, fittedScale);
  view.scale = Math.min(Math.max(view.scale * factor, least), MAX_SCALE);
  const [nextX, nextY] = toWorld(px, py);
  view.x += x - nextX;
  view.y += y - nextY;
  changed();
}

// Move the view by pixels from where it was.
export function pan(from, dx, dy) {
  Object.assign(view, {
    x: from.x - dx / view.scale,
    y: from.y + dy / view.scale,
    follows: false,
    isAuto: false,
  });
  changed();
}
