// Goals, zones and the beware list beside the view. A list is brought up to date in place: what the operator types in stays.

import { request } from "./api.js";
import { setMode } from "./draft.js";
import { attempt } from "./toasts.js";

const element = (id) => document.getElementById(id);

function make(tag, attributes = {}, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) node[name] = value;
    else if (value !== undefined) node.setAttribute(name, value);
  }
  node.append(...children);
  return node;
}

// Keep one child per key, in order; `refresh` sets what may have changed.
function reconcile(list, items, keyOf, create, refresh) {
  const old = new Map([...list.children].map((child) => [child.dataset.key, child]));
  let previous = null;
  for (const item of items) {
    const key = String(keyOf(item));
    let child = old.get(key);
    old.delete(key);
    if (!child) { child = create(item); child.dataset.key = key; }
    child.item = item;
    refresh(child, item);
    const next = previous ? previous.nextSibling : list.firstChild;
    if (next !== child) list.insertBefore(child, next);
    previous = child;
  }
  for (const child of old.values()) child.remove();
}

function setText(node, text) { if (node.textContent !== text) node.textContent = text; }
function setValue(input, value) { if (document.activeElement !== input && input.value !== String(value)) input.value = value; }

export function showGoals(state) {
  const waiting = state.queue.map((goal, i) => ({ ...goal, number: i + 1 }));
  const reached = state.reached.slice(-5).reverse().map((goal) => ({ ...goal, number: 0 }));
  reconcile(element("goals"), [...waiting, ...reached], (goal) => `${goal.number ? "w" : "r"}${goal.id}`, goalItem, (child, goal) => {
    setText(child.children[0], goal.number ? `⚑ ${goal.number}` : "✓");
    setText(child.children[2], goal.number === 1 ? (state.moving ? "driving here" : "next") : goal.number ? "" : "reached");
  });
  element("no-goals").hidden = waiting.length + reached.length > 0;
  setText(element("goal-count"), `${waiting.length} waiting · ${state.reached.length} reached`);
}

function goalItem(goal) {
  const place = `${goal.x_m.toFixed(2)}, ${goal.y_m.toFixed(2)}`;
  const parts = [make("span", { class: "number" }), make("span", { class: "place" }, place), make("span", { class: "present" })];
  if (goal.number) {
    const remove = () => attempt(() => request("DELETE", `/goals/${goal.id}`));
    parts.push(make("button", { "aria-label": `Remove the goal at ${place}`, title: "Remove", onclick: remove }, "✕"));
  }
  return make("li", { "data-testid": goal.number ? "goal" : "goal-reached", class: goal.number ? "" : "reached" }, ...parts);
}

export function showZones(zones, refetch) {
  reconcile(element("zones"), zones, (zone) => zone.id, (zone) => zoneItem(zone, refetch), (child, zone) => {
    const { name, enabled } = zone.properties;
    const [check, input] = child.querySelectorAll("input");
    check.checked = enabled;
    check.setAttribute("aria-label", `Zone ${name} binds the robot`);
    setValue(input, name);
    child.classList.toggle("off", !enabled);
    child.dataset.name = name;
  });
  element("no-zones").hidden = zones.length > 0;
  setText(element("zone-count"), `${zones.filter((zone) => zone.properties.enabled).length} of ${zones.length} on`);
}

function zoneItem(first, refetch) {
  const item = make("li", { "data-testid": "zone" });
  const zone = () => item.item;
  const put = async (changes) => {
    const { id, geometry, properties: p } = zone();
    const body = { type: "Feature", geometry, properties: { name: p.name, enabled: p.enabled, margin_m: p.margin_m, ...changes } };
    await attempt(() => request("PUT", `/zones/${encodeURIComponent(id)}`, body, { "If-Match": `"${p.version}"` }));
    refetch();
  };
  const remove = async () => {
    await attempt(() => request("DELETE", `/zones/${encodeURIComponent(zone().id)}`, undefined, { "If-Match": `"${zone().properties.version}"` }));
    refetch();
  };
  const check = make("input", { type: "checkbox", title: "Binds the robot", "data-testid": "zone-enabled", onchange: () => put({ enabled: check.checked }) });
  const name = make("input", { class: "name", maxlength: 80, "aria-label": "Name of the zone", "data-testid": "zone-rename", onchange: () => put({ name: name.value.trim() }) });
  item.append(
    check, make("span", { class: "swatch", "data-pattern": "stripes falling" }), name,
    make("button", { title: "Edit the outline", "data-testid": "zone-edit", onclick: () => setMode("edit", zone()) }, "Edit"),
    make("button", { title: "Delete", "aria-label": `Delete zone ${first.properties.name}`, "data-testid": "zone-delete", onclick: remove }, "✕"),
  );
  item.querySelector(".swatch").style.setProperty("--c", "#d63384");
  return item;
}

