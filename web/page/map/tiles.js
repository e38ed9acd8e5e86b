// The tiles of the map: only those that changed are fetched and painted.

import { abortableFetch, get } from "../core/api.js";
import { colourMixer, paint, read } from "./cells.js";

const LARGE_MAP_CELLS = 1_500_000;
const PARALLEL_REQUESTS = 6;
const tiles = new Map(); // "row/col" → its cells and position
let canvas = new OffscreenCanvas(1, 1);
let colourAt = colourMixer([], false);
let scale = 1;
let knownVersion = 0;
// Counts paintings, so that a copy of the canvas knows when it is out of date.
export let paintCount = 0;

// Return a canvas with the newest map, row 0 of the grid at its lower edge, and its size in cells.
export async function loadNewest() {
  const {
    version,
    tile_cells: side,
    rows,
    cols,
    changed,
  } = await get(`/map/tiles?since=${knownVersion}`);
  // With two pixels per cell and side patterns are finer than a cell; large maps would need too
  // much memory.
  const pixels = rows * cols > LARGE_MAP_CELLS ? 1 : 2;
  if (canvas.width !== cols * pixels || canvas.height !== rows * pixels) {
    canvas = new OffscreenCanvas(cols * pixels, rows * pixels);
    scale = pixels;
    tiles.clear();
    if (knownVersion) {
      knownVersion = 0;
      return loadNewest();
    }
  }
  const waiting = [...changed];
  const work = async () => {
    for (let next = waiting.pop(); next; next = waiting.pop()) {
      const [row, col, tileVersion] = next;
      await loadTile(row, col, tileVersion, side, rows);
    }
  };
  await Promise.all(Array.from({ length: PARALLEL_REQUESTS }, work));
  knownVersion = version;
  return { canvas, rows, cols };
}

async function loadTile(row, col, version, side, rows) {
  const answer = await abortableFetch(`/api/v1/map/tiles/${row}/${col}.png?v=${version}`);
  if (!answer.ok) throw new Error("no map yet");
  const cells = await read(await answer.blob());
  const tile = { cells, left: col * side, top: rows - row * side - cells.rows };
  const old = tiles.get(`${row}/${col}`);
  tiles.set(`${row}/${col}`, tile);
  if (old && isEqual(old.cells.data, cells.data)) return;
  paint(canvas.getContext("2d"), tile, scale, colourAt);
  paintCount += 1;
}

function isEqual(one, other) {
  const [a, b] = [one, other].map((bytes) => new Uint32Array(bytes.buffer));
  return a.length === b.length && a.every((cell, i) => cell === b[i]);
}

// Paint all tiles again, after a change of the list, a layer or the theme.
export function repaint(classes, light) {
  colourAt = colourMixer(classes, light);
  for (const tile of tiles.values()) paint(canvas.getContext("2d"), tile, scale, colourAt);
  paintCount += 1;
}
