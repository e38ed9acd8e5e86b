// Curves over the mission, drawn as SVG: live in the drawer, and on the page of past runs.

import { get } from "../core/api.js";
import { make } from "../core/dom.js";

const SVG = "http://www.w3.org/2000/svg";
export const COLUMNS = {
  speed_mps: ["Speed", "m/s", 2], distance_m: ["Distance", "m", 1], explored_m2: ["Explored area", "m²", 0],
  explored_m3: ["Explored volume", "m³", 1], tick_ms: ["Tick", "ms", 0],
};
const STROKES = ["", "6 4"];
const WINDOW_S = 600;
const held = { t_s: [] };
let charts = {};
let shared;
let busy = false;

export function build(pane, context) {
  shared = context;
  charts = Object.fromEntries(Object.keys(COLUMNS).map((name) => [name, chart(name)]));
  pane.append(make("div", { class: "charts" }, ...Object.values(charts)));
}

export async function tick(open) {
  if (!open || busy) return;
  busy = true;
  try {
    // A robot that was started anew counts its time from the start again.
    if (held.t_s.length && shared.state?.stamp_s < held.t_s.at(-1) - 1) for (const name of Object.keys(held)) held[name] = [];
    const since = held.t_s.length ? held.t_s[held.t_s.length - 1] : -1;
    const rows = await get(`/series?since_s=${since}`);
    for (const [name, values] of Object.entries(rows)) held[name] = [...(held[name] ?? []), ...values].slice(-3600);
    const first = held.t_s.length ? Math.max(0, held.t_s.findIndex((t) => t >= held.t_s[held.t_s.length - 1] - WINDOW_S)) : 0;
    for (const name of Object.keys(COLUMNS)) plot(charts[name], name, [{ t: held.t_s.slice(first), values: (held[name] ?? []).slice(first) }]);
  } catch { /* a lost connection has its own banner */ }
  busy = false;
}

export function chart(name) {
  const [title, unit] = COLUMNS[name];
  const picture = document.createElementNS(SVG, "svg");
  picture.setAttribute("viewBox", "0 0 300 120");
  picture.setAttribute("role", "img");
  return make("figure", { class: "chart", "data-testid": `chart-${name}` }, make("figcaption", {}, make("span", {}, `${title}, ${unit}`), make("b", {})), picture);
}

// `curves`: [{ t, values, title }], at most two; the second is dashed. Times count from each curve's first row.
export function plot(figure, name, curves) {
  const [title, unit, digits] = COLUMNS[name];
  const picture = figure.querySelector("svg");
  const filled = curves.filter((curve) => curve.t?.length > 1 && curve.values?.length > 1);
  const latest = curves[0]?.values?.at(-1);
  figure.querySelector("b").textContent = curves.length === 1 && typeof latest === "number" ? latest.toFixed(digits) : "";
  picture.replaceChildren();
  if (!filled.length) { picture.append(text("no figures yet", 150, 62, "middle")); return; }
  const long = Math.max(...filled.map(({ t }) => t[t.length - 1] - t[0]), 1);
  const numbers = filled.flatMap(({ values }) => values.filter((value) => value !== null));
  const [low, high] = [Math.min(0, ...numbers), Math.max(nice(Math.max(...numbers, 1e-3)), 1e-3)];
  const x = (t) => 34 + (260 * t) / long;
  const y = (value) => 100 - (90 * (value - low)) / (high - low);
  for (const share of [0, 0.5, 1]) {
    const value = low + share * (high - low);
    picture.append(shape("line", { x1: 34, x2: 294, y1: y(value), y2: y(value), class: "grid" }), text(short(value), 30, y(value) + 3, "end"));
  }
  picture.append(text("0", 34, 113, "start"), text(long < 120 ? `${long.toFixed(0)} s` : `${(long / 60).toFixed(1)} min`, 294, 113, "end"));
  filled.forEach(({ t, values }, i) => picture.append(shape("path", { d: path(t, values, x, y), class: `curve curve-${i}`, "stroke-dasharray": STROKES[i] ?? "" })));
  picture.setAttribute("aria-label", `${title} in ${unit} over ${long.toFixed(0)} seconds, largest ${Math.max(...numbers).toFixed(digits)}`);
}

function path(t, values, x, y) {
  let pen = "M";
  return t.map((time, i) => {
    if (values[i] === null || values[i] === undefined) { pen = "M"; return ""; }
    const step = `${pen}${x(time - t[0]).toFixed(1)} ${y(values[i]).toFixed(1)}`;
    pen = "L";
    return step;
  }).join("");
}

function nice(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return [1, 2, 2.5, 5, 10].map((step) => step * power).find((top) => top >= value) ?? value;
}

const short = (value) => (Math.abs(value) >= 1000 ? `${(value / 1000).toFixed(1)}k` : String(Number(value.toPrecision(2))));
function text(words, x, y, anchor) { const node = shape("text", { x, y, "text-anchor": anchor }); node.textContent = words; return node; }
function shape(tag, attributes) {
  const node = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  return node;
}
