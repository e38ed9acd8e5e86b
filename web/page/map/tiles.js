// The cells of the map, kept up to date tile by tile: only what changed is fetched and painted.

import { fetched, get } from "../core/api.js";
import { mixer, paint, read } from "./cells.js";

const LARGE = 1_500_000;
const AT_ONCE = 6;
const held = new Map();
let canvas = new OffscreenCanvas(1, 1);
let mix = mixer([], false);
let scale = 1;
let known = 0;
// Counts what was painted: who has drawn this canvas elsewhere draws it again when the number is another.
export let painted = 0;

// A canvas with the newest map, row 0 of the grid at its lower edge, and its size in cells.
export async function newest() {
  const { version, tile_cells: side, rows, cols, changed } = await get(`/map/tiles?since=${known}`);
  // Two pixels a cell and side where the map is small, so that a texture is finer than a cell; for more a tablet has no memory.
  const fine = rows * cols > LARGE ? 1 : 2;
  if (canvas.width !== cols * fine || canvas.height !== rows * fine) {
    canvas = new OffscreenCanvas(cols * fine, rows * fine);
    scale = fine;
    held.clear();
    if (known) { known = 0; return newest(); }
  }
  const waiting = [...changed];
  const work = async () => {
    for (let next = waiting.pop(); next; next = waiting.pop()) {
      const [row, col, at] = next;
      const answer = await fetched(`/api/v1/map/tiles/${row}/${col}.png?v=${at}`);
      if (!answer.ok) throw new Error("no map yet");
      const cells = await read(await answer.blob());
      const tile = { cells, left: col * side, top: rows - row * side - cells.rows };
      const old = held.get(`${row}/${col}`);
      held.set(`${row}/${col}`, tile);
      if (old && same(old.cells.data, cells.data)) continue;
      paint(canvas.getContext("2d"), tile, scale, mix);
      painted += 1;
    }
  };
  await Promise.all(Array.from({ length: AT_ONCE }, work));
  known = version;
  return { canvas, rows, cols };
}

function same(one, other) {
  const [a, b] = [one, other].map((bytes) => new Uint32Array(bytes.buffer));
  return a.length === b.length && a.every((cell, i) => cell === b[i]);
}

// Paint what is here anew: the list, a layer or the theme has changed.
export function repaint(classes, light) {
  mix = mixer(classes, light);
  for (const tile of held.values()) paint(canvas.getContext("2d"), tile, scale, mix);
  painted += 1;
}
