// The map from above: the same layers as the floor of the 3D view, and the same clicks. Works on any machine.

import { clicked, dragged, draft, onDraft } from "./draft.js";

const canvas = document.getElementById("map");
const pen = canvas.getContext("2d");
const CLICK_PX = 4;
const GRAB_PX = 10;
const COLOURS = { path: "#0a84ff", driven: "#57647a", goal: "#00a86b", zone: "#d63384", draft: "#ffb703" };
const view = { scale: 40, x: 0, y: 0, fitted: false };
const world = { map: null, picture: null, state: null, path: [], waypoints: [], driven: [], zones: [] };
let pressed = null;
let asked = false;

export function update(values) {
  Object.assign(world, values);
  if (world.map && !view.fitted) fit();
  redraw();
}

// What others draw over the world, below the robot; each gets the tools of this file.
export const overlays = [];
export function refresh() { redraw(); }

export function centreOn([x, y]) {
  Object.assign(view, { x, y, scale: Math.max(view.scale, 60), fitted: true });
  redraw();
}

export function fit() {
  const box = canvas.getBoundingClientRect();
  if (!world.map || box.width === 0) return;
  const { cols, rows, resolution_m: r, origin_x_m: x, origin_y_m: y } = world.map;
  Object.assign(view, { scale: Math.min(box.width / (cols * r), box.height / (rows * r)) * 0.97, x: x + (cols * r) / 2, y: y + (rows * r) / 2, fitted: true });
  redraw();
}

export function zoom(factor, px = canvas.clientWidth / 2, py = canvas.clientHeight / 2) {
  const [x, y] = toWorld(px, py);
  view.scale = Math.min(Math.max(view.scale * factor, 2), 800);
  const [nx, ny] = toWorld(px, py);
  view.x += x - nx;
  view.y += y - ny;
  redraw();
}

const toWorld = (px, py) => [view.x + (px - canvas.clientWidth / 2) / view.scale, view.y - (py - canvas.clientHeight / 2) / view.scale];
const toPage = ([x, y]) => [canvas.clientWidth / 2 + (x - view.x) * view.scale, canvas.clientHeight / 2 - (y - view.y) * view.scale];

function onMap([x, y]) {
  const { cols, rows, resolution_m: r, origin_x_m: left, origin_y_m: low } = world.map;
  const hair = r * 0.05;
  return [Math.min(Math.max(x, left + hair), left + cols * r - hair), Math.min(Math.max(y, low + hair), low + rows * r - hair)];
}

function redraw() {
  if (asked || canvas.clientWidth === 0) return;
  asked = true;
  requestAnimationFrame(() => { asked = false; draw(); });
}

function draw() {
  const ratio = window.devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  // Where the world is on the page, for tools that drive it: scale in px/m, and the middle in metres.
  canvas.dataset.place = `${view.scale} ${view.x} ${view.y}`;
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  if (!world.map) return;
  drawPicture();
  drawRaster(width, height);
  for (const zone of world.zones) drawZone(zone);
  line(world.driven, COLOURS.driven, 2, [2, 4]);
  line(world.path, "#ffffffc0", 5);
  line(world.path, COLOURS.path, 3);
  for (const point of world.waypoints) dot(point, 4, COLOURS.path, true);
  for (const paint of overlays) paint({ pen, line, dot, tag, toPage });
  drawGoals();
  drawRobot();
  drawDraft();
  drawScale(height);
}

function drawPicture() {
  if (!world.picture) return;
  const { cols, rows, resolution_m: r, origin_x_m: x, origin_y_m: y } = world.map;
  const [left, top] = toPage([x, y + rows * r]);
  pen.imageSmoothingEnabled = view.scale * r < 2;
  pen.imageSmoothingQuality = "high";
  pen.drawImage(world.picture, left, top, cols * r * view.scale, rows * r * view.scale);
}

function drawRaster(width, height) {
  const step = view.scale > 60 ? 1 : 5;
  const [left, top] = toWorld(0, 0);
  const [right, low] = toWorld(width, height);
  pen.strokeStyle = "#7f8ea340";
  pen.lineWidth = 1;
  pen.beginPath();
  for (let x = Math.ceil(left / step) * step; x <= right; x += step) { const [px] = toPage([x, 0]); pen.moveTo(px, 0); pen.lineTo(px, height); }
  for (let y = Math.ceil(low / step) * step; y <= top; y += step) { const [, py] = toPage([0, y]); pen.moveTo(0, py); pen.lineTo(width, py); }
  pen.stroke();
}

function line(points, colour, width, dash = [], closed = false) {
  if (points.length < 2) return;
  pen.beginPath();
  points.forEach((point, i) => (i ? pen.lineTo(...toPage(point)) : pen.moveTo(...toPage(point))));
  if (closed) pen.closePath();
  pen.setLineDash(dash);
  pen.strokeStyle = colour;
  pen.lineWidth = width;
  pen.lineJoin = "round";
  pen.stroke();
  pen.setLineDash([]);
}

function dot(point, radius, colour, diamond = false) {
  const [x, y] = toPage(point);
  pen.beginPath();
  if (diamond) { pen.moveTo(x, y - radius * 1.4); pen.lineTo(x + radius * 1.4, y); pen.lineTo(x, y + radius * 1.4); pen.lineTo(x - radius * 1.4, y); pen.closePath(); } else pen.arc(x, y, radius, 0, 2 * Math.PI);
  pen.fillStyle = colour;
  pen.fill();
  pen.strokeStyle = "#fff";
  pen.lineWidth = 1.5;
  pen.stroke();
}

