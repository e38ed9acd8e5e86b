// Strokes on the map: lines, dots, flags, tags and textures, at points in metres of the map frame.

import { canvas, size, toPage, toWorld, view } from "../view.js";

export const COLOURS = {
  path: "#0a84ff",
  driven: "#57647a",
  goal: "#00a86b",
  draft: "#ffb703",
  bad: "#e5322d",
  person: "#e85d04",
  robot: "#ffcc33",
  outline: "#1b1b1b",
  blocked: "#8a6a10",
};
const FINE_GRID_PX = 60;

export let pen = canvas.getContext("2d");

// Draw on another canvas than the one of the page.
export function drawOn(other, draw) {
  const page = pen;
  pen = other;
  try {
    draw();
  } finally {
    pen = page;
  }
}

function trace(points, closed = false) {
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

function polygon(...corners) {
  pen.beginPath();
  for (const [x, y] of corners) pen.lineTo(x, y);
  pen.closePath();
}

export function dot(point, radius, colour, { diamond = false, hollow = false } = {}) {
  const [x, y] = toPage(point);
  const r = radius * 1.4;
  if (diamond) {
    polygon([x, y - r], [x + r, y], [x, y + r], [x - r, y]);
  } else {
    pen.beginPath();
    pen.arc(x, y, radius, 0, 2 * Math.PI);
  }
  pen.fillStyle = hollow ? "#ffffffb0" : colour;
  pen.fill();
  pen.strokeStyle = hollow ? colour : "#fff";
  pen.lineWidth = 1.5;
  pen.stroke();
}

export function cross(point, radius, colour) {
  const [x, y] = toPage(point);
  pen.strokeStyle = colour;
  pen.lineWidth = 1.5;
  pen.beginPath();
  pen.moveTo(x - radius, y - radius);
  pen.lineTo(x + radius, y + radius);
  pen.moveTo(x - radius, y + radius);
  pen.lineTo(x + radius, y - radius);
  pen.stroke();
}

export function flag(point, text, colour) {
  const [x, y] = toPage(point);
  dot(point, 5, colour);
  pen.fillStyle = colour;
  pen.fillRect(x - 1, y - 30, 2.5, 30);
  polygon([x, y - 31], [x + 24, y - 22], [x, y - 13]);
  pen.fill();
  pen.fillStyle = "#fff";
  pen.font = "700 12px sans-serif";
  pen.textAlign = "left";
  pen.textBaseline = "middle";
  pen.fillText(text, x + 4, y - 21.5);
}

export function arrow([x, y], yaw, length, colour) {
  const tip = [x + length * Math.cos(yaw), y + length * Math.sin(yaw)];
  const barb = (turn) => [
    tip[0] - 0.35 * length * Math.cos(yaw + turn),
    tip[1] - 0.35 * length * Math.sin(yaw + turn),
  ];
  line([[x, y], tip], colour, 3);
  line([barb(0.5), tip, barb(-0.5)], colour, 3);
}

// Diagonal stripes, or dots for a speed limit: the colour is never the only sign.
export function texture(colour, dotted) {
  const tile = new OffscreenCanvas(10, 10);
  const ink = tile.getContext("2d");
  ink.fillStyle = `${colour}2e`;
  ink.fillRect(0, 0, 10, 10);
  ink.strokeStyle = ink.fillStyle = `${colour}88`;
  ink.lineWidth = 2;
  ink.beginPath();
  if (dotted) {
    ink.arc(5, 5, 1.8, 0, 2 * Math.PI);
    ink.fill();
  } else {
    for (const [x, y, toX, toY] of [
      [-2, 2, 2, -2],
      [-2, 12, 12, -2],
      [8, 12, 12, 8],
    ]) {
      ink.moveTo(x, y);
      ink.lineTo(toX, toY);
    }
    ink.stroke();
  }
  return pen.createPattern(tile, "repeat");
}

// Lines every metre, from afar every five.
export function drawGrid() {
  const { width, height } = size;
  const step = view.scale > FINE_GRID_PX ? 1 : 5;
  const [left, top] = toWorld(0, 0);
  const [right, bottom] = toWorld(width, height);
  pen.strokeStyle = "#7f8ea340";
  pen.lineWidth = 1;
  pen.beginPath();
  for (let x = Math.ceil(left / step) * step; x <= right; x += step) {
    const [px] = toPage([x, 0]);
    pen.moveTo(px, 0);
    pen.lineTo(px, height);
  }
  for (let y = Math.ceil(bottom / step) * step; y <= top; y += step) {
    const [, py] = toPage([0, y]);
    pen.moveTo(0, py);
    pen.lineTo(width, py);
  }
  pen.stroke();
}
