// The drawer below the view: event log, explanation, detections and plots, one file per tab.

import { element, make } from "../core/dom.js";
import { t } from "../core/text/language.js";
import { overlays, redraw } from "../map/map.js";
import * as detections from "./detections.js";
import * as eventLog from "./event_log.js";
import * as explanation from "./explanation.js";
import * as freshness from "./freshness.js";
import * as plots from "./plots/plots.js";
import { makeSplitter } from "./splitter.js";

const TABS = {
  log: [t("Log"), eventLog],
  why: [t("Why this path?"), explanation],
  seen: [t("Detections"), detections],
  plots: [t("Plots"), plots],
};
const PERIOD_MS = 1000;
const MARK_PX = 15;
const shared = { state: null, beware: { classes: [] }, look: () => {}, mark: () => {}, showSightings: () => {} };
const marked = { lines: [], place: null };
const buttons = {};
const panes = {};
let openTab = null;
let splitter;
let sendMarks = () => {};

// `look(place)` turns map and 3D view to a point, `mark(lines, place)` marks them in the 3D view.
export function start({ look, mark, showSightings }) {
  sendMarks = mark;
  shared.showSightings = showSightings;
  shared.look = (place) => {
    look(place);
    show(marked.lines, place);
  };
  shared.mark = (lines) => show(lines, marked.place);
  for (const [name, [title, tab]] of Object.entries(TABS)) {
    const toggle = () => open(openTab === name ? null : name);
    buttons[name] = make(
      "button",
      {
        role: "tab",
        "aria-selected": "false",
        "aria-controls": "drawer",
        "data-testid": `tab-${name}`,
        onclick: toggle,
      },
      title,
    );
    panes[name] = make("div", {
      class: `pane pane-${name}`,
      role: "tabpanel",
      hidden: "",
      "data-testid": `pane-${name}`,
    });
    tab.build(panes[name], shared, buttons[name]);
  }
  const ages = make("div", { class: "ages", "aria-label": t("Age of what is shown") });
  freshness.build(ages);
  const tabs = make("div", { role: "tablist", "aria-label": t("Insight") }, ...Object.values(buttons));
  const runs = make("a", { href: "/runs", target: "_blank", "data-testid": "runs-link" }, t("Runs ↗"));
  const body = make("div", { class: "drawer", id: "drawer", hidden: "" }, ...Object.values(panes));
  splitter = makeSplitter(body);
  const bar = make("div", { class: "drawer-tabs" }, tabs, runs, ages);
  element("insight").append(splitter, bar, body);
  overlays.push(paintMarks);
  setInterval(() => {
    if (!document.hidden) tick();
  }, PERIOD_MS);
  tick();
}

export function update(values) {
  Object.assign(shared, values);
}

// Send the marks again: the console forgets them when the page's connection is lost.
export function resendMarks() {
  sendMarks(marked.lines, marked.place);
}

function open(name) {
  openTab = name;
  element("drawer").hidden = splitter.hidden = name === null;
  for (const [key, button] of Object.entries(buttons)) {
    button.setAttribute("aria-selected", String(key === name));
    panes[key].hidden = key !== name;
  }
  if (name !== "why") shared.mark([]);
  if (name) TABS[name][1].tick(true);
}

function tick() {
  for (const [name, [, tab]] of Object.entries(TABS)) tab.tick(openTab === name, false);
}

function show(lines, place) {
  Object.assign(marked, { lines, place });
  resendMarks();
  redraw();
}

function paintMarks({ pen, line, placeLabel, toPage }) {
  for (const { points, colour, dashed } of marked.lines) {
    line(points, "#000000a0", 8, dashed ? [9, 7] : []);
    line(points, colour, 5, dashed ? [9, 7] : []);
  }
  // A name beside the middle of each rule's longest stretch: the colour is never the only sign.
  for (const { points, colour, name } of marked.lines) {
    if (!name) continue;
    const [x, y] = toPage(points[Math.floor(points.length / 2)]);
    placeLabel(name, [x, y - 18], { colour });
  }
  if (marked.place) {
    paintTarget(pen, toPage(marked.place), "#fff", 4, []);
    paintTarget(pen, toPage(marked.place), "#f0b429", 2, [
      [-1, 0],
      [1, 0],
      [0, -1],
      [0, 1],
    ]);
  }
}

// A ring with ticks in the given directions.
function paintTarget(pen, [x, y], colour, width, ticks) {
  pen.strokeStyle = colour;
  pen.lineWidth = width;
  pen.beginPath();
  pen.arc(x, y, MARK_PX, 0, 2 * Math.PI);
  for (const [dx, dy] of ticks) {
    pen.moveTo(x + 22 * dx, y + 22 * dy);
    pen.lineTo(x + 8 * dx, y + 8 * dy);
  }
  pen.stroke();
}
