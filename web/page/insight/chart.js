// A chart of one or two curves over time, drawn as SVG.

import { make } from "../core/dom.js";

const SVG = "http://www.w3.org/2000/svg";
// Column of the time series → title, unit, digits.
export const COLUMNS = {
  speed_mps: ["Speed", "m/s", 2],
  distance_m: ["Distance", "m", 1],
  explored_m2: ["Explored area", "m²", 0],
  explored_m3: ["Explored volume", "m³", 1],
  tick_ms: ["Tick", "ms", 0],
};
const DASHES = ["", "6 4"];
// The plot area within a view box of 300 × 120.
const [LEFT, RIGHT, TOP, BOTTOM] = [34, 294, 10, 100];

export function makeChart(name) {
  const [title, unit] = COLUMNS[name];
  const svg = shape("svg", { viewBox: "0 0 300 120", role: "img" });
  const caption = make("figcaption", {}, make("span", {}, `${title}, ${unit}`), make("b"));
  return make("figure", { class: "chart", "data-testid": `chart-${name}` }, caption, svg);
}

// `curves`: [{ t, values }], at most two; the second is dashed. Times count from each curve's start.
export function plot(figure, name, curves) {
  const [title, unit, digits] = COLUMNS[name];
  const svg = figure.querySelector("svg");
  const filled = curves.filter((curve) => curve.t?.length > 1 && curve.values?.length > 1);
  const latest = curves[0]?.values?.at(-1);
  figure.querySelector("b").textContent =
    curves.length === 1 && typeof latest === "number" ? latest.toFixed(digits) : "";
  svg.replaceChildren();
  if (!filled.length) {
    svg.append(label("no data yet", 150, 62, "middle"));
    return;
  }
  const duration = Math.max(...filled.map(({ t }) => t[t.length - 1] - t[0]), 1);
  const numbers = filled.flatMap(({ values }) => values.filter((value) => value !== null));
  const [low, high] = [
    Math.min(0, ...numbers),
    Math.max(roundUp(Math.max(...numbers, 1e-3)), 1e-3),
  ];
  const x = (t) => LEFT + ((RIGHT - LEFT) * t) / duration;
  const y = (value) => BOTTOM - ((BOTTOM - TOP) * (value - low)) / (high - low);
  for (const share of [0, 0.5, 1]) {
    const value = low + share * (high - low);
    svg.append(
      shape("line", { x1: LEFT, x2: RIGHT, y1: y(value), y2: y(value), class: "grid" }),
      label(tickText(value), LEFT - 4, y(value) + 3, "end"),
    );
  }
  const end = duration < 120 ? `${duration.toFixed(0)} s` : `${(duration / 60).toFixed(1)} min`;
  svg.append(label("0", LEFT, 113, "start"), label(end, RIGHT, 113, "end"));
  filled.forEach(({ t, values }, i) => {
    svg.append(
      shape("path", {
        d: pathOf(t, values, x, y),
        class: `curve curve-${i}`,
        "stroke-dasharray": DASHES[i] ?? "",
      }),
    );
  });
  svg.setAttribute(
    "aria-label",
    `${title} in ${unit} over ${duration.toFixed(0)} seconds, largest ${Math.max(...numbers).toFixed(digits)}`,
  );
}

// A missing value interrupts the curve.
function pathOf(times, values, x, y) {
  let command = "M";
  return times
    .map((time, i) => {
      if (values[i] === null || values[i] === undefined) {
        command = "M";
        return "";
      }
      const step = `${command}${x(time - times[0]).toFixed(1)} ${y(values[i]).toFixed(1)}`;
      command = "L";
      return step;
    })
    .join("");
}

function roundUp(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return [1, 2, 2.5, 5, 10].map((step) => step * power).find((top) => top >= value) ?? value;
}

const tickText = (value) =>
  Math.abs(value) >= 1000 ? `${(value / 1000).toFixed(1)}k` : String(Number(value.toPrecision(2)));

function label(words, x, y, anchor) {
  const node = shape("text", { x, y, "text-anchor": anchor });
  node.textContent = words;
  return node;
}

function shape(tag, attributes) {
  const node = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  return node;
}
