// The form of a draft: every value of a zone as text and numbers, so that nothing needs the pointer.

import { element, set } from "../core/dom.js";
import { distance, rounded } from "../core/geometry.js";
import { number, t, tn, typedNumbers } from "../core/text/language.js";

const form = element("draft");
export const field = (name) => element(`draft-${name}`);
const hasCorners = (tool) => tool === "polygon" || tool === "free";
const FEWEST = { polygon: 3, free: 3, circle: 2, corridor: 2 };
const MIN_RADIUS_M = 0.02;
const DEFAULT_LIMIT_MPS = 0.3;
const DEFAULT_COLOUR = "#d63384";
let stored = null;

export function showForm(draft, zone, name) {
  stored = zone?.properties ?? null;
  form.hidden = false;
  element("draft-title").textContent = zone ? t("Edit zone") : t("New zone");
  field("name").value = stored?.name ?? name;
  field("margin").value = stored?.margin_m ?? 0;
  field("kind").value = stored?.kind ?? "keep-out";
  field("limit").value = stored?.max_speed_mps ?? DEFAULT_LIMIT_MPS;
  field("colour").value = stored?.colour ?? DEFAULT_COLOUR;
  field("colour").dataset.own = String(Boolean(stored?.colour));
  field("expiry").value = stored?.expires_at_s ? "keep" : "";
  field("expiry").querySelector("[value=keep]").hidden = !stored?.expires_at_s;
  field("tool").value = draft.tool;
  field("tool").disabled = Boolean(zone);
  showKind();
}

export function clearForm() {
  // A hidden field has no focus: the keyboard goes on at the map, not at the top of the page.
  if (form.contains(document.activeElement)) element("map-canvas").focus();
  form.hidden = true;
  form.reset();
  stored = null;
}

export function showKind() {
  const isLimit = field("kind").value === "speed-limit";
  element("draft-limit-field").hidden = !isLimit;
  field("limit").disabled = !isLimit; // what is hidden keeps nothing from being finished
}

// The properties of the zone as the API takes them.
export function readForm() {
  const isLimit = field("kind").value === "speed-limit";
  const expiry = field("expiry").value;
  return {
    name: field("name").value.trim(),
    enabled: stored?.enabled ?? true,
    margin_m: Number(field("margin").value),
    kind: field("kind").value,
    max_speed_mps: isLimit ? Number(field("limit").value) : null,
    colour: field("colour").dataset.own === "true" ? field("colour").value : null,
    expires_at_s: expiry === "keep" ? (stored?.expires_at_s ?? null) : null,
    expires_in_s: Number(expiry) > 0 ? Number(expiry) : null,
  };
}

// Show the drawing in numbers, except in the field that has the focus.
export function describe(draft, preview = null) {
  const { corners, tool } = draft;
  const missing = missingOf(draft);
  set(field("finish"), { disabled: missing !== "", title: missing || t("Enter or double-click") });
  field("erase").disabled = missing !== "";
  const isCircle = tool === "circle";
  fill(
    "corners",
    (isCircle ? corners.slice(0, 1) : corners).map(([x, y]) => `${x}, ${y}`).join("\n"),
  );
  fill("size", isCircle ? rounded(corners.length > 1 ? distance(...corners) : 0) : draft.width);
  element("draft-size-field").hidden = !isCircle && tool !== "corridor";
  element("draft-size-name").textContent = isCircle ? t("Radius, m") : t("Width, m");
  field("tool").value = tool;
  const count = corners.length
    ? hasCorners(tool)
      ? tn("{n} corner", "{n} corners", corners.length)
      : tn("{n} point", "{n} points", corners.length)
    : t("nothing drawn yet");
  const more = preview?.text ?? missing;
  note(more ? `${count} · ${more}` : count, preview?.bad ?? false);
}

// What the shape lacks, or "".
export function missingOf({ corners, tool }) {
  const lacking = FEWEST[tool] - corners.length;
  if (lacking > 0)
    return hasCorners(tool)
      ? tn("{n} more corner needed", "{n} more corners needed", lacking)
      : tn("{n} more point needed", "{n} more points needed", lacking);
  if (tool === "circle" && distance(...corners) < MIN_RADIUS_M)
    return t("a circle has a radius of at least {radius} m", { radius: number(MIN_RADIUS_M, 2) });
  return "";
}

function fill(name, value) {
  if (document.activeElement !== field(name)) field(name).value = value;
}

export function note(text, bad = false) {
  field("note").textContent = text;
  field("note").classList.toggle("bad", bad);
}

// Whether all that is typed can be read; the field that cannot be has the focus and says so.
export function isReadable() {
  try {
    typedCorners();
  } catch (error) {
    field("corners").focus();
    note(error.message, true);
    return false;
  }
  return form.reportValidity();
}

export function typedCorners() {
  const pairs = field("corners")
    .value
    .split(/[;\n]/)
    .map((pair) => pair.trim())
    .filter(Boolean);
  return pairs.map((pair) => {
    const numbers = typedNumbers(pair);
    if (numbers.length !== 2 || !numbers.every(Number.isFinite))
      throw new Error(
        t("“{pair}” is no corner; write x, y in metres, with ; between corners", { pair }),
      );
    return numbers;
  });
}
