// Tools that take a point of the map, clicked or typed: measuring a distance, and a pose, e.g. where
// the robot is.

import { element, setText } from "../../core/dom.js";
import { distance, rounded, roundedPoint } from "../../core/geometry.js";
import { number, t } from "../../core/text/language.js";
import { showMap } from "../../core/page_tabs.js";
import { attempt, notify } from "../../core/toasts.js";
import { typedPoint, typedPose } from "../../core/text/typed_pose.js";
import { propose } from "../../localisation/place.js";
import { draft, onDraft, setMode } from "../../zones/draft.js";
import { canvas } from "../view.js";
import { sketch } from "../world.js";

const MIN_ARROW_M = 0.15;
const form = element("pick");

export function startMeasuring(from) {
  setMode("measure");
  sketch.measure = { from, to: from };
  showFields({ from: roundedPoint(from).join(", "), name: t("To x, y in metres"), to: "" });
}

// Show the map and ask for a point of it in `words`; `then` takes the point.
export function askPoint(words, then) {
  showMap();
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
  showFields({ name: t("x, y in metres, heading in °"), to: `${roundedPoint(at).join(", ")}, ` });
}

// The menu of a place gives the focus back to the map. A keyboard goes on in fields; for a mouse they
// would cover a part of the map.
function showFields({ from = null, name, to }) {
  if (!canvas.matches(":focus-visible")) return;
  form.hidden = false;
  element("pick-from-field").hidden = from === null;
  element("pick-from").value = from ?? "";
  setText(element("pick-to-name"), name);
  element("pick-to").value = to;
  element("pick-to").focus();
}

// What is typed counts as if it had been pointed to.
function takeTyped() {
  const to = element("pick-to").value;
  if (sketch.measure) {
    sketch.measure = { from: typedPoint(element("pick-from").value), to: typedPoint(to) };
  } else {
    const { x_m: x, y_m: y, yaw_rad: yaw } = typedPose(to, { needsHeading: true });
    Object.assign(sketch.robot, { at: [x, y], yaw });
  }
}

form.onsubmit = (event) => {
  event.preventDefault();
  attempt(async () => {
    takeTyped();
    canvas.focus();
    finish();
  });
};

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
  } else if (distance(measure ? measure.from : robot.at, at) > MIN_ARROW_M) {
    finish();
  }
}

function finish() {
  const { measure, robot } = sketch;
  setMode("navigate");
  if (measure) {
    notify(`${number(distance(measure.from, measure.to), 2)} m`, { good: true });
  } else {
    const [x, y] = robot.at;
    robot.then({ x_m: rounded(x), y_m: rounded(y), yaw_rad: rounded(robot.yaw) });
  }
}

onDraft(() => {
  if (draft.mode !== "measure") sketch.measure = null;
  if (draft.mode !== "place") sketch.robot = null;
  form.hidden = !sketch.measure && !sketch.robot;
  if (draft.mode !== "point") sketch.pointed = null;
});
