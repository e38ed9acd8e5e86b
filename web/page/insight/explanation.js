// Why this way: the path in the colours of what bends it, what each rule costs, and what would open a way where there is none.

import { get, post } from "../core/api.js";
import { make, number } from "../core/dom.js";
import { PATTERNS } from "../beware/beware_list.js";
import { attempt } from "../core/toasts.js";

const COLOURS = { wall: "#e6ebf2", zone: "#d63384", open: "#0a84ff", other: "#ffb703" };
const EVERY_MS = 3000;
// On a map of a hundred metres an answer takes a while: then it is asked for less often.
const SHARE = 5;
let shared;
let words;
let table;
let shown = null;
let other = null;
let due = 0;
let busy = false;

export function build(pane, context) {
  shared = context;
  words = make("p", { class: "words", role: "status", "data-testid": "why-words" });
  table = make("ul", { class: "rules", "data-testid": "why-rules" });
  pane.append(words, table);
}

export async function tick(open, now = true) {
  if (!open) { shown = other = null; return; }
  const began = performance.now();
  if (busy || (!now && began < due)) return;
  busy = true;
  try {
    shown = await get("/explain");
    if (other) other.answer = await post("/explain", { without: other.keys });
    draw();
  } catch (error) {
    shown = other = null;
    words.textContent = error.message;
    table.replaceChildren();
    shared.mark([]);
  }
  due = performance.now() + Math.max(EVERY_MS, SHARE * (performance.now() - began));
  busy = false;
}

function colourOf(key) {
  if (key === null) return COLOURS.open;
  const [kind, id] = key.split(":");
  if (kind !== "class") return COLOURS[kind] ?? COLOURS.open;
  return shared.beware.classes.find((entry) => String(entry.class_id) === id)?.display ?? COLOURS.open;
}

const nameOf = (key) => shown.rules.find((rule) => rule.key === key)?.name ?? key;
const list = (keys) => keys.map((key) => `“${nameOf(key)}”`).join(" and ");

function draw() {
  words.textContent = shown.found ? sentence() : refusal();
  const rows = shown.rules.filter((rule) => !shown.found || rule.along_m > 0 || rule.saves_m > 0.05);
  table.replaceChildren(...rows.map(row));
  if (!shown.found && shown.lift?.keys?.length) table.prepend(liftRow(shown.lift.keys));
  if (shown.found && !rows.length) table.replaceChildren(make("li", { class: "empty" }, "Nothing lies along the path: it is as straight as the grid allows."));
  mark();
}

function sentence() {
  const bending = shown.rules.filter((rule) => rule.saves_m > 0.05);
  const way = `The path is ${shown.length_m.toFixed(1)} m long`;
  if (other) return `${way}. ${difference()}`;
  const all = shown.all_cost_m > 0.05 ? `all rules together cost ${shown.all_cost_m.toFixed(1)} m` : "";
  if (!bending.length) return all ? `${way}; no rule by itself makes it longer, but ${all}.` : `${way}; no rule of yours makes it longer.`;
  if (bending.length > 1 && all) return `${way}; ${all}, “${bending[0].name}” by itself ${bending[0].saves_m.toFixed(1)} m.`;
  return `${way}; ${bending.slice(0, 2).map((rule) => `“${rule.name}” costs ${rule.saves_m.toFixed(1)} m`).join(", ")}.`;
}

function difference() {
  const { answer, keys } = other;
  if (!answer?.found) return `Even without ${list(keys)} there is no path${answer?.reason ? `: ${answer.reason}` : ""}.`;
  if (answer.difference_m === null) return `Without ${list(keys)} there is a path of ${answer.length_m.toFixed(1)} m.`;
  const less = -answer.difference_m;
  return Math.abs(less) < 0.05 ? `Without ${list(keys)} it would be as long.` : `Without ${list(keys)} it would be ${Math.abs(less).toFixed(1)} m ${less > 0 ? "shorter" : "longer"}: ${answer.length_m.toFixed(1)} m.`;
}

function refusal() {
  const { lift, reason } = shown;
  if (other) return difference();
  if (lift.keys === null) return lift.exact ? `There is no path (${reason}), and none opens whatever zone or class is lifted: obstacles close every way.` : `There is no path (${reason}). At least ${lift.at_least} rules would have to go; the search for the smallest set was given up.`;
  return lift.keys.length ? `There is no path (${reason}). Lifting ${list(lift.keys)} opens one; no smaller set of rules does.` : `There is no path (${reason}), though no rule is in its way.`;
}

function row(rule) {
  const swatch = make("span", { class: "swatch" });
  swatch.style.setProperty("--c", colourOf(rule.key));
  const [kind, id] = rule.key.split(":");
  if (kind === "class") swatch.dataset.pattern = PATTERNS[(Number(id) - 1) % PATTERNS.length];
  if (kind === "zone") swatch.dataset.pattern = "stripes falling";
  const cost = rule.key === "wall" ? "stands there" : rule.saves_m === null ? "" : rule.saves_m > 0.05 ? `costs ${rule.saves_m.toFixed(1)} m` : "costs nothing";
  const parts = [swatch, make("span", { class: "name" }, rule.name), make("span", { class: "soft" }, shown.found ? `along ${number(rule.along_m, 1, "m")}` : ""), make("b", {}, cost)];
  if (rule.key !== "wall") parts.push(toggle([rule.key], "Path without it"));
  return make("li", { "data-testid": "why-rule", "data-key": rule.key }, ...parts);
}

function liftRow(keys) {
  return make("li", { class: "lift", "data-testid": "why-lift" }, make("b", {}, "⇥ smallest set"), make("span", { class: "name" }, list(keys)), toggle(keys, "Path without"));
}

function toggle(keys, title) {
  const on = other !== null && other.keys.join() === keys.join();
  const act = () => attempt(async () => { other = on ? null : { keys, answer: await post("/explain", { without: keys }) }; draw(); });
  return make("button", { "aria-pressed": String(on), "data-testid": "why-without", onclick: act }, title);
}

function mark() {
  const longest = new Map();
  for (const part of shown.stretches) if (part.key && (!longest.has(part.key) || part.last - part.first > longest.get(part.key).last - longest.get(part.key).first)) longest.set(part.key, part);
  const lines = shown.stretches.map((part) => ({
    colour: colourOf(part.key), dashed: false, name: longest.get(part.key) === part && part.key !== "wall" ? nameOf(part.key) : null,
    points: thinned(shown.path.slice(Math.max(part.first - 1, 0), part.last + 1)),
  }));
  if (other?.answer?.path.length) lines.push({ colour: COLOURS.other, dashed: true, name: null, points: thinned(other.answer.path) });
  shared.mark(lines.filter((line) => line.points.length > 1).slice(-MOST_LINES));
}

const MOST_LINES = 200;
// The 3D view takes so many points a line; a straight run needs only its ends anyway.
const thinned = (points) => (points.length <= 1000 ? points : points.filter((_, i) => i % Math.ceil(points.length / 1000) === 0 || i === points.length - 1));