export const PATTERNS = ["stripes rising", "dots", "stripes falling", "grid", "bars", "columns"];

export function showBeware(beware, refetch) {
  reconcile(element("beware"), beware.classes, (entry) => entry.name, (entry) => bewareItem(entry, refetch), (child, entry) => {
    const [check, margin, confidence] = child.querySelectorAll("input");
    check.checked = entry.enabled;
    setValue(margin, entry.margin_m);
    setValue(confidence, Math.round(100 * entry.min_confidence));
    child.classList.toggle("off", !entry.enabled);
    child.dataset.version = beware.version;
    const [name, finder] = child.querySelector(".label").children;
    setText(name, entry.label ?? entry.name);
    finder.title = "What finds it in the pictures";
    setText(finder, entry.found_by === "nothing" ? "▲ nothing" : entry.found_by);
    finder.classList.toggle("lost", entry.found_by === "nothing");
  });
  setText(element("beware-version"), `version ${beware.version}`);
}

function bewareItem(entry, refetch) {
  const item = make("li", { "data-testid": "beware-class", "data-name": entry.name });
  const patch = async (changes) => {
    await attempt(() => request("PATCH", `/beware/${encodeURIComponent(entry.name)}`, changes, { "If-Match": `"${item.dataset.version}"` }));
    refetch();
  };
  const check = make("input", { type: "checkbox", title: "Keep away from it", "aria-label": `Keep away from ${entry.name}`, "data-testid": `beware-${entry.class_id}`, onchange: () => patch({ enabled: check.checked }) });
  const margin = make("input", { class: "margin", type: "number", min: 0, max: 2, step: 0.05, title: "Room kept around it, metres", "aria-label": `Margin around ${entry.name} in metres`, onchange: () => patch({ margin_m: margin.value === "" ? null : Number(margin.value) }) });
  const confidence = make("input", { class: "margin", type: "number", min: 0, max: 100, step: 5, title: "How sure one must be of it, percent", "aria-label": `Least confidence for ${entry.name} in percent`, onchange: () => patch({ min_confidence: confidence.value === "" ? null : Number(confidence.value) / 100 }) });
  const swatch = make("span", { class: "swatch", "data-pattern": PATTERNS[(entry.class_id - 1) % PATTERNS.length] });
  swatch.style.setProperty("--c", entry.display);
  const label = make("span", { class: "label", title: entry.name }, make("span"), make("small", { "data-testid": "found-by" }));
  item.append(check, swatch, label, margin, make("span", { class: "unit" }, "m"), confidence, make("span", { class: "unit" }, "%"));
  return item;
}

const FIXED = [
  ["#ced6e2", "", "floor, seen"], ["#3e4757", "unknown", "not seen (free)"], ["#78869e", "", "too close"], ["#0c0f14", "", "obstacle"],
  ["#d63384", "stripes falling", "zone"], ["#0a84ff", "line", "planned path"], ["#57647a", "line dashed", "driven"], ["#00a86b", "flag", "goal ⚑"],
  ["#ffb703", "line", "draft, camera"],
];

export function showLegend(beware) {
  const rows = [...FIXED, ...beware.classes.map((entry) => [entry.display, PATTERNS[(entry.class_id - 1) % PATTERNS.length], entry.name])];
  element("legend").replaceChildren(...rows.map(([colour, kind, text]) => {
    const swatch = make("span", { class: kind.startsWith("line") ? `swatch ${kind}` : "swatch" });
    if (PATTERNS.includes(kind) || kind === "unknown") swatch.dataset.pattern = kind;
    swatch.style.setProperty("--c", colour);
    return make("li", {}, swatch, make("span", {}, text));
  }));
}
