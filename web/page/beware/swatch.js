// A patch of a class's colour and pattern, as on the map: the colour is never the only sign.

import { make } from "../core/dom.js";

const PATTERNS = ["stripes rising", "dots", "stripes falling", "grid", "bars", "columns"];
const UNKNOWN_COLOUR = "#888888";

export const patternOf = (classId) => PATTERNS[(classId - 1) % PATTERNS.length];

export function swatch(colour, pattern = null, shape = "") {
  const node = make("span", { class: `swatch ${shape}`.trim(), "data-pattern": pattern });
  node.style.setProperty("--c", colour);
  return node;
}

export const swatchOf = (entry) =>
  entry ? swatch(entry.display, patternOf(entry.class_id)) : swatch(UNKNOWN_COLOUR);
