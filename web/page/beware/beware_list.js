// The beware list and the legend beside the view.

import { post, request } from "../core/api.js";
import { element, make, reconcile, setText, setValue } from "../core/dom.js";
import { attempt } from "../core/toasts.js";

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
  element("beware-undo").disabled = !beware.can_undo;
  for (const way of ["undo", "defaults"]) element(`beware-${way}`).onclick = async () => { await attempt(() => post(`/beware/${way}`)); refetch(); };
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
