// The painted map, kept up to date tile by tile: only what changed is fetched and drawn.

import { get } from "./api.js";

const MOST_PIXELS = 16e6;
const AT_ONCE = 6;
const canvas = document.createElement("canvas");
let known = 0;

// A canvas with the newest map, row 0 of the grid at its lower edge.
export async function newest() {
  const { version, tile_cells: side, scale, rows, cols, changed } = await get(`/map/tiles?since=${known}`);
  // A map of a hundred metres is drawn with one pixel a cell: a tablet has no memory for four.
  const fine = rows * cols * scale * scale > MOST_PIXELS ? 1 : scale;
  if (canvas.width !== cols * fine || canvas.height !== rows * fine) {
    [canvas.width, canvas.height] = [cols * fine, rows * fine];
    if (known) { known = 0; return newest(); }
  }
  const pen = canvas.getContext("2d");
  const waiting = [...changed];
  const work = async () => {
    for (let next = waiting.pop(); next; next = waiting.pop()) {
      const [row, col, at] = next;
      const picture = await load(`/api/v1/map/tiles/${row}/${col}.png?v=${at}`);
      const [wide, high] = [Math.min(side, cols - col * side), Math.min(side, rows - row * side)];
      pen.drawImage(picture, col * side * fine, (rows - row * side - high) * fine, wide * fine, high * fine);
    }
  };
  await Promise.all(Array.from({ length: AT_ONCE }, work));
  known = version;
  return canvas;
}

function load(source) {
  return new Promise((resolve, reject) => {
    const image = new Image();
    image.onload = () => resolve(image);
    image.onerror = () => reject(new Error("no picture"));
    image.src = source;
  });
}
