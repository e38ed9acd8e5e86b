// The drawer below the view: the log of decisions, why this way, what was seen, plots. Each tab is a file of its own.

import * as ages from "./freshness.js";
import { make } from "../core/dom.js";
import * as journal from "./event_log.js";
import { overlays, redraw } from "../map/map.js";
import * as plots from "./plots.js";
import * as sightings from "./detections.js";
import * as why from "./explanation.js";

const TABS = { log: ["Log", journal], why: ["Why this way?", why], seen: ["Seen", sightings], plots: ["Plots", plots] };
const PERIOD_MS = 1000;
const shared = { state: null, beware: { classes: [] }, look: () => {}, mark: () => {}, open: null };
const marked = { lines: [], place: null };
const buttons = {};
const panes = {};

export function start({ look, mark }) {
  shared.look = (place) => { look(place); show(marked.lines, place); };
  shared.mark = (lines) => show(lines, marked.place);
  shared.send = mark;
  const strip = make("div", { class: "drawer-tabs", role: "tablist", "aria-label": "Understand" });
  const body = make("div", { class: "drawer", id: "drawer", hidden: "" });
  for (const [name, [title, tab]] of Object.entries(TABS)) {
    buttons[name] = make("button", { role: "tab", "aria-selected": "false", "aria-controls": "drawer", "data-testid": `tab-${name}`, onclick: () => open(shared.open === name ? null : name) }, title);
    panes[name] = make("div", { class: `pane pane-${name}`, role: "tabpanel", hidden: "", "data-testid": `pane-${name}` });
    tab.build(panes[name], shared, buttons[name]);
  }
  const chips = make("div", { class: "ages", "aria-label": "How old is what is shown" });
  ages.build(chips);
  strip.append(...Object.values(buttons), make("a", { href: "/runs", target: "_blank", "data-testid": "runs-link" }, "Runs ↗"), chips);
  body.append(...Object.values(panes));
  document.getElementById("understand").append(strip, body);
  overlays.push(paint);
  setInterval(() => { if (!document.hidden) tick(); }, PERIOD_MS);
  tick();
}

export function update(values) { Object.assign(shared, values); }

// The 3D view forgets what was marked when its page's connection is lost.
export function remark() { shared.send?.(marked.lines, marked.place); }

function open(name) {
  shared.open = name;
  document.getElementById("drawer").hidden = name === null;
  for (const [key, button] of Object.entries(buttons)) {
    button.setAttribute("aria-selected", String(key === name));
    panes[key].hidden = key !== name;
  }
  if (name !== "why") shared.mark([]);
  if (name) TABS[name][1].tick(true);
}

function tick() {
  for (const [name, [, tab]] of Object.entries(TABS)) tab.tick(shared.open === name, false);
}

function show(lines, place) {
  Object.assign(marked, { lines, place });
  remark();
  redraw();
}

function paint({ pen, line, tag, toPage }) {
  for (const { points, colour, dashed } of marked.lines) {
    line(points, "#000000a0", 8, dashed ? [9, 7] : []);
    line(points, colour, 5, dashed ? [9, 7] : []);
  }
  // A name beside the middle of each rule's longest stretch: the colour is not the only sign.
  for (const { points, colour, name } of marked.lines) if (name) { const [x, y] = toPage(points[Math.floor(points.length / 2)]); tag(name, [x, y - 18], colour); }
  if (marked.place) {
    const [x, y] = toPage(marked.place);
    pen.strokeStyle = "#fff"; pen.lineWidth = 4; pen.beginPath(); pen.arc(x, y, 15, 0, 2 * Math.PI); pen.stroke();
    pen.strokeStyle = "#f0b429"; pen.lineWidth = 2; pen.beginPath(); pen.arc(x, y, 15, 0, 2 * Math.PI); pen.moveTo(x - 22, y); pen.lineTo(x - 8, y); pen.moveTo(x + 8, y); pen.lineTo(x + 22, y); pen.moveTo(x, y - 22); pen.lineTo(x, y - 8); pen.moveTo(x, y + 8); pen.lineTo(x, y + 22); pen.stroke();
  }
}
