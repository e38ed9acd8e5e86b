// Strokes on the map: lines, dots, flags and name tags, in metres of the map.

import { canvas, toPage, view } from "./view.js";

export let pen = canvas.getContext("2d");

// Draw on another canvas than the one on the page.
export function drawOn(other, act) {
  const page = pen;
  pen = other;
  try { act(); } finally { pen = page; }
}

export const COLOURS = { path: "#0a84ff", driven: "#57647a", goal: "#00a86b", draft: "#ffb703", bad: "#e5322d", person: "#e85d04" };

export function trace(points, closed = false) {
  pen.beginPath();
  points.forEach((point, i) => (i ? pen.lineTo(...toPage(point)) : pen.moveTo(...toPage(point))));
  if (closed) pen.closePath();
}

export function line(points, colour, width, dash = [], closed = false) {
  if (points.length < 2) return;
  trace(points, closed);
  pen.setLineDash(dash);
  pen.strokeStyle = colour;
  pen.lineWidth = width;
  pen.lineJoin = "round";
  pen.stroke();
  pen.setLineDash([]);
}

export function fill(points, style) {
  if (points.length < 3) return;
  trace(points, true);
  pen.fillStyle = style;
  pen.fill();
}

export function dot(point, radius, colour, { diamond = false, hollow = false } = {}) {
  const [x, y] = toPage(point);
  pen.beginPath();
  if (diamond) { pen.moveTo(x, y - radius * 1.4); pen.lineTo(x + radius * 1.4, y); pen.lineTo(x, y + radius * 1.4); pen.lineTo(x - radius * 1.4, y); pen.closePath(); } else pen.arc(x, y, radius, 0, 2 * Math.PI);
  pen.fillStyle = hollow ? "#ffffffb0" : colour;
  pen.fill();
  pen.strokeStyle = hollow ? colour : "#fff";
  pen.lineWidth = 1.5;
  pen.stroke();
}

export function tag(text, [x, y], colour) {
  pen.font = "600 12px sans-serif";
  const width = pen.measureText(text).width + 10;
  pen.fillStyle = "#0d1117d8";
  pen.fillRect(x - width / 2, y - 10, width, 19);
  pen.fillStyle = colour;
  pen.textAlign = "center";
  pen.textBaseline = "middle";
  pen.fillText(text, x, y);
}

export function flag(place, text, colour) {
  const [x, y] = toPage(place);
  dot(place, 5, colour);
  pen.fillStyle = colour;
  pen.fillRect(x - 1, y - 30, 2.5, 30);
  pen.beginPath(); pen.moveTo(x, y - 31); pen.lineTo(x + 24, y - 22); pen.lineTo(x, y - 13); pen.closePath(); pen.fill();
  pen.fillStyle = "#fff"; pen.font = "700 11px sans-serif"; pen.textAlign = "left"; pen.textBaseline = "middle";
  pen.fillText(text, x + 4, y - 21.5);
}

export function arrow([x, y], yaw, length, colour) {
  const tip = [x + length * Math.cos(yaw), y + length * Math.sin(yaw)];
  const barb = (turn) => [tip[0] - 0.35 * length * Math.cos(yaw + turn), tip[1] - 0.35 * length * Math.sin(yaw + turn)];
  line([[x, y], tip], colour, 3);
  line([barb(0.5), tip, barb(-0.5)], colour, 3);
}

// Diagonal stripes, or dots for a speed limit: a zone is told by its texture as well.
export function texture(colour, dotted) {
  const tile = new OffscreenCanvas(10, 10);
  const ink = tile.getContext("2d");
  ink.fillStyle = `${colour}2e`;
  ink.fillRect(0, 0, 10, 10);
  ink.strokeStyle = ink.fillStyle = `${colour}88`;
  ink.lineWidth = 2;
  ink.beginPath();
  if (dotted) { ink.arc(5, 5, 1.8, 0, 2 * Math.PI); ink.fill(); } else { ink.moveTo(-2, 2); ink.lineTo(2, -2); ink.moveTo(-2, 12); ink.lineTo(12, -2); ink.moveTo(8, 12); ink.lineTo(12, 8); ink.stroke(); }
  return pen.createPattern(tile, "repeat");
}

export function raster(width, height, toWorld) {
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
