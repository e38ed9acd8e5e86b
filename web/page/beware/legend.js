// What the colours and patterns of the map mean: a swatch for each of its layers, as it is drawn in
// the present theme.

import { element, make } from "../core/dom.js";
import { t } from "../core/text/language.js";
import { isLight } from "../core/theme.js";
import { paletteOf } from "../map/ground/cells.js";
import { COLOURS } from "../map/drawing/strokes.js";
import { swatch } from "./swatch.js";

// Layer → its colour, pattern and shape.
const SIGNS = {
  unknown: (palette) => [palette.unknown, "unknown"],
  free: (palette) => [palette.free],
  obstacle: (palette) => [palette.obstacle],
  inflation: (palette) => [palette.inflation],
  prior: (palette) => [palette.prior],
  zones: () => ["#d63384", "stripes falling"],
  path: () => [COLOURS.path, null, "line"],
  waypoints: () => [COLOURS.path, null, "diamond"],
  driven: () => [COLOURS.driven, null, "line dashed"],
  people: () => [COLOURS.person],
  view: () => [COLOURS.draft, null, "line dashed"],
  motion: () => [COLOURS.robot, null, "line"],
  candidates: () => [COLOURS.goal, null, "line"],
};
const OTHERS = [
  [COLOURS.goal, t("goal ⚑")],
  [COLOURS.draft, t("what is drawn")],
  ["#b7791f", t("speed limit"), "dots"],
];
const css = (colour) => (Array.isArray(colour) ? `rgb(${colour.join(" ")})` : colour);

export function signOf(layer) {
  const palette = paletteOf(isLight());
  const [colour, pattern = null, shape = ""] = SIGNS[layer](palette);
  const node = swatch(css(colour), pattern, shape);
  node.style.setProperty("--dot", css(palette.dot));
  return node;
}

element("legend").append(
  ...OTHERS.map(([colour, text, pattern]) =>
    make("li", {}, swatch(colour, pattern), make("span", {}, text)),
  ),
);
