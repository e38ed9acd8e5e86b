// The page of past missions: a list, report and plots of one run, or two side by side.

import { get } from "../../core/link/api.js";
import { element, make } from "../../core/dom.js";
import { takeOver } from "../../core/stop.js";
import { tellStopped } from "../../core/stop_beside.js";
import { formatDateTime } from "../../core/text/format.js";
import { language, number, sentence, t, tn } from "../../core/text/language.js";
import "../../core/theme.js";
import { attempt } from "../../core/toasts.js";
import { COLUMNS, makeChart, plot } from "./chart.js";
import { nameOf } from "./run_fields.js";

takeOver(tellStopped);
const fixed = (value, digits) => (typeof value === "number" ? number(value, digits) : "–");
// Field → text of a run.
const LIST = {
  begun_unix_s: (run) => begunText(run.begun_unix_s),
  site: (run) => run.site ?? "–",
  scenario: (run) => run.scenario ?? "–",
  goals: (run) => {
    const numbers = { reached: run.goals_reached ?? "–", all: run.goal_count ?? run.goals?.length ?? "–" };
    if (run.unfinished) return t("{reached} of {all}, interrupted or going on", numbers);
    return run.cancelled ? t("{reached} of {all}, cancelled", numbers) : t("{reached} of {all}", numbers);
  },
  sim_time_s: (run) => fixed(run.sim_time_s, 1),
  distance_m: (run) => fixed(run.distance_m, 1),
  spl: (run) => fixed(run.spl, 2),
  collisions: (run) => fixed(run.collisions, 0),
  beware_intrusions: (run) => fixed(run.beware_intrusions, 0),
  zone_intrusions: (run) => fixed(run.zone_intrusions, 0),
};
const begunText = (unixS) => (typeof unixS === "number" ? formatDateTime(new Date(1000 * unixS)) : "–");
let chosen = [];

async function showList() {
  const runs = await get("/runs");
  element("note").textContent = runs.length
    ? tn("{n} run, newest first", "{n} runs, newest first", runs.length)
    : t("No mission has finished yet. Add a goal in the console and press Start; the report appears here.");
  element("head").replaceChildren(
    make("tr", {}, ...["", ...["id", ...Object.keys(LIST)].map(nameOf)].map((title) => make("th", {}, title))),
  );
  element("runs").replaceChildren(...runs.map(rowOf));
  if (runs.length) element("runs").querySelector("input").click();
}

function rowOf(run) {
  const box = make("input", {
    type: "checkbox",
    "aria-label": t("Show run {id}", run),
    "data-testid": "run-check",
    value: run.id,
  });
  box.onchange = () => {
    chosen = box.checked ? [...chosen, run.id].slice(-2) : chosen.filter((id) => id !== run.id);
    for (const other of element("runs").querySelectorAll("input")) {
      other.checked = chosen.includes(other.value);
      other.closest("tr").setAttribute("aria-selected", String(other.checked));
    }
    attempt(showChosen);
  };
  const cells = [box, run.id, ...Object.values(LIST).map((read) => read(run))];
  return make("tr", { "data-testid": "run" }, ...cells.map((cell) => make("td", {}, cell)));
}

async function showChosen() {
  const asked = chosen.join();
  const reports = await Promise.all(chosen.map((id) => get(`/runs/${encodeURIComponent(id)}`)));
  if (asked !== chosen.join()) return; // another choice was made meanwhile
  for (const id of ["plots", "report"]) element(id).hidden = reports.length === 0;
  element("key").textContent =
    reports.length === 2 ? `— ${reports[0].id}   ╌ ${reports[1].id}` : (reports[0]?.id ?? "");
  const names = Object.keys(COLUMNS);
  const charts = names.map(makeChart);
  element("charts").replaceChildren(...charts); // a chart is as wide as its box
  names.forEach((name, i) =>
    plot(
      charts[i],
      name,
      reports.map((report) => ({
        t: report.series?.t_s ?? [],
        values: report.series?.[name] ?? [],
      })),
    ),
  );
  const fields = [...new Set(reports.flatMap((report) => Object.keys(report)))].filter(
    (name) => name !== "series",
  );
  const titles = [
    "",
    ...reports.map((report) => report.id),
    ...(reports.length === 2 ? [t("difference")] : []),
  ];
  element("rows").replaceChildren(
    make("tr", {}, ...titles.map((title) => make("th", {}, title))),
    ...fields.map((name) =>
      fieldRow(
        name,
        reports.map((report) => report[name]),
      ),
    ),
  );
}

function fieldRow(name, values) {
  const cells = values.map((value) => textOf(name, value));
  const isPair = values.length === 2;
  if (isPair) cells.push(name === "begun_unix_s" ? "" : differenceOf(values));
  const differs = isPair && JSON.stringify(values[0]) !== JSON.stringify(values[1]);
  return make(
    "tr",
    { class: differs ? "differs" : "" },
    make("th", {}, nameOf(name)),
    ...cells.map((text) => make("td", {}, text)),
  );
}

function differenceOf([one, other]) {
  if (typeof one !== "number" || typeof other !== "number" || one === other) return "";
  return `${other > one ? "+" : "−"}${rounded(Math.abs(other - one), 4)}`;
}

const rounded = (value, digits) =>
  value.toLocaleString(language, { maximumSignificantDigits: digits, useGrouping: false });

function textOf(name, value) {
  if (value === null || value === undefined) return "–";
  if (typeof value === "boolean") return value ? t("✓ yes") : t("✕ no");
  if (name === "begun_unix_s") return begunText(value);
  if (name === "goals") return value.map(([x, y]) => `(${x}, ${y})`).join(" → ");
  if (name === "stops") return value.length ? value.map(stopText).join("; ") : t("none");
  if (typeof value === "object")
    return Object.entries(value)
      .map(
        ([key, inner]) =>
          `${key} ${typeof inner === "number" ? rounded(inner, 4) : JSON.stringify(inner)}`,
      )
      .join(", ");
  return typeof value === "number" ? rounded(value, 6) : String(value);
}

// Reports of earlier versions have one entry for each stop, without a count.
function stopText(stop) {
  const times = stop.count > 1 ? ` × ${stop.count}` : "";
  return t("{time} s: {reason} for {duration} s", {
    time: fixed(stop.t_s, 1),
    reason: sentence(String(stop.reason ?? "").replaceAll("_", " ")) + times,
    duration: fixed(stop.duration_s, 1),
  });
}

attempt(showList);
