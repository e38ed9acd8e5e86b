// The plots of the running mission: the newest minutes, with the events of the log as marks.

import { get } from "../../core/link/api.js";
import { loadSetting, make, saveSetting } from "../../core/dom.js";
import { sentence, t } from "../../core/text/language.js";
import { COLUMNS, makeChart, plot } from "./chart.js";

const KEY = "console.plots_s";
const WINDOWS_S = { 60: t("1 minute"), 600: t("10 minutes"), 3600: t("1 hour") };
const DEFAULT_S = 600;
const MAX_ROWS = 3600;
const MARKED = "kind=stopped&kind=goal&kind=zone";
const MAX_MARKS = 100;
let series = { t_s: [] };
let charts = {};
let choice;
let nothing;
let marks = [];
let isBusy = false;

export function build(pane) {
  charts = Object.fromEntries(Object.keys(COLUMNS).map((name) => [name, makeChart(name)]));
  choice = make(
    "select",
    { "data-testid": "plots-window", onchange: choose },
    ...Object.entries(WINDOWS_S).map(([seconds, text]) =>
      make("option", { value: seconds }, text),
    ),
  );
  choice.value = loadSetting(KEY, DEFAULT_S);
  nothing = make("p", { class: "empty" }, t("Nothing has been driven yet: add a goal and press Start."));
  pane.append(
    make(
      "div",
      { class: "head" },
      make("label", { class: "soft" }, t("Newest "), choice),
      make("span", { class: "soft" }, t("Marks: stops, goals and zones of the log.")),
      nothing,
    ),
    make("div", { class: "charts in-row" }, ...Object.values(charts)),
  );
}

function choose() {
  saveSetting(KEY, Number(choice.value));
  draw();
}

export async function tick(isOpen) {
  if (!isOpen || isBusy) return;
  isBusy = true;
  try {
    await loadNew();
    const { entries, start } = await get(`/journal?since=0&limit=${MAX_MARKS}&${MARKED}`);
    // The robot counted its time from zero at each start.
    marks = entries
      .filter((entry) => entry.start === start)
      .map((entry) => ({ t: entry.stamp_s, unixS: entry.unix_s, text: sentence(entry.text) }));
    draw();
  } catch {
    // a lost connection has its own banner
  }
  isBusy = false;
}

function draw() {
  const times = series.t_s;
  nothing.hidden = times.length > 1;
  if (times.length < 2) return;
  const from = times.at(-1) - Number(choice.value);
  const first = Math.max(times.findIndex((t) => t >= from), 0);
  const t = times.slice(first);
  // The newest mark tells the robot's clock; without one the newest row is of now, up to a second.
  const known = marks.at(-1) ?? { t: t.at(-1), unixS: Date.now() / 1000 };
  const startUnixS = known.unixS - (known.t - t[0]);
  for (const name of Object.keys(COLUMNS))
    plot(charts[name], name, [{ t, values: (series[name] ?? []).slice(first) }], {
      startUnixS,
      marks,
    });
}

// After a lost connection the console may have been started again, and count its time from zero.
export function forget() {
  series = { t_s: [] };
}

async function loadNew() {
  const asked = series;
  const rows = await get(`/series?since_s=${series.t_s.at(-1) ?? -1}`);
  if (series !== asked) return; // forgotten meanwhile
  for (const [name, values] of Object.entries(rows))
    series[name] = [...(series[name] ?? []), ...values].slice(-MAX_ROWS);
}
