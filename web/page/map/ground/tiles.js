// The tiles of the map: only those that changed are fetched and painted.

import { abortableFetch, get } from "../../core/link/api.js";
import { t } from "../../core/text/language.js";
import { boundsOf, colourMixer, paint, read } from "./cells.js";

const LARGE_MAP_CELLS = 1_500_000;
// Flags of a cell that was seen, is an obstacle, or is on the prior map.
const KNOWN = 1 | 2 | 16;
const PARALLEL_REQUESTS = 6;
const tiles = new Map(); // "row/col" → its cells and position
let canvas = new OffscreenCanvas(1, 1);
let colourAt = colourMixer([], false);
let scale = 1;
let knownVersion = 0;
let timesForgotten = 0;
// Counts paintings, so that a copy of the canvas knows when it is out of date.
export let paintCount = 0;

// Begin with another map.
export function forget() {
  knownVersion = 0;
  timesForgotten += 1;
}

// Return a canvas with the newest map, row 0 of the grid at its lower edge, and `frame`, its position
// and size with the size of the robot.
export async function loadNewest() {
  const begun = timesForgotten;
  const { version, tile_cells: side, changed, ...frame } = await get(
    `/map/tiles?since=${knownVersion}`,
  );
  const { rows, cols } = frame;
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
  if (begun === timesForgotten) knownVersion = version;
  return { canvas, frame };
}

async function loadTile(row, col, version, side, rows) {
  const answer = await abortableFetch(`/api/v1/map/tiles/${row}/${col}.png?v=${version}`);
  if (!answer.ok) throw new Error(t("no map yet"));
  const cells = await read(await answer.blob());
  const [left, top] = [col * side, rows - row * side - cells.rows];
  const tile = { cells, left, top, known: knownOf(cells) };
  const old = tiles.get(`${row}/${col}`);
  tiles.set(`${row}/${col}`, tile);
  const changed = old ? changeOf(old.cells, cells) : wholeOf(cells);
  if (!changed) return;
  paint(canvas.getContext("2d"), tile, changed, scale, colourAt);
  paintCount += 1;
}

const wholeOf = ({ cols, rows }) => [0, 0, cols, rows];

// The area of a tile that differs from what it was, or null.
function changeOf(before, now) {
  if (before.cols !== now.cols || before.rows !== now.rows) return wholeOf(now);
  const [old, cells] = [before, now].map(({ data }) => new Uint32Array(data.buffer));
  return boundsOf(now, (at) => old[at] !== cells[at]);
}

// The area of a tile that holds more than unseen floor, or null.
const knownOf = (cells) =>
  boundsOf(cells, (at) => cells.data[4 * at] & KNOWN || cells.data[4 * at + 1]);

// The known part of the map in metres, { left, right, bottom, top }, or null.
export function knownArea({ resolution_m: r, origin_x_m: x, origin_y_m: y, rows }) {
  const area = { left: Infinity, right: -Infinity, bottom: Infinity, top: -Infinity };
  for (const { left, top, known } of tiles.values()) {
    if (!known) continue;
    area.left = Math.min(area.left, x + (left + known[0]) * r);
    area.right = Math.max(area.right, x + (left + known[2]) * r);
    area.top = Math.max(area.top, y + (rows - top - known[1]) * r);
    area.bottom = Math.min(area.bottom, y + (rows - top - known[3]) * r);
  }
  return area.right > area.left ? area : null;
}

// Flags and classes of the cell at a point in metres, or null where no tile is known.
export function cellAt({ resolution_m: r, origin_x_m: x, origin_y_m: y, rows }, [px, py]) {
  const [col, row] = [Math.floor((px - x) / r), rows - 1 - Math.floor((py - y) / r)];
  for (const { cells, left, top } of tiles.values()) {
    if (col < left || row < top || col >= left + cells.cols || row >= top + cells.rows) continue;
    const at = 4 * ((row - top) * cells.cols + (col - left));
    const [flags, first, second] = cells.data.slice(at, at + 3);
    return { flags, first, second };
  }
  return null;
}

// Paint all tiles again, after a change of the list, a layer or the theme.
export function repaint(classes, light) {
  colourAt = colourMixer(classes, light);
  const pen = canvas.getContext("2d");
  for (const tile of tiles.values()) paint(pen, tile, wholeOf(tile.cells), scale, colourAt);
  paintCount += 1;
}
