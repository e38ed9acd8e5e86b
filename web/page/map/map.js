// The map from above, layer by layer; works on any machine, and with it every part of the operator's work.

import { draft, drawing, onDraft, ring } from "../zones/draft.js";
import { offer, onOffer } from "../mission/goals.js";
import { onLayers, strength } from "./layers.js";
import { painter } from "../core/paints.js";
import { arrow, COLOURS, dot, drawOn, fill, flag, line, pen, raster, tag, texture } from "./strokes.js";
import { middles } from "../core/geometry.js";
import { isLight, onTheme } from "../core/theme.js";
import * as tiles from "./tiles.js";
import { canvas, centre, fit as fitTo, onView, placed, toPage, toWorld, view } from "./view.js";
import { colourOf } from "../zones/zones.js";

export const world = { map: null, picture: null, state: null, classes: [], path: [], waypoints: [], driven: [], people: [], closed: [], view: [], zones: [], candidates: { arcs: [], chosen: null } };
export const hand = { stroke: [], goal: null, heading: null, way: [], verdict: "" };
const AHEAD_S = 2;
const VISIBLE_PX = 0.5;
const VISIBLE_RAD = 0.01;
const LINES = new Set(["path", "waypoints", "driven", "view"]);
// What lies still under the robot: cells, raster and zones, drawn once for a place of the view and then copied.
const ground = { canvas: new OffscreenCanvas(1, 1), of: "" };
let zonesVersion = 0;
let drawnState = null;

// Nothing is drawn for values that would look the same: they are not even taken, so that small steps add up to a visible one.
export function update(values) {
  const { state = world.state, picture = world.picture, ...others } = values;
  const changed = Object.keys(others).filter((name) => !(LINES.has(name) ? coincide : same)(others[name], world[name]));
  for (const name of changed) world[name] = others[name];
  Object.assign(world, { state, picture });
  if (changed.includes("classes")) repaint();
  if (changed.includes("zones") || changed.includes("closed")) zonesVersion += 1;
  if (world.map && !view.fitted) fit();
  if (changed.length === 0 && looksAlike(world.state, drawnState) && ground.of === groundNow()) return;
  centre(world.state?.pose);
  redraw();
}

const same = (one, other) => JSON.stringify(one) === JSON.stringify(other);
const coincide = (one, other) => one.length === other.length && one.every(([x, y], i) => Math.hypot(x - other[i][0], y - other[i][1]) * view.scale < VISIBLE_PX);

function looksAlike(state, drawn) {
  if (!state || !drawn) return state === drawn;
  const { pose, command, queue, reached } = state;
  const moved = Math.hypot(pose.x_m - drawn.pose.x_m, pose.y_m - drawn.pose.y_m) * view.scale;
  const steered = Math.hypot(command.v_mps - drawn.command.v_mps, command.w_radps - drawn.command.w_radps);
  return (pose.x_m === null) === (drawn.pose.x_m === null) && moved < VISIBLE_PX && Math.abs(pose.yaw_rad - drawn.pose.yaw_rad) < VISIBLE_RAD
    && steered < VISIBLE_RAD && same([queue, reached], [drawn.queue, drawn.reached]);
}

export const fit = () => fitTo(world.map);

// What others draw over the world, below the robot; each gets the tools of this file.
export const overlays = [];

export const redraw = painter("map", canvas, draw);

function draw() {
  drawnState = world.state;
  const ratio = window.devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  // Where the world is on the page, for tools that drive it: scale in px/m, and the middle in metres.
  canvas.dataset.place = `${view.scale} ${view.x} ${view.y}`;
  if (world.map && ground.of !== groundNow()) drawGround(ratio, width, height);
  pen.setTransform(1, 0, 0, 1, 0, 0);
  pen.clearRect(0, 0, canvas.width, canvas.height);
  if (!world.map) return;
  pen.drawImage(ground.canvas, 0, 0);
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  layer("view", () => { fill(world.view, "#ffb70326"); line(world.view, "#ffb70370", 1, [3, 3], true); });
  layer("driven", () => line(world.driven, COLOURS.driven, 2, [2, 4]));
  layer("candidates", drawCandidates);
  layer("path", () => { line(world.path, "#ffffffc0", 5); line(world.path, COLOURS.path, 3); });
  layer("waypoints", () => { for (const point of world.waypoints) dot(point, 4, COLOURS.path, { diamond: true }); });
  for (const paint of overlays) paint({ pen, line, dot, tag, toPage });
  drawGoals();
  layer("people", drawPeople);
  layer("motion", drawMotion);
  drawRobot();
  if (drawing()) drawDraft();
  drawHand();
  drawScale(height);
}

