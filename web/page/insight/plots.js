// The plots of the running mission.

import { get } from "../core/api.js";
import { make } from "../core/dom.js";
import { COLUMNS, makeChart, plot } from "./chart.js";

const WINDOW_S = 600;
const MAX_ROWS = 3600;
const series = { t_s: [] };
let charts = {};
let shared;
let isBusy = false;

export function build(pane, context) {
  shared = context;
  charts = Object.fromEntries(Object.keys(COLUMNS).map((name) => [name, makeChart(name)]));
  pane.append(make("div", { class: "charts" }, ...Object.values(charts)));
}

export async function tick(isOpen) {
  if (!isOpen || isBusy) return;
  isBusy = true;
  try {
    await loadNew();
    const times = series.t_s;
    const first = times.length
      ? Math.max(
          0,
          times.findIndex((t) => t >= times.at(-1) - WINDOW_S),
        )
      : 0;
    for (const name of Object.keys(COLUMNS))
      plot(charts[name], name, [
        { t: times.slice(first), values: (series[name] ?? []).slice(first) },
      ]);
  } catch {
    // a lost connection has its own banner
  }
  isBusy = false;
}

async function loadNew() {
  // A restarted robot counts its time from zero again.
  const wasRestarted = series.t_s.length && shared.state?.stamp_s < series.t_s.at(-1) - 1;
  if (wasRestarted) for (const name of Object.keys(series)) series[name] = [];
  const rows = await get(`/series?since_s=${series.t_s.at(-1) ?? -1}`);
  for (const [name, values] of Object.entries(rows))
    series[name] = [...(series[name] ?? []), ...values].slice(-MAX_ROWS);
}
