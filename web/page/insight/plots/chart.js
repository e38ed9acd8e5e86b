// A chart of one or two curves over time, drawn as SVG: round ticks, marks of events, and the value
// below the pointer, in all charts of a group at once.

import { make } from "../../core/dom.js";
import { formatTime } from "../../core/text/format.js";
import { number, t } from "../../core/text/language.js";
import { durationText, ticksOf, tickText } from "./ticks.js";

const SVG = "http://www.w3.org/2000/svg";
// Column of the time series → title, unit, digits.
export const COLUMNS = {
  speed_mps: [t("Speed"), "m/s", 2],
  distance_m: [t("Distance"), "m", 1],
  explored_m2: [t("Explored area"), "m²", 0],
  explored_m3: [t("Explored volume"), "m³", 1],
  tick_ms: [t("Tick"), "ms", 0],
};
const DASHES = ["", "6 4"];
// Margins of the plot area and its height in pixels: a chart is as wide as its box, so that its text
// is as large as the page's.
const [LEFT, RIGHT, TOP, BOTTOM, HEIGHT] = [40, 8, 8, 106, 130];
const FEWEST_PX = 140;
const widthOf = (svg) => Math.max(svg.clientWidth, FEWEST_PX);

export function makeChart(name) {
  const [title, unit] = COLUMNS[name];
  const svg = shape("svg", { height: HEIGHT, role: "img" });
  const caption = make("figcaption", {}, make("span", {}, `${title}, ${unit}`), make("b"));
  const figure = make("figure", { class: "chart", "data-testid": `chart-${name}` }, caption, svg);
  svg.onpointermove = (event) => pointAt(figure, event);
  svg.onpointerleave = () => forGroup(figure, (chart) => showAt(chart, null));
  return figure;
}

// `curves`: [{ t, values }], at most two; the second is dashed. Times count from each curve's start.
// `startUnixS`: wall time of the first start, for a clock below the chart; `marks`: [{ t, text }],
// events in the times of the first curve.
export function plot(figure, name, curves, { startUnixS = null, marks = [] } = {}) {
  const [title, unit, digits] = COLUMNS[name];
  const svg = figure.querySelector("svg");
  const filled = curves.filter((curve) => curve.t?.length > 1 && curve.values?.length > 1);
  const numbers = filled.flatMap(({ values }) =>
    values.filter((value) => value !== null && value !== undefined),
  );
  const width = widthOf(svg);
  const span = width - LEFT - RIGHT;
  figure.plot = null;
  svg.setAttribute("viewBox", `0 0 ${width} ${HEIGHT}`);
  svg.replaceChildren();
  if (!numbers.length) {
    figure.querySelector("b").textContent = "";
    svg.setAttribute("aria-label", t("{title}: no data yet", { title }));
    svg.append(label(t("No data yet"), width / 2, 62, "middle"));
    return;
  }
  const duration = Math.max(...filled.map(({ t }) => t[t.length - 1] - t[0]), 1);
  const ticks = ticksOf(Math.min(0, ...numbers), Math.max(...numbers, 1e-3));
  const [low, high] = [ticks[0], ticks[ticks.length - 1]];
  const x = (t) => LEFT + (span * t) / duration;
  const y = (value) => BOTTOM - ((BOTTOM - TOP) * (value - low)) / (high - low);
  for (const value of ticks)
    svg.append(
      shape("line", { x1: LEFT, x2: LEFT + span, y1: y(value), y2: y(value), class: "grid" }),
      label(tickText(value), LEFT - 4, y(value) + 4, "end"),
    );
  const ends = startUnixS === null
    ? ["0", durationText(duration)]
    : [formatTime(startUnixS), formatTime(startUnixS + duration)];
  svg.append(label(ends[0], LEFT, 125, "middle"), label(ends[1], LEFT + span, 125, "end"));
  const [first] = filled;
  for (const { t, text } of marks) {
    if (t < first.t[0]) continue;
    const mark = shape("line", { x1: x(t - first.t[0]), x2: x(t - first.t[0]), y1: TOP, y2: BOTTOM, class: "mark" });
    mark.append(shape("title", {}, text));
    svg.append(mark);
  }
  filled.forEach(({ t, values }, i) => {
    svg.append(
      shape("path", {
        d: pathOf(t, values, x, y),
        class: `curve curve-${i}`,
        "stroke-dasharray": DASHES[i] ?? "",
      }),
    );
  });
  svg.append(shape("line", { class: "cross", y1: TOP, y2: BOTTOM, visibility: "hidden" }));
  figure.plot = { filled, duration, digits, startUnixS, span };
  showAt(figure, null);
  svg.setAttribute(
    "aria-label",
    t("{title} in {unit} over {duration}, largest {largest}", {
      title,
      unit,
      duration: durationText(duration),
      largest: number(Math.max(...numbers), digits),
    }),
  );
}

const forGroup = (figure, act) => {
  for (const chart of figure.parentElement?.querySelectorAll(".chart") ?? [figure]) act(chart);
};

function pointAt(figure, { clientX }) {
  if (!figure.plot) return;
  const box = figure.querySelector("svg").getBoundingClientRect();
  const share = (clientX - box.left - LEFT) / figure.plot.span;
  const seconds = Math.min(Math.max(share, 0), 1) * figure.plot.duration;
  forGroup(figure, (chart) => showAt(chart, seconds));
}

// Show the values at a time since the start beside the title; those of the end for null.
function showAt(figure, seconds) {
  if (!figure.plot) return;
  const { filled, duration, digits, startUnixS, span } = figure.plot;
  const cross = figure.querySelector(".cross");
  const shown = figure.querySelector("b");
  cross.setAttribute("visibility", seconds === null ? "hidden" : "visible");
  if (seconds === null) {
    const latest = filled[0].values.at(-1);
    shown.textContent = filled.length === 1 && typeof latest === "number" ? number(latest, digits) : "";
    return;
  }
  const x = LEFT + (span * seconds) / duration;
  cross.setAttribute("x1", x);
  cross.setAttribute("x2", x);
  const at = startUnixS === null ? durationText(seconds) : formatTime(startUnixS + seconds);
  const values = filled.map(({ t, values: curve }) => {
    const value = curve[indexAt(t, t[0] + seconds)];
    return typeof value === "number" ? number(value, digits) : "–";
  });
  shown.textContent = t("{values} at {time}", { values: values.join(" / "), time: at });
}

// Index of the last time that is not later.
function indexAt(times, time) {
  let [low, high] = [0, times.length - 1];
  while (low < high) {
    const middle = Math.ceil((low + high) / 2);
    if (times[middle] <= time) low = middle;
    else high = middle - 1;
  }
  return low;
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

function label(words, x, y, anchor) {
  return shape("text", { x, y, "text-anchor": anchor }, words);
}

function shape(tag, attributes, text = "") {
  const node = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  if (text) node.textContent = text;
  return node;
}
