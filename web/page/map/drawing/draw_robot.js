// The robot, its goals, the people around it and its candidate motions on the map.

import { t } from "../../core/text/language.js";
import { offer } from "../../mission/goals.js";
import { placeLabel, shortened } from "./labels.js";
import { isLit } from "../pointer/selection.js";
import { arrow, COLOURS, cross, dot, flag, line, pen } from "./strokes.js";
import { toPage, view } from "../view.js";
import { sketch, world } from "../world.js";

const AHEAD_S = 2;
const STEP_S = 0.1;
const WALKING_MPS = 0.05;
const DRIVING_MPS = 0.01;
const HEADING_M = 0.6;

export function drawGoals() {
  for (const goal of world.state?.reached ?? [])
    dot([goal.x_m, goal.y_m], 5, COLOURS.driven);
  world.state?.queue.forEach((goal, i) => {
    if (goal.id === sketch.movedGoal) return;
    const position = [goal.x_m, goal.y_m];
    if (goal.yaw_rad !== null) arrow(position, goal.yaw_rad, HEADING_M, COLOURS.goal);
    flag(position, String(i + 1), COLOURS.goal);
    if (goal.name)
      tagBelow(isLit("goal", goal.id) ? goal.name : shortened(goal.name), position, "#7fe3bf");
  });
  if (!offer.position) return;
  flag(offer.position, "?", COLOURS.draft);
  tagBelow(t("nearest free position: click"), offer.position, "#ffe3a3");
}

function tagBelow(text, position, colour) {
  const [x, y] = toPage(position);
  placeLabel(text, [x, y + 18], { colour });
}

export function drawPeople() {
  for (const { x_m: x, y_m: y, vx_mps: vx, vy_mps: vy, radius_m: radius } of world.people) {
    const [px, py] = toPage([x, y]);
    pen.beginPath();
    pen.arc(px, py, radius * view.scale, 0, 2 * Math.PI);
    pen.fillStyle = `${COLOURS.person}40`;
    pen.fill();
    pen.strokeStyle = COLOURS.person;
    pen.lineWidth = 2;
    pen.stroke();
    if (Math.hypot(vx, vy) > WALKING_MPS)
      line(
        [
          [x, y],
          [x + AHEAD_S * vx, y + AHEAD_S * vy],
        ],
        COLOURS.person,
        2,
        [5, 3],
      );
  }
}

// Each as far as it is free, with a cross at its first contact; the chosen one stands out.
export function drawCandidates() {
  const { arcs, chosen } = world.candidates;
  for (const { points, touch } of arcs) {
    line(points, touch ? COLOURS.blocked : COLOURS.goal, 1.2);
    if (touch) cross(touch, 2.5, COLOURS.bad);
  }
  if (chosen === null || !arcs[chosen]) return;
  line(arcs[chosen].points, COLOURS.outline, 6);
  line(arcs[chosen].points, COLOURS.robot, 3.5);
}

// The arc of the velocity that the wheels are asked for.
export function drawCommandedMotion() {
  const { pose, command } = world.state ?? {};
  if (!pose || pose.x_m === null || !command || Math.abs(command.v_mps) < DRIVING_MPS) return;
  let [x, y, yaw] = [pose.x_m, pose.y_m, pose.yaw_rad];
  const arc = [[x, y]];
  for (let t = 0; t < AHEAD_S; t += STEP_S) {
    yaw += command.w_radps * STEP_S;
    x += command.v_mps * STEP_S * Math.cos(yaw);
    y += command.v_mps * STEP_S * Math.sin(yaw);
    arc.push([x, y]);
  }
  line(arc, COLOURS.robot, 3);
}

export function drawRobot() {
  const pose = world.state?.pose;
  if (!pose || pose.x_m === null || pose.y_m === null) return;
  const [length, width] = [
    world.map.robot_length_m * view.scale,
    world.map.robot_width_m * view.scale,
  ];
  pen.save();
  pen.translate(...toPage([pose.x_m, pose.y_m]));
  pen.rotate(-pose.yaw_rad);
  pen.fillStyle = COLOURS.robot;
  pen.strokeStyle = COLOURS.outline;
  pen.lineWidth = 2;
  pen.fillRect(-length / 2, -width / 2, length, width);
  pen.strokeRect(-length / 2, -width / 2, length, width);
  pen.fillStyle = COLOURS.outline;
  pen.beginPath();
  // Longer than wide, or it would not show which end is the front.
  pen.moveTo(length * 0.45, 0);
  pen.lineTo(-length * 0.25, -width * 0.22);
  pen.lineTo(-length * 0.25, width * 0.22);
  pen.closePath();
  pen.fill();
  pen.restore();
}