const groundNow = () => `${placed()} ${tiles.painted} ${zonesVersion} ${draft.id}`;

function drawGround(ratio, width, height) {
  Object.assign(ground.canvas, { width: canvas.width, height: canvas.height });
  drawOn(ground.canvas.getContext("2d"), () => {
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    drawCells();
    raster(width, height, toWorld);
    layer("zones", () => { for (const zone of [...world.zones, ...world.closed]) if (zone.id !== draft.id) drawZone(zone); });
  });
  ground.of = groundNow();
}

// Another list, layer or theme: what is here already looks different.
function repaint() {
  tiles.repaint(world.classes, isLight());
  redraw();
}

function layer(name, act) {
  const alpha = strength(name);
  if (alpha === 0) return;
  pen.globalAlpha = alpha;
  act();
  pen.globalAlpha = 1;
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
  const { enabled, name, kind, max_speed_mps: limit } = zone.properties;
  const colour = colourOf(zone);
  if (enabled) fill(corners, texture(colour, kind === "speed-limit"));
  line(corners, enabled ? colour : COLOURS.driven, 2.5, enabled ? (kind === "speed-limit" ? [10, 4] : []) : [6, 5], true);
  const middle = corners.reduce(([x, y], [a, b]) => [x + a / corners.length, y + b / corners.length], [0, 0]);
  tag(`${name}${limit ? ` ≤ ${limit} m/s` : ""}${enabled ? "" : " (off)"}`, toPage(middle), enabled ? "#fff" : "#aab4c2");
}

function drawGoals() {
  for (const goal of world.state?.reached.slice(-20) ?? []) dot([goal.x_m, goal.y_m], 5, COLOURS.driven);
  world.state?.queue.forEach((goal, i) => {
    const place = [goal.x_m, goal.y_m];
    if (goal.yaw_rad !== null) arrow(place, goal.yaw_rad, 0.6, COLOURS.goal);
    flag(place, String(i + 1), COLOURS.goal);
    if (goal.name) { const [x, y] = toPage(place); tag(goal.name, [x, y + 17], "#7fe3bf"); }
  });
  if (offer.place) { flag(offer.place, "?", COLOURS.draft); const [x, y] = toPage(offer.place); tag("nearest place: click", [x, y + 17], "#ffe3a3"); }
}

function drawPeople() {
  for (const { x_m: x, y_m: y, vx_mps: vx, vy_mps: vy, radius_m: radius } of world.people) {
    const [px, py] = toPage([x, y]);
    pen.beginPath(); pen.arc(px, py, radius * view.scale, 0, 2 * Math.PI);
    pen.fillStyle = `${COLOURS.person}40`; pen.fill();
    pen.strokeStyle = COLOURS.person; pen.lineWidth = 2; pen.stroke();
    if (Math.hypot(vx, vy) > 0.05) line([[x, y], [x + AHEAD_S * vx, y + AHEAD_S * vy]], COLOURS.person, 2, [5, 3]);
  }
}

// Each as far as it is free, with a cross where it would touch something; the chosen one stands out.
function drawCandidates() {
  const { arcs, chosen } = world.candidates;
  arcs.forEach(({ points, touch }) => {
    line(points, touch ? "#8a6a10" : COLOURS.goal, 1.2);
    if (touch) cross(touch);
  });
  if (chosen === null || !arcs[chosen]) return;
  line(arcs[chosen].points, "#1b1b1b", 6);
  line(arcs[chosen].points, "#ffcc33", 3.5);
}