function tag(text, [x, y], colour) {
  pen.font = "600 12px sans-serif";
  const width = pen.measureText(text).width + 10;
  pen.fillStyle = "#0d1117d8";
  pen.fillRect(x - width / 2, y - 10, width, 19);
  pen.fillStyle = colour;
  pen.textAlign = "center";
  pen.textBaseline = "middle";
  pen.fillText(text, x, y);
}

function drawZone(zone) {
  const ring = zone.geometry.coordinates[0].slice(0, -1);
  const on = zone.properties.enabled;
  line(ring, on ? COLOURS.zone : COLOURS.driven, 2.5, on ? [] : [6, 5], true);
  const middle = ring.reduce(([x, y], [a, b]) => [x + a / ring.length, y + b / ring.length], [0, 0]);
  tag(on ? zone.properties.name : `${zone.properties.name} (off)`, toPage(middle), on ? "#ff9fcb" : "#aab4c2");
}

function drawGoals() {
  for (const goal of world.state?.reached.slice(-20) ?? []) dot([goal.x_m, goal.y_m], 5, COLOURS.driven);
  world.state?.queue.forEach((goal, i) => {
    const [x, y] = toPage([goal.x_m, goal.y_m]);
    dot([goal.x_m, goal.y_m], 5, COLOURS.goal);
    pen.fillStyle = COLOURS.goal;
    pen.fillRect(x - 1, y - 30, 2.5, 30);
    pen.beginPath(); pen.moveTo(x, y - 31); pen.lineTo(x + 24, y - 22); pen.lineTo(x, y - 13); pen.closePath(); pen.fill();
    pen.fillStyle = "#fff"; pen.font = "700 11px sans-serif"; pen.textAlign = "left"; pen.textBaseline = "middle";
    pen.fillText(String(i + 1), x + 4, y - 21.5);
  });
}

function drawRobot() {
  const pose = world.state?.pose;
  if (!pose || pose.x_m === null || pose.y_m === null) return;
  const [length, width] = [world.map.robot_length_m * view.scale, world.map.robot_width_m * view.scale];
  pen.save();
  pen.translate(...toPage([pose.x_m, pose.y_m]));
  pen.rotate(-pose.yaw_rad);
  pen.fillStyle = "#ffb70330";
  pen.beginPath(); pen.moveTo(length / 2, 0); pen.lineTo(length / 2 + 1.6 * view.scale, -1.2 * view.scale); pen.lineTo(length / 2 + 1.6 * view.scale, 1.2 * view.scale); pen.closePath(); pen.fill();
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
  const { corners, preview } = draft;
  line(preview, COLOURS.draft, 3, [8, 6]);
  if (corners.length > 2) {
    pen.beginPath();
    corners.forEach((corner, i) => (i ? pen.lineTo(...toPage(corner)) : pen.moveTo(...toPage(corner))));
    pen.fillStyle = "#ffb70333";
    pen.fill();
  }
  line(corners, COLOURS.draft, 2.5, [], corners.length > 2);
  for (const corner of corners) dot(corner, 6, COLOURS.draft);
}

function drawScale(height) {
  const metres = [1, 2, 5, 10, 20, 50].find((m) => m * view.scale > 60) ?? 100;
  const [x, y] = [canvas.clientWidth - metres * view.scale - 14, height - 14];
  pen.fillStyle = "#e6ebf2";
  pen.fillRect(x, y, metres * view.scale, 3);
  pen.font = "11px sans-serif"; pen.textAlign = "left"; pen.textBaseline = "bottom";
  pen.fillText(`${metres} m`, x, y - 2);
}

function cornerAt(px, py) {
  return draft.corners.findIndex((corner) => { const [x, y] = toPage(corner); return Math.hypot(x - px, y - py) <= GRAB_PX; });
}

canvas.addEventListener("pointerdown", (event) => {
  const drawing = draft.mode === "edit" || draft.mode === "draw";
  const corner = drawing && event.button === 0 ? cornerAt(event.offsetX, event.offsetY) : -1;
  pressed = { x: event.offsetX, y: event.offsetY, button: event.button, corner, moved: false, from: { ...view } };
  canvas.setPointerCapture(event.pointerId);
});
canvas.addEventListener("pointermove", (event) => {
  const place = toWorld(event.offsetX, event.offsetY);
  document.getElementById("where").textContent = `x ${place[0].toFixed(2)}  y ${place[1].toFixed(2)} m`;
  if (!pressed || !world.map) return;
  pressed.moved ||= Math.hypot(event.offsetX - pressed.x, event.offsetY - pressed.y) > CLICK_PX;
  if (!pressed.moved) return;
  if (pressed.corner >= 0) dragged(pressed.corner, onMap(place));
  else {
    view.x = pressed.from.x - (event.offsetX - pressed.x) / view.scale;
    view.y = pressed.from.y + (event.offsetY - pressed.y) / view.scale;
    redraw();
  }
});
canvas.addEventListener("pointerup", (event) => {
  if (pressed && !pressed.moved && pressed.button === 0 && world.map) {
    const place = toWorld(event.offsetX, event.offsetY);
    clicked(...place, onMap(place));
  }
  pressed = null;
});
canvas.addEventListener("pointercancel", () => { pressed = null; });
canvas.addEventListener("wheel", (event) => { event.preventDefault(); zoom(Math.exp(-event.deltaY / 500), event.offsetX, event.offsetY); }, { passive: false });
new ResizeObserver(() => { if (view.fitted) redraw(); else fit(); }).observe(canvas);
onDraft(() => { canvas.classList.toggle("pick", draft.mode !== "navigate"); redraw(); });
