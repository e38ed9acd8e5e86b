// What the operator is doing with the pointer: looking, picking goals, drawing a zone or editing one.
// The draft lives here and nowhere else, so the stream of the robot's state cannot touch it.

import { post, request } from "./api.js";
import { attempt, say } from "./toasts.js";

const DOUBLE_CLICK_MS = 400;
const SAME_PLACE_M = 0.3;
const PREVIEW_AFTER_MS = 180;

export const draft = { mode: "navigate", id: null, version: null, corners: [], preview: [] };
const watchers = [];
const element = (id) => document.getElementById(id);
const form = element("draft");
const fields = { name: element("draft-name"), corners: element("draft-corners"), margin: element("draft-margin") };
const HINTS = {
  navigate: "",
  goal: "Every click on the floor queues a goal. Esc when done.",
  draw: "Click the corners. Double-click or Enter closes the zone, Backspace takes a corner back, Esc drops it.",
  edit: "Drag a corner to move it. Enter stores the change, Esc keeps the stored zone.",
};
let last = { at: 0, x: 0, y: 0 };
let timer = 0;
let nextNumber = () => 1;

export const onDraft = (watcher) => watchers.push(watcher);
export const nameZonesBy = (counter) => { nextNumber = counter; };

export function setMode(mode, zone = null) {
  Object.assign(draft, { mode, id: zone?.id ?? null, version: zone?.properties.version ?? null, preview: [] });
  draft.corners = zone ? zone.geometry.coordinates[0].slice(0, -1).map(([x, y]) => [x, y]) : [];
  draft.enabled = zone?.properties.enabled ?? true;
  const drawing = mode === "draw" || mode === "edit";
  form.hidden = !drawing;
  element("draft-title").textContent = zone ? "Edit zone" : "New zone";
  fields.name.value = zone?.properties.name ?? (drawing ? `Zone ${nextNumber()}` : "");
  fields.margin.value = zone?.properties.margin_m ?? 0;
  element("hint").textContent = HINTS[mode];
  for (const button of document.querySelectorAll("[data-mode]")) button.setAttribute("aria-checked", String(button.dataset.mode === mode));
  changed();
}

// A click on the floor, from the 3D view or the map. `onMap` is the nearest point of the map.
export function clicked(x, y, onMap) {
  const now = performance.now();
  const again = now - last.at < DOUBLE_CLICK_MS && Math.hypot(x - last.x, y - last.y) < SAME_PLACE_M;
  last = { at: again ? 0 : now, x, y };
  if (draft.mode === "goal" && !again) {
    attempt(() => post("/goals", { x_m: rounded(x), y_m: rounded(y) }));
  } else if (draft.mode === "draw") {
    if (again) finish();
    else { draft.corners.push(onMap.map(rounded)); changed(); }
  }
}

export function dragged(index, onMap) {
  if ((draft.mode !== "edit" && draft.mode !== "draw") || !draft.corners[index]) return;
  draft.corners[index] = onMap.map(rounded);
  changed();
}

export function undo() {
  draft.corners.pop();
  changed();
}

export async function finish() {
  if (draft.mode !== "draw" && draft.mode !== "edit") return;
  const margin = Number(fields.margin.value);
  const zone = {
    type: "Feature",
    geometry: { type: "Polygon", coordinates: [draft.corners] },
    properties: { name: fields.name.value.trim(), enabled: draft.enabled, margin_m: margin },
  };
  try {
    if (draft.mode === "draw") await post("/zones", zone);
    else await request("PUT", `/zones/${encodeURIComponent(draft.id)}`, zone, { "If-Match": `"${draft.version}"` });
    say(`Zone “${zone.properties.name}” is stored and binds the robot${draft.enabled ? "" : " when it is switched on"}.`, { good: true });
    setMode("navigate");
  } catch (error) {
    if (error.body?.error?.code === "outdated") {
      draft.version = error.body.stored_version;
      note("Somebody else changed this zone meanwhile. Finish again to put yours in its place, Cancel to keep the stored one.", true);
    } else note(error.message, true);
    say(error.message);
  }
}

function changed() {
  if (document.activeElement !== fields.corners) fields.corners.value = draft.corners.map(([x, y]) => `${x}, ${y}`).join("\n");
  element("draft-undo").disabled = draft.corners.length === 0;
  draft.preview = [];
  note(draft.corners.length ? `${draft.corners.length} corner${draft.corners.length > 1 ? "s" : ""}` : "no corner yet");
  for (const watcher of watchers) watcher(draft);
  clearTimeout(timer);
  if (draft.corners.length >= 3) timer = setTimeout(preview, PREVIEW_AFTER_MS);
}

// What the path would do if the zone stood. Without a goal there is nothing to say.
async function preview() {
  const corners = draft.corners;
  const shape = JSON.stringify(corners);
  try {
    const answer = await post("/preview", { polygon: corners });
    if (shape !== JSON.stringify(draft.corners)) return;
    draft.preview = answer.path;
    const way = answer.found ? `the path would be ${answer.length_m.toFixed(1)} m` : `there would be no path: ${answer.reason}`;
    note(`${corners.length} corners · ${way}`, !answer.found);
    for (const watcher of watchers) watcher(draft);
  } catch (error) {
    if (shape === JSON.stringify(draft.corners) && error.status === 422) note(error.message, true);
  }
}

function note(text, bad = false) {
  element("draft-note").textContent = text;
  element("draft-note").classList.toggle("bad", bad);
}

export function parseCorners(text) {
  const pairs = text.split(/[;\n]/).map((pair) => pair.trim()).filter(Boolean);
  return pairs.map((pair) => {
    const numbers = pair.split(/[,\s]+/).map(Number);
    if (numbers.length !== 2 || !numbers.every(Number.isFinite)) throw new Error(`“${pair}” is no corner; write x, y in metres, corners apart by ;`);
    return numbers;
  });
}

const rounded = (value) => Math.round(value * 1000) / 1000;

fields.corners.addEventListener("change", () => {
  try {
    draft.corners = parseCorners(fields.corners.value);
    changed();
  } catch (error) { note(error.message, true); }
});
form.addEventListener("submit", (event) => { event.preventDefault(); fields.corners.blur(); finish(); });
element("draft-undo").onclick = undo;
element("draft-cancel").onclick = () => setMode("navigate");