function cross(place) {
  const [x, y] = toPage(place);
  pen.strokeStyle = COLOURS.bad; pen.lineWidth = 1.5;
  pen.beginPath(); pen.moveTo(x - 2.5, y - 2.5); pen.lineTo(x + 2.5, y + 2.5); pen.moveTo(x - 2.5, y + 2.5); pen.lineTo(x + 2.5, y - 2.5); pen.stroke();
}

// The arc that the wheels are asked for, two seconds of it.
function drawMotion() {
  const { pose, command } = world.state ?? {};
  if (!pose || pose.x_m === null || !command || Math.abs(command.v_mps) < 0.01) return;
  let [x, y, yaw] = [pose.x_m, pose.y_m, pose.yaw_rad];
  const arc = [[x, y]];
  for (let t = 0; t < AHEAD_S; t += 0.1) {
    yaw += command.w_radps * 0.1; x += command.v_mps * 0.1 * Math.cos(yaw); y += command.v_mps * 0.1 * Math.sin(yaw);
    arc.push([x, y]);
  }
  line(arc, "#ffcc33", 3);
}

function drawRobot() {
  const pose = world.state?.pose;
  if (!pose || pose.x_m === null || pose.y_m === null) return;
  const [length, width] = [world.map.robot_length_m * view.scale, world.map.robot_width_m * view.scale];
  pen.save();
  pen.translate(...toPage([pose.x_m, pose.y_m]));
  pen.rotate(-pose.yaw_rad);
  pen.fillStyle = "#ffcc33";
  pen.strokeStyle = "#1b1b1b";
  pen.lineWidth = 2;
  pen.fillRect(-length / 2, -width / 2, length, width);
  pen.strokeRect(-length / 2, -width / 2, length, width);
  pen.fillStyle = "#1b1b1b";
  pen.beginPath(); pen.moveTo(length * 0.42, 0); pen.lineTo(length * 0.05, -width * 0.3); pen.lineTo(length * 0.05, width * 0.3); pen.closePath(); pen.fill();
  pen.restore();
}

function drawDraft() {
  const { corners, preview, tool, selected } = draft;
  const outline = ring();
  line(preview, "#00000080", 5, [8, 6]);
  line(preview, COLOURS.draft, 3, [8, 6]);
  fill(outline, "#ffb70333");
  line(outline, COLOURS.draft, 2.5, [], outline.length > 2);
  if (tool === "corridor") line(corners, COLOURS.draft, 1, [4, 4]);
  if (draft.mode === "edit") for (const { at } of middles(tool, corners)) dot(at, 4.5, COLOURS.draft, { hollow: true });
  corners.forEach((corner, i) => dot(corner, i === selected ? 8 : 6, i === selected ? "#ff7b00" : COLOURS.draft));
}

// What the pointer is doing: a free-hand stroke, a goal that is being placed and the way to it.
function drawHand() {
  line(hand.stroke, COLOURS.draft, 3);
  if (!hand.goal) return;
  line(hand.way, "#00000080", 5, [8, 6]);
  line(hand.way, COLOURS.draft, 3, [8, 6]);
  flag(hand.goal, "+", COLOURS.draft);
  if (hand.heading !== null) arrow(hand.goal, hand.heading, 0.6, COLOURS.draft);
  if (hand.verdict) { const [x, y] = toPage(hand.goal); tag(hand.verdict, [x, y + 18], "#ffe3a3"); }
}

function drawScale(height) {
  const metres = [1, 2, 5, 10, 20, 50].find((m) => m * view.scale > 60) ?? 100;
  const [x, y] = [canvas.clientWidth - metres * view.scale - 14, height - 14];
  pen.fillStyle = isLight() ? "#1d2733" : "#e6ebf2";
  pen.fillRect(x, y, metres * view.scale, 3);
  pen.font = "11px sans-serif"; pen.textAlign = "left"; pen.textBaseline = "bottom";
  pen.fillText(`${metres} m`, x, y - 2);
}

new ResizeObserver(() => { if (view.fitted) redraw(); else fit(); }).observe(canvas);
onDraft(() => { canvas.classList.toggle("pick", draft.mode !== "navigate"); redraw(); });
onLayers(repaint);
onTheme(repaint);
onView(redraw);
onOffer(redraw);
