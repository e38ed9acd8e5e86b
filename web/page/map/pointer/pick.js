// Tools that take a point of the map: measuring a distance, and a pose, e.g. where the robot is.

import { element } from "../../core/dom.js";
import { distance, rounded } from "../../core/geometry.js";
import { number } from "../../core/language.js";
import { selectTab } from "../../core/page_tabs.js";
import { propose } from "../../localisation/place.js";
import { notify } from "../../core/toasts.js";
import { draft, onDraft, setMode } from "../../zones/draft.js";
import { sketch } from "../world.js";

const MIN_ARROW_M = 0.15;

export function startMeasuring(from) {
  setMode("measure");
  sketch.measure = { from, to: from };
}

// Show the map and ask for a point of it in `words`; `then` takes the point.
export function askPoint(words, then) {
  selectTab("map");
  element("tab-map").click();
  draft.asked = words;
  setMode("point");
  sketch.pointed = then;
}

// The same for a pose.
export const askPose = (words, then) => askPoint(words, (at) => startPlacing(at, then));

// A pose at `at`; where the pointer goes next gives its heading. `then` takes the pose.
export function startPlacing(at, then = propose) {
  setMode("place");
  sketch.robot = { at, yaw: 0, then };
}

export function pointTo(at) {
  if (sketch.measure) sketch.measure.to = at;
  if (sketch.robot && distance(sketch.robot.at, at) > MIN_ARROW_M)
    sketch.robot.yaw = Math.atan2(at[1] - sketch.robot.at[1], at[0] - sketch.robot.at[0]);
}

// The pointer was pressed and released at `at`.
export function finishAt(at) {
  pointTo(at);
  const { measure, robot, pointed } = sketch;
  if (pointed) {
    setMode("navigate");
    pointed(at);
    return;
  }
  if (measure && distance(measure.from, measure.to) > MIN_ARROW_M) {
    notify(`${number(distance(measure.from, measure.to), 2)} m`, { good: true });
    setMode("navigate");
  }
  if (!robot || distance(robot.at, at) <= MIN_ARROW_M) return;
  setMode("navigate");
  const [x, y] = robot.at;
  robot.then({ x_m: rounded(x), y_m: rounded(y), yaw_rad: rounded(robot.yaw) });
}

onDraft(() => {
  if (draft.mode !== "measure") sketch.measure = null;
  if (draft.mode !== "place") sketch.robot = null;
  if (draft.mode !== "point") sketch.pointed = null;
});
