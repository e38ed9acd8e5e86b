// The cells of the map as a picture, painted here so that each layer can be switched and faded without asking again.

import { strength } from "./layers.js";

const SEEN = 1, OBSTACLE = 2, BLOCKED = 4, PRIOR = 16;
const DARK = { stage: [10, 14, 19], unknown: [62, 71, 87], dot: [126, 138, 158], free: [206, 214, 226], inflation: [120, 134, 158], obstacle: [12, 15, 20], prior: [84, 70, 120] };
const LIGHT = { stage: [236, 240, 245], unknown: [196, 204, 215], dot: [146, 156, 172], free: [255, 255, 255], inflation: [198, 208, 222], obstacle: [30, 38, 50], prior: [150, 134, 190] };
const PATTERNS = {
  "stripes rising": (i, j) => (i - j + 600000) % 6 < 3, "stripes falling": (i, j) => (i + j) % 6 < 3, dots: (i, j) => i % 6 < 3 && j % 6 < 3,
  grid: (i, j) => i % 6 < 2 || j % 6 < 2, bars: (i) => i % 6 < 3, columns: (i, j) => j % 6 < 3,
};
const NAMES = Object.keys(PATTERNS);

// The bytes of a tile: (rows · cols) red flags, green and blue class ids.
export async function read(blob) {
  const bitmap = await createImageBitmap(blob, { colorSpaceConversion: "none", premultiplyAlpha: "none" });
  const canvas = new OffscreenCanvas(bitmap.width, bitmap.height);
  const pen = canvas.getContext("2d", { willReadFrequently: true });
  pen.drawImage(bitmap, 0, 0);
  return { cols: bitmap.width, rows: bitmap.height, data: pen.getImageData(0, 0, bitmap.width, bitmap.height).data };
}

// Some of the cells, in their place of the whole picture: `left` and `top` in cells, `scale` pixels to a cell and side.
export function paint(pen, { cells, left, top }, scale, mix) {
  const image = pen.createImageData(cells.cols * scale, cells.rows * scale);
  const out = new Uint32Array(image.data.buffer);
  for (let i = 0; i < image.height; i += 1) {
    const row = Math.floor(i / scale) * cells.cols;
    for (let j = 0; j < image.width; j += 1) {
      const at = 4 * (row + Math.floor(j / scale));
      out[i * image.width + j] = mix(cells.data[at], cells.data[at + 1], cells.data[at + 2], i + top * scale, j + left * scale);
    }
  }
  pen.putImageData(image, left * scale, top * scale);
}

// Colours are few: each is mixed once and looked up from then on.
export function mixer(classes, light) {
  const palette = light ? LIGHT : DARK;
  const byId = new Map(classes.map((entry) => [entry.class_id, { ...entry, rgb: hex(entry.display), pattern: PATTERNS[NAMES[(entry.class_id - 1) % NAMES.length]] }]));
  const shown = (id) => id > 0 && byId.has(id) && strength(`class-${id}`) > 0;
  const known = new Uint32Array(1 << 18); // 0 is no colour: every colour is opaque
  const strengths = Object.fromEntries(["unknown", "free", "inflation", "obstacle", "prior"].map((name) => [name, strength(name)]));
  const base = (flags, dot) => {
    let colour = palette.stage;
    if (flags & SEEN) colour = blend(colour, palette.free, strengths.free);
    else colour = blend(colour, dot ? palette.dot : palette.unknown, strengths.unknown);
    if (flags & BLOCKED) colour = blend(colour, palette.inflation, strengths.inflation * (flags & SEEN ? 1 : 0.45));
    if (flags & PRIOR) colour = blend(colour, palette.prior, strengths.prior);
    return flags & OBSTACLE ? blend(colour, palette.obstacle, strengths.obstacle) : colour;
  };
  return (flags, first, second, i, j) => {
    const id = shown(first) ? first : shown(second) ? second : 0;
    const entry = id ? byId.get(id) : null;
    const strong = entry ? Number(entry.pattern(i, j)) : 0;
    const dot = i % 8 === 0 && j % 8 === 0 ? 1 : 0;
    const key = flags | (id << 8) | (strong << 16) | (dot << 17);
    if (known[key] === 0) {
      let colour = base(flags, dot);
      if (entry) colour = blend(colour, strong ? entry.rgb : blend(entry.rgb, [255, 255, 255], 0.38), strength(`class-${id}`));
      known[key] = (255 << 24) | (Math.round(colour[2]) << 16) | (Math.round(colour[1]) << 8) | Math.round(colour[0]);
    }
    return known[key];
  };
}

const hex = (text) => [1, 3, 5].map((at) => parseInt(text.slice(at, at + 2), 16));
const blend = (under, over, share) => under.map((value, i) => value * (1 - share) + over[i] * share);
