// Texts on the map that avoid each other: each is placed where no earlier one is, or left out.

import { pen } from "./strokes.js";

const HEIGHT_PX = 19;
const GAP_PX = 3;
const LONGEST = 16;
const FONT = "600 12px sans-serif";
let taken = [];

// Begin a drawing of the map.
export function clearLabels() {
  taken = [];
}

export const shortened = (text) =>
  text.length > LONGEST ? `${text.slice(0, LONGEST - 1).trimEnd()}…` : text;

const overlaps = (one, other) =>
  one.left < other.right && one.right > other.left && one.top < other.bottom && one.bottom > other.top;

const boxAt = ([x, y], width) => ({
  left: x - width / 2 - GAP_PX,
  right: x + width / 2 + GAP_PX,
  top: y - HEIGHT_PX / 2 - GAP_PX / 2,
  bottom: y + HEIGHT_PX / 2 + GAP_PX / 2,
});

// Draw a text on a dark box around a pixel of the page, or near it. `around` is what the text names,
// in pixels: a text that is wider stands above, below or beside it. A text that finds no room is
// left out unless it `isForced`.
export function placeLabel(text, [x, y], { colour, around = null, isForced = false }) {
  pen.font = FONT;
  const width = pen.measureText(text).width + 10;
  const place = placesOf([x, y], width, around).find(
    (at) => !taken.some((other) => overlaps(boxAt(at, width), other)),
  );
  if (!place && !isForced) return;
  drawAt(text, place ?? [x, y], width, colour);
}

function placesOf([x, y], width, around) {
  const step = HEIGHT_PX + GAP_PX;
  if (!around)
    return [0, 1, -2, 2, -3].map((steps) => [x, y + steps * step]);
  const half = HEIGHT_PX / 2 + GAP_PX;
  const outside = [
    [x, around.top - half],
    [x, around.bottom + half],
    [around.right + width / 2 + GAP_PX, y],
    [around.left - width / 2 - GAP_PX, y],
  ];
  const hasRoom = around.right - around.left > width + 4 && around.bottom - around.top > 2 * step;
  return hasRoom ? [[x, y], [x, y - step], [x, y + step], ...outside] : outside;
}

function drawAt(text, at, width, colour) {
  const box = boxAt(at, width);
  taken.push(box);
  pen.fillStyle = "#0d1117d8";
  pen.fillRect(at[0] - width / 2, at[1] - HEIGHT_PX / 2, width, HEIGHT_PX);
  pen.fillStyle = colour;
  pen.textAlign = "center";
  pen.textBaseline = "middle";
  pen.fillText(text, ...at);
}
