// The form beside the drawing: every value of a zone as text and numbers, so that nothing needs the pointer.

import { element } from "../core/dom.js";
import { distance, rounded } from "../core/geometry.js";

const form = element("draft");
const field = (name) => element(`draft-${name}`);
const UNITS = { polygon: "corner", free: "corner", circle: "point", corridor: "point" };
let stored = null;

export function showForm(draft, zone, name) {
  stored = zone?.properties ?? null;
  form.hidden = false;
  element("draft-title").textContent = zone ? "Edit zone" : "New zone";
  field("name").value = stored?.name ?? name;
  field("margin").value = stored?.margin_m ?? 0;
  field("kind").value = stored?.kind ?? "keep-out";
  field("limit").value = stored?.max_speed_mps ?? 0.3;
  field("colour").value = stored?.colour ?? "#d63384";
  field("colour").dataset.own = String(Boolean(stored?.colour));
  field("expiry").value = stored?.expires_at_s ? "keep" : "";
  field("expiry").querySelector("[value=keep]").hidden = !stored?.expires_at_s;
  field("tool").value = draft.tool;
  field("tool").disabled = Boolean(zone);
  showKind();
}

export function clearForm() {
  form.hidden = true;
  form.reset();
  stored = null;
}

export function showKind() {
  element("draft-limit-field").hidden = field("kind").value !== "speed-limit";
}

export function readForm() {
  const slow = field("kind").value === "speed-limit";
  const expiry = field("expiry").value;
  return {
    name: field("name").value.trim(),
    enabled: stored?.enabled ?? true,
    margin_m: Number(field("margin").value),
    kind: field("kind").value,
    max_speed_mps: slow ? Number(field("limit").value) : null,
    colour: field("colour").dataset.own === "true" ? field("colour").value : null,
    expires_at_s: expiry === "keep" ? stored?.expires_at_s ?? null : null,
    expires_in_s: Number(expiry) > 0 ? Number(expiry) : null,
  };
}

// Numbers follow the drawing, except where the operator is typing.
export function describe(draft, answer = null) {
  const { corners, tool } = draft;
  fill("corners", (tool === "circle" ? corners.slice(0, 1) : corners).map(([x, y]) => `${x}, ${y}`).join("\n"));
  fill("size", tool === "circle" ? rounded(corners.length > 1 ? distance(...corners) : 0) : draft.width);
  element("draft-size-field").hidden = tool !== "circle" && tool !== "corridor";
  element("draft-size-name").textContent = tool === "circle" ? "Radius, m" : "Width, m";
  element("draft-tool").value = tool;
  const count = corners.length ? `${corners.length} ${UNITS[tool]}${corners.length > 1 ? "s" : ""}` : "nothing drawn yet";
  note(answer ? `${count} · ${answer.text}` : count, answer?.bad ?? false);
}

function fill(name, value) { if (document.activeElement !== field(name)) field(name).value = value; }

export function note(text, bad = false) {
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
