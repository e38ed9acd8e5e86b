// Why this path: the path in the colours of the rules that bend it, what each rule costs, and the
// fewest rules whose removal opens a path where there is none.

import { classTitle } from "../beware/class_title.js";
import { swatch, patternOf } from "../beware/swatch.js";
import { edit, get, post } from "../core/link/api.js";
import { make } from "../core/dom.js";
import { formatNumber } from "../core/text/format.js";
import { capitalised, t } from "../core/text/language.js";
import { attempt } from "../core/toasts.js";
import { offerUndo } from "../core/undo.js";
import { world } from "../map/world.js";
import { switchZone } from "../zones/zones.js";
import { describe, listOf, metres, MIN_COST_M, nameOf, titleOf } from "./explanation_text.js";

const COLOURS = { wall: "#e6ebf2", zone: "#d63384", open: "#0a84ff", other: "#ffb703" };
const PERIOD_MS = 3000;
// On a large map an answer takes long: the pause is at least so many times as long.
const PAUSE_FACTOR = 5;
const MAX_LINES = 200;
const MAX_POINTS = 1000;
let shared;
let isClosed;
let words;
let main; // the button that tries the path without the costliest rules
let table;
let explained = null; // the answer for the path that is driven
let trial = null; // `{ keys, answer }`: the path without some rules, while the operator looks at it
let dueMs = 0;
let isBusy = false;

export function build(pane, context) {
  shared = context;
  isClosed = () => pane.hidden;
  words = make("p", { class: "words", role: "status", "data-testid": "why-words" });
  table = make("ul", { class: "rules", "data-testid": "why-rules" });
  main = make("span", { class: "row", "data-testid": "why-main" });
  pane.append(make("div", { class: "head" }, words, main), table);
}

export async function tick(isOpen, now = true) {
  if (!isOpen) {
    explained = trial = null;
    return;
  }
  const beganMs = performance.now();
  if (isBusy || (!now && beganMs < dueMs)) return;
  isBusy = true;
  try {
    const answer = await get("/explain");
    if (trial) trial.answer = await post("/explain", { without: trial.keys });
    explained = answer;
    draw();
  } catch (error) {
    explained = trial = null;
    words.textContent = capitalised(error.message);
    main.replaceChildren();
    table.replaceChildren();
    if (!isClosed()) shared.mark([]);
  }
  dueMs = performance.now() + Math.max(PERIOD_MS, PAUSE_FACTOR * (performance.now() - beganMs));
  isBusy = false;
}

function colourOf(key) {
  if (key === null) return COLOURS.open;
  const [kind, id] = key.split(":");
  if (kind !== "class") return COLOURS[kind] ?? COLOURS.open;
  return (
    shared.beware.classes.find((entry) => String(entry.class_id) === id)?.display ?? COLOURS.open
  );
}

function draw() {
  if (isClosed() || !explained) return; // the answer came too late
  const { found, rules, lift } = explained;
  words.textContent = describe(explained, trial);
  const keys = explained.main_cost_m > MIN_COST_M ? explained.main : [];
  const title = keys.length > 1 ? t("Path without them") : t("Path without it");
  main.replaceChildren(...(keys.length ? [trialButton(keys, title)] : []), ...offButtons());
  const rows = rules.filter((rule) => !found || rule.along_m > 0 || rule.saves_m > MIN_COST_M);
  table.replaceChildren(...rows.map(ruleRow));
  if (!found && lift?.keys?.length) table.prepend(liftRow(lift.keys));
  if (found && !rows.length)
    table.replaceChildren(
      make(
        "li",
        { class: "empty" },
        t("Nothing lies along the path: it is as straight as the grid allows."),
      ),
    );
  markPaths();
}

function ruleRow(rule) {
  const [kind, id] = rule.key.split(":");
  const pattern =
    kind === "class" ? patternOf(Number(id)) : kind === "zone" ? "stripes falling" : null;
  const parts = [
    swatch(colourOf(rule.key), pattern),
    make("span", { class: "name" }, titleOf(rule)),
    make(
      "span",
      { class: "soft" },
      explained.found ? t("along {length}", { length: formatNumber(rule.along_m, 1, "m") }) : "",
    ),
    make("b", {}, costText(rule)),
  ];
  if (rule.key !== "wall") parts.push(trialButton([rule.key], t("Path without it")));
  return make("li", { "data-testid": "why-rule", "data-key": rule.key }, ...parts);
}

function costText(rule) {
  if (rule.key === "wall") return t("cannot be removed");
  if (rule.saves_m === null) return "";
  return rule.saves_m > MIN_COST_M ? t("costs {length}", { length: metres(rule.saves_m) }) : t("costs nothing");
}

function liftRow(keys) {
  const name = make("span", { class: "name" }, listOf(explained, keys));
  return make(
    "li",
    { class: "lift", "data-testid": "why-lift" },
    make("b", {}, t("⇥ fewest rules")),
    name,
    trialButton(keys, t("Path without")),
  );
}

function trialButton(keys, title) {
  const isOn = trial !== null && trial.keys.join() === keys.join();
  const toggle = () =>
    attempt(async () => {
      trial = isOn ? null : { keys, answer: await post("/explain", { without: keys }) };
      draw();
    });
  return make(
    "button",
    { "aria-pressed": String(isOn), "data-testid": "why-without", onclick: toggle },
    title,
  );
}

// The button that makes what is tried true: one rule of the operator is switched off, as in its list.
function offButtons() {
  const [kind, id] = trial?.keys.length === 1 ? trial.keys[0].split(":") : [];
  const zone = kind === "zone" && world.zones.find((one) => one.id === id);
  const entry =
    kind === "class" && shared.beware.classes.find(({ class_id: one }) => String(one) === id);
  if (!(zone || entry) || document.body.dataset.role === "viewer") return [];
  const name = zone ? zone.properties.name : classTitle(entry);
  const switchClass = () =>
    attempt(() => edit("PATCH", `/beware/${encodeURIComponent(entry.name)}`, { enabled: false }));
  const onclick = async () => {
    const made = await (zone ? switchZone(zone, false) : switchClass());
    if (!made) return;
    trial = null;
    offerUndo(t("“{name}” is switched off.", { name }), made);
    await tick(!isClosed());
  };
  return [make("button", { "data-testid": "why-off", onclick }, t("Switch it off"))];
}

function markPaths() {
  const length = (part) => part.last - part.first;
  const longest = new Map(); // rule → its longest stretch, which carries the name
  for (const part of explained.stretches) {
    if (part.key && !(longest.has(part.key) && length(part) <= length(longest.get(part.key))))
      longest.set(part.key, part);
  }
  const lines = explained.stretches.map((part) => ({
    colour: colourOf(part.key),
    dashed: false,
    name:
      longest.get(part.key) === part && part.key !== "wall" ? nameOf(explained, part.key) : null,
    points: thin(explained.path.slice(Math.max(part.first - 1, 0), part.last + 1)),
  }));
  if (trial?.answer?.path.length)
    lines.push({
      colour: COLOURS.other,
      dashed: true,
      name: null,
      points: thin(trial.answer.path),
    });
  shared.mark(lines.filter((line) => line.points.length > 1).slice(-MAX_LINES));
}

// The 3D view takes a limited number of points per line.
function thin(points) {
  if (points.length <= MAX_POINTS) return points;
  const step = Math.ceil(points.length / MAX_POINTS);
  return points.filter((_, i) => i % step === 0 || i === points.length - 1);
}
