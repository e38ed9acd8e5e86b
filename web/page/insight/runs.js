// Past missions: a list, the report and plots of one, or two side by side.

import { get } from "../core/api.js";
import { make } from "../core/dom.js";
import { chart, COLUMNS, plot } from "./plots.js";
import "../core/theme.js";
import { attempt } from "../core/toasts.js";

const element = (id) => document.getElementById(id);
const LIST = [
  ["scenario", (run) => run.scenario ?? "–"], ["goals", (run) => `${run.goals_reached ?? "–"} of ${run.goals?.length ?? "–"}`],
  ["time, s", (run) => figure(run.sim_time_s, 1)], ["distance, m", (run) => figure(run.distance_m, 1)], ["SPL", (run) => figure(run.spl, 2)],
  ["collisions", (run) => figure(run.collisions, 0)], ["beware intrusions", (run) => figure(run.beware_intrusions, 0)],
  ["zone intrusions", (run) => figure(run.zone_intrusions, 0)],
];
let chosen = [];

function figure(value, digits) { return typeof value === "number" ? value.toFixed(digits) : "–"; }

async function list() {
  const runs = await get("/runs");
  element("note").textContent = runs.length ? `${runs.length} run${runs.length > 1 ? "s" : ""}, newest first` : "No mission has ended yet; one stands here as soon as it has.";
  element("head").replaceChildren(make("tr", {}, make("th", {}, ""), make("th", {}, "run"), ...LIST.map(([title]) => make("th", {}, title))));
  element("runs").replaceChildren(...runs.map((run) => {
    const box = make("input", { type: "checkbox", "aria-label": `Show run ${run.id}`, "data-testid": "run-check", value: run.id });
    const row = make("tr", { "data-testid": "run" }, make("td", {}, box), make("td", {}, run.id), ...LIST.map(([, read]) => make("td", {}, read(run))));
    box.onchange = () => {
      chosen = box.checked ? [...chosen, run.id].slice(-2) : chosen.filter((id) => id !== run.id);
      for (const other of element("runs").querySelectorAll("input")) {
        other.checked = chosen.includes(other.value);
        other.closest("tr").setAttribute("aria-selected", String(other.checked));
      }
      attempt(show);
    };
    return row;
  }));
  if (runs.length) element("runs").querySelector("input").click();
}

async function show() {
  const wanted = chosen.join();
  const reports = await Promise.all(chosen.map((id) => get(`/runs/${encodeURIComponent(id)}`)));
  if (wanted !== chosen.join()) return;
  for (const id of ["plots", "report"]) element(id).hidden = reports.length === 0;
  element("key").textContent = reports.length === 2 ? `— ${reports[0].id}   ╌ ${reports[1].id}` : reports[0]?.id ?? "";
  element("charts").replaceChildren(...Object.keys(COLUMNS).map((name) => {
    const drawn = chart(name);
    plot(drawn, name, reports.map((report) => ({ t: report.series?.t_s ?? [], values: report.series?.[name] ?? [] })));
    return drawn;
  }));
  const names = [...new Set(reports.flatMap((report) => Object.keys(report)))].filter((name) => name !== "series");
  element("rows").replaceChildren(
    make("tr", {}, make("th", {}, ""), ...reports.map((report) => make("th", {}, report.id)), ...(reports.length === 2 ? [make("th", {}, "difference")] : [])),
    ...names.map((name) => row(name, reports.map((report) => report[name]))),
  );
}

function row(name, values) {
  const cells = values.map((value) => make("td", {}, words(name, value)));
  if (values.length === 2) {
    const both = values.every((value) => typeof value === "number");
    cells.push(make("td", {}, both && values[0] !== values[1] ? signed(values[1] - values[0]) : ""));
  }
  const differs = values.length === 2 && JSON.stringify(values[0]) !== JSON.stringify(values[1]);
  return make("tr", { class: differs ? "differs" : "" }, make("th", {}, name.replaceAll("_", " ")), ...cells);
}

const signed = (value) => `${value > 0 ? "+" : "−"}${Number(Math.abs(value).toPrecision(4))}`;

function words(name, value) {
  if (value === null || value === undefined) return "–";
  if (typeof value === "boolean") return value ? "✓ yes" : "✕ no";
  if (name === "goals") return value.map(([x, y]) => `(${x}, ${y})`).join(" → ");
  if (name === "stops") return value.length ? value.map((stop) => `${stop.t_s?.toFixed?.(1)} s: ${stop.reason?.replaceAll?.("_", " ")} for ${stop.duration_s?.toFixed?.(1)} s`).join("; ") : "none";
  if (typeof value === "object") return Object.entries(value).map(([key, inner]) => `${key} ${typeof inner === "number" ? Number(inner.toPrecision(4)) : JSON.stringify(inner)}`).join(", ");
  return typeof value === "number" ? String(Number(value.toPrecision(6))) : String(value);
}

attempt(list);
