// The robot's place on the map: its uncertainty, the places between which it is unsure, and what the
// camera sees at a place that is proposed.

import { t } from "../../core/text/language.js";
import { proposal } from "../../localisation/place.js";
import { placeLabel } from "./labels.js";
import { COLOURS, dot, pen } from "./strokes.js";
import { toPage, view } from "../view.js";
import { world } from "../world.js";

const SMALLEST_PX = 4;
const FITS = "#7ef0c2";
const CONTRADICTS = "#ff7b72";

// An ellipse of two standard deviations, where it can be seen.
export function drawUncertainty() {
  const { pose, place } = world.state ?? {};
  if (!place || !pose || pose.x_m === null || place.major_m * view.scale < SMALLEST_PX) return;
  const [x, y] = toPage([pose.x_m, pose.y_m]);
  pen.beginPath();
  pen.ellipse(
    x,
    y,
    place.major_m * view.scale,
    Math.max(place.minor_m * view.scale, 1),
    -place.axis_rad,
    0,
    2 * Math.PI,
  );
  pen.fillStyle = `${COLOURS.robot}30`;
  pen.fill();
  pen.strokeStyle = COLOURS.robot;
  pen.lineWidth = 1.5;
  pen.stroke();
}

export function drawCandidatePlaces() {
  world.state?.place?.candidates.forEach(({ x_m: x, y_m: y }, i) => {
    dot([x, y], 7, COLOURS.robot, { hollow: true });
    const [px, py] = toPage([x, y]);
    placeLabel(t("here? {number}", { number: i + 1 }), [px, py - 16], { colour: COLOURS.robot });
  });
}

export function drawProposal() {
  const { checked } = proposal;
  if (!checked) return;
  pen.fillStyle = checked.fits ? FITS : CONTRADICTS;
  for (const point of checked.scan) {
    const [x, y] = toPage(point);
    pen.fillRect(x - 1.5, y - 1.5, 3, 3);
  }
  dot([checked.pose.x_m, checked.pose.y_m], 6, COLOURS.robot);
}
