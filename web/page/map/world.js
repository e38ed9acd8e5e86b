// The values that the map shows, and whether a new value would look different.

import { view } from "./view.js";

export const world = {
  map: null,
  picture: null,
  state: null,
  classes: [],
  path: [],
  unseen: [], // the parts of the path over floor that was not seen yet
  waypoints: [],
  driven: [],
  people: [],
  sightings: [],
  closed: [],
  view: [],
  zones: [],
  candidates: { arcs: [], chosen: null },
};
// What the pointer is placing: a freehand stroke, a goal with its heading and the path to it, the
// length that is measured, the robot's place, what takes the point that is asked for; and the id of
// the goal that is dragged.
export const sketch = {
  stroke: [],
  goal: null,
  heading: null,
  path: [],
  verdict: "",
  measure: null,
  robot: null,
  pointed: null,
  movedGoal: null,
};

const MARK_M = { tip: 0.45, wing: 0.18, radius: 0.15 };
const sketchListeners = [];
// Called when a goal is sketched, or its path is known.
export const onSketch = (listener) => sketchListeners.push(listener);
export const sketchChanged = () => sketchListeners.forEach((listener) => listener());

// Outline of the goal that is placed, in metres: an arrow in its heading, or a diamond without one.
export function goalMark() {
  if (!sketch.goal) return [];
  const [x, y] = sketch.goal;
  const { tip, wing, radius } = MARK_M;
  const [cos, sin] = [Math.cos(sketch.heading ?? 0), Math.sin(sketch.heading ?? 0)];
  const ring =
    sketch.heading === null
      ? [[radius, 0], [0, radius], [-radius, 0], [0, -radius]]
      : [[tip, 0], [-wing, wing], [0, 0], [-wing, -wing]];
  return ring.map(([along, left]) => [x + along * cos - left * sin, y + along * sin + left * cos]);
}

const VISIBLE_PX = 0.5;
const VISIBLE_RAD = 0.01;
const VISIBLE_SPEED = 0.01;
const LINES = new Set(["path", "waypoints", "driven", "view"]);

// Take new values; returns the names of those that look different. Values that look the same are
// not taken, so that small steps add up to a visible one.
export function takeValues({ state = world.state, picture = world.picture, ...others }) {
  const looksDifferent = (name) =>
    !(LINES.has(name) ? coincide : isEqual)(others[name], world[name]);
  const changed = Object.keys(others).filter(looksDifferent);
  for (const name of changed) world[name] = others[name];
  Object.assign(world, { state, picture });
  return changed;
}

const isEqual = (one, other) => JSON.stringify(one) === JSON.stringify(other);
const pixels = (dx, dy) => Math.hypot(dx, dy) * view.scale;
const coincide = (one, other) =>
  one.length === other.length &&
  one.every(([x, y], i) => pixels(x - other[i][0], y - other[i][1]) < VISIBLE_PX);

export function looksAlike(state, drawn) {
  if (!state || !drawn) return state === drawn;
  const { pose, place, command, queue, reached } = state;
  const steered = Math.hypot(
    command.v_mps - drawn.command.v_mps,
    command.w_radps - drawn.command.w_radps,
  );
  return (
    (pose.x_m === null) === (drawn.pose.x_m === null) &&
    pixels(pose.x_m - drawn.pose.x_m, pose.y_m - drawn.pose.y_m) < VISIBLE_PX &&
    Math.abs(pose.yaw_rad - drawn.pose.yaw_rad) < VISIBLE_RAD &&
    steered < VISIBLE_SPEED &&
    pixels(place.major_m - drawn.place.major_m, place.minor_m - drawn.place.minor_m) < VISIBLE_PX &&
    isEqual(place.candidates, drawn.place.candidates) &&
    isEqual([queue, reached], [drawn.queue, drawn.reached])
  );
}
