// What the colours and patterns of the map mean.

import { element, make } from "../core/dom.js";
import { swatch, swatchOf } from "./swatch.js";

// Colour, pattern, shape, text.
const FIXED = [
  ["#ced6e2", null, "", "floor, seen"],
  ["#3e4757", "unknown", "", "not seen (free)"],
  ["#78869e", null, "", "too close"],
  ["#0c0f14", null, "", "obstacle"],
  ["#d63384", "stripes falling", "", "zone"],
  ["#0a84ff", null, "line", "planned path"],
  ["#57647a", null, "line dashed", "driven path"],
  ["#00a86b", null, "", "goal ⚑"],
  ["#ffb703", null, "line", "draft, camera"],
];

export function showLegend(classes) {
  const rows = FIXED.map(([colour, pattern, shape, text]) => [
    swatch(colour, pattern, shape),
    text,
  ]);
  for (const entry of classes) rows.push([swatchOf(entry), entry.name]);
  element("legend").replaceChildren(
    ...rows.map(([mark, text]) => make("li", {}, mark, make("span", {}, text))),
  );
}
