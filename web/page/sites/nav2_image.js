// The two files of a Nav2 map in the browser: what the YAML says of the pixels, and the image.

import { t } from "../core/text/language.js";

const NUMBER = "([-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?)";
const PGM_HEAD = /^P([25])\s+(?:#[^\n]*\n\s*)*(\d+)\s+(?:#[^\n]*\n\s*)*(\d+)\s+(?:#[^\n]*\n\s*)*(\d+)\s/;
const MAX_HEAD_BYTES = 1000;
const MAX_SIDE = 8000;

export function readDescription(text) {
  const resolution = text.match(new RegExp(`^resolution:\\s*${NUMBER}`, "m"));
  const origin = text.match(
    new RegExp(`^origin:\\s*(?:\\[|\\n\\s*-)\\s*${NUMBER}\\s*(?:,|\\n\\s*-)\\s*${NUMBER}`, "m"),
  );
  if (!resolution || !origin) throw new Error(t("the YAML file names no resolution and origin"));
  const image = text.match(/^image:\s*["']?(?:.*[/\\])?(.+?)["']?\s*$/m)?.[1];
  return { resolution: Number(resolution[1]), x: Number(origin[1]), y: Number(origin[2]), image };
}

// The pixels, as they are drawn; a browser knows PNG but not PGM.
export async function decodeImage(bytes, file) {
  if (bytes[0] !== 0x50) {
    const bitmap = await createImageBitmap(file).catch(() => null);
    if (!bitmap) throw new Error(t("{name} is no PNG or PGM image", file));
    const pen = new OffscreenCanvas(bitmap.width, bitmap.height).getContext("2d");
    pen.drawImage(bitmap, 0, 0);
    return pen.getImageData(0, 0, bitmap.width, bitmap.height);
  }
  const head = new TextDecoder("latin1").decode(bytes.slice(0, MAX_HEAD_BYTES)).match(PGM_HEAD);
  const [width, height, white] = head ? head.slice(2).map(Number) : [0, 0, 0];
  const isReadable = head && white > 0 && white < 256 && Math.max(width, height) <= MAX_SIDE;
  if (!isReadable || !(width * height)) throw new Error(t("{name} is no PGM image of 8 bits", file));
  const rest = bytes.slice(head[0].length);
  const levels = head[1] === "5" ? rest : new TextDecoder().decode(rest).trim().split(/\s+/);
  const image = new ImageData(width, height);
  for (let i = 0; i < width * height; i += 1) {
    const level = (255 * Number(levels[i] ?? 0)) / white;
    image.data.set([level, level, level, 255], 4 * i);
  }
  return image;
}
