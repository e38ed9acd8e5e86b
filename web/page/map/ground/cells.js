// The cells of the map as an image. It is painted here, so that a layer can be switched and faded
// without another request.

import { patternOf } from "../../beware/swatch.js";
import { layerOf, strength } from "../layers.js";

const SEEN = 1;
const OBSTACLE = 2;
const BLOCKED = 4;
const PRIOR = 16;
export const paletteOf = (light) => (light ? LIGHT : DARK);
const DARK = {
  stage: [10, 14, 19],
  unknown: [62, 71, 87],
  dot: [126, 138, 158],
  free: [206, 214, 226],
  inflation: [120, 134, 158],
  obstacle: [12, 15, 20],
  prior: [84, 70, 120],
};
const LIGHT = {
  stage: [236, 240, 245],
  unknown: [196, 204, 215],
  dot: [146, 156, 172],
  free: [255, 255, 255],
  inflation: [198, 208, 222],
  obstacle: [30, 38, 50],
  prior: [150, 134, 190],
};
// Whether the pixel in row i and column j is in the full tone.
const PATTERNS = {
  "stripes rising": (i, j) => (i - j + 600000) % 6 < 3,
  "stripes falling": (i, j) => (i + j) % 6 < 3,
  dots: (i, j) => i % 6 < 3 && j % 6 < 3,
  grid: (i, j) => i % 6 < 2 || j % 6 < 2,
  bars: (i) => i % 6 < 3,
  columns: (i, j) => j % 6 < 3,
};
const UNSEEN_INFLATION_SHARE = 0.45;
const LIGHT_TONE_SHARE = 0.38;
const FIXED = ["unknown", "free", "inflation", "obstacle", "prior"];

const reader = new OffscreenCanvas(1, 1).getContext("2d", { willReadFrequently: true });

// The bytes of a tile: rows × cols pixels with flags in red and class ids in green and blue.
export async function read(blob) {
  const bitmap = await createImageBitmap(blob, {
    colorSpaceConversion: "none",
    premultiplyAlpha: "none",
  });
  const { width: cols, height: rows } = bitmap;
  Object.assign(reader.canvas, { width: cols, height: rows }); // clears it, too
  reader.drawImage(bitmap, 0, 0);
  bitmap.close(); // else its pixels stay until the next collection of garbage
  return { cols, rows, data: reader.getImageData(0, 0, cols, rows).data };
}

// Columns and rows that hold every cell for which `counts(index)`, as [left, top, right, bottom], or
// null without any.
export function boundsOf({ cols, rows }, counts) {
  let [left, top, right, bottom] = [cols, rows, -1, -1];
  for (let i = 0; i < rows; i += 1) {
    for (let j = 0; j < cols; j += 1) {
      if (!counts(i * cols + j)) continue;
      [left, right] = [Math.min(left, j), Math.max(right, j)];
      [top, bottom] = [Math.min(top, i), Math.max(bottom, i)];
    }
  }
  return right < 0 ? null : [left, top, right + 1, bottom + 1];
}

// Paint an area, as `boundsOf` returns it, of a tile whose upper left cell is (`left`, `top`), with
// `scale` pixels per cell and side.
export function paint(pen, { cells, left, top }, area, scale, colourAt) {
  const [fromCol, fromRow, toCol, toRow] = area;
  const [atX, atY] = [(left + fromCol) * scale, (top + fromRow) * scale];
  const image = pen.createImageData((toCol - fromCol) * scale, (toRow - fromRow) * scale);
  const out = new Uint32Array(image.data.buffer);
  for (let i = 0; i < image.height; i += 1) {
    const row = (fromRow + Math.floor(i / scale)) * cells.cols + fromCol;
    for (let j = 0; j < image.width; j += 1) {
      const at = 4 * (row + Math.floor(j / scale));
      out[i * image.width + j] = colourAt(
        cells.data[at],
        cells.data[at + 1],
        cells.data[at + 2],
        i + atY,
        j + atX,
      );
    }
  }
  pen.putImageData(image, atX, atY);
}

// Return the function that gives the colour of a pixel. Colours are few: each is mixed once.
export function colourMixer(classes, light) {
  const palette = paletteOf(light);
  const byId = new Map(
    classes.map((entry) => [
      entry.class_id,
      {
        rgb: rgbOf(entry.display),
        isFull: PATTERNS[patternOf(entry.class_id)],
        share: strength(layerOf(entry)),
      },
    ]),
  );
  const shown = new Set([...byId.keys()].filter((id) => id > 0 && byId.get(id).share > 0));
  const strengths = Object.fromEntries(FIXED.map((name) => [name, strength(name)]));
  const mixed = new Uint32Array(1 << 18); // 0 is not mixed yet: every colour is opaque
  const mix = (flags, id, isFull, isDot) => {
    let colour = groundColour(flags, isDot, palette, strengths);
    if (id) {
      const { rgb, share } = byId.get(id);
      colour = blend(colour, isFull ? rgb : blend(rgb, [255, 255, 255], LIGHT_TONE_SHARE), share);
    }
    return (
      (255 << 24) |
      (Math.round(colour[2]) << 16) |
      (Math.round(colour[1]) << 8) |
      Math.round(colour[0])
    );
  };
  return (flags, first, second, i, j) => {
    const id = shown.has(first) ? first : shown.has(second) ? second : 0;
    const isFull = id ? Number(byId.get(id).isFull(i, j)) : 0;
    const isDot = i % 8 === 0 && j % 8 === 0 ? 1 : 0;
    const key = flags | (id << 8) | (isFull << 16) | (isDot << 17);
    if (mixed[key] === 0) mixed[key] = mix(flags, id, isFull, isDot);
    return mixed[key];
  };
}

function groundColour(flags, isDot, palette, strengths) {
  let colour = palette.stage;
  if (flags & SEEN) colour = blend(colour, palette.free, strengths.free);
  else colour = blend(colour, isDot ? palette.dot : palette.unknown, strengths.unknown);
  if (flags & BLOCKED)
    colour = blend(
      colour,
      palette.inflation,
      strengths.inflation * (flags & SEEN ? 1 : UNSEEN_INFLATION_SHARE),
    );
  if (flags & PRIOR) colour = blend(colour, palette.prior, strengths.prior);
  return flags & OBSTACLE ? blend(colour, palette.obstacle, strengths.obstacle) : colour;
}

const rgbOf = (text) => [1, 3, 5].map((at) => parseInt(text.slice(at, at + 2), 16));
const blend = (under, over, share) =>
  under.map((value, i) => value * (1 - share) + over[i] * share);
