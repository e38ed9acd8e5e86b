// The list of zones: switched, renamed, edited, deleted; undo and redo of the edits; saved sets.

import { edit, post } from "../core/link/api.js";
import { element, make, reconcile, setText, setValue } from "../core/dom.js";
import { formatShortMoment } from "../core/text/format.js";
import { decimal, sentence, t, tn } from "../core/text/language.js";
import { savedList } from "../core/saved_list.js";
import { attempt } from "../core/toasts.js";
import { offerUndo } from "../core/undo.js";
import { setMode } from "./draft.js";

const KEEP_OUT_COLOUR = "#d63384";
const SPEED_LIMIT_COLOUR = "#b7791f";
const STEPS = [
  ["undo", t("Undo"), t("Nothing to undo")],
  ["redo", t("Redo"), t("Nothing to redo")],
];
let refresh = () => {};

// `onNewZones` loads and shows the zones again after a change.
export function build(onNewZones) {
  refresh = onNewZones;
}

const isSpeedLimit = (zone) => zone.properties.kind === "speed-limit";
export const colourOf = (zone) =>
  zone.properties.colour ?? (isSpeedLimit(zone) ? SPEED_LIMIT_COLOUR : KEEP_OUT_COLOUR);
const addressOf = (zone) => `/zones/${encodeURIComponent(zone.id)}`;

export function show(collection) {
  const zones = collection.features;
  reconcile(
    element("zones"),
    zones,
    (zone) => zone.id,
    itemOf,
    (child, zone) => {
      // Zones that were sent before an edit of this row do not undo the edit on the page.
      if (child.isPending) return;
      const { name, enabled } = zone.properties;
      const [check, input] = child.querySelectorAll("input");
      check.checked = enabled;
      check.setAttribute("aria-label", t("Zone {name} is in force", { name }));
      setValue(input, name);
      child.classList.toggle("off", !enabled);
      child.dataset.name = name;
      input.setAttribute("aria-label", t("Name of zone {name}", { name }));
      setText(child.querySelector(".terms"), termsOf(zone.properties));
      child.querySelector(".swatch").style.setProperty("--c", colourOf(zone));
      child.querySelector(".swatch").dataset.pattern = isSpeedLimit(zone)
        ? "dots"
        : "stripes falling";
    },
  );
  element("no-zones").hidden = zones.length > 0;
  setText(
    element("zone-count"),
    t("{on} of {all} on", {
      on: zones.filter((zone) => zone.properties.enabled).length,
      all: zones.length,
    }),
  );
  for (const [action, does, nothing] of STEPS) {
    element(`zones-${action}`).disabled = collection[action] === null;
    element(`zones-${action}`).title = collection[action]
      ? `${does}: ${sentence(collection[action])}`
      : nothing;
  }
}

// Speed limit, margin and end of a zone in words.
function termsOf({ kind, max_speed_mps: limit, margin_m: margin, expires_at_s: end }) {
  const parts = [
    kind === "speed-limit" ? t("at most {limit} m/s", { limit: decimal(limit) }) : "",
    kind === "stay-inside" ? t("stay inside") : "",
    margin ? t("margin {margin} m", { margin: decimal(margin) }) : "",
    end === null ? "" : t("until {time}", { time: formatShortMoment(end) }),
  ];
  return parts.filter(Boolean).join(" · ");
}

const versionOf = (zone) => ({ "If-Match": `"${zone.properties.version}"` });

// Returns the answer to the edit, or undefined when the console has refused.
function putZone(zone, changes) {
  const { geometry, properties } = zone;
  const feature = { type: "Feature", geometry, properties: { ...properties, ...changes } };
  return attempt(() => edit("PUT", addressOf(zone), feature, versionOf(zone)));
}

export async function switchZone(zone, enabled) {
  const made = await putZone(zone, { enabled });
  refresh();
  return made;
}

export async function removeZone(zone) {
  await attempt(async () => {
    const made = await edit("DELETE", addressOf(zone), undefined, versionOf(zone));
    offerUndo(t("Zone “{name}” is deleted.", zone.properties), made);
  });
  refresh();
}

function itemOf(first) {
  const item = make("li", { "data-testid": "zone" });
  const zone = () => item.item;
  const put = async (changes) => {
    item.isPending = true;
    await putZone(zone(), changes);
    item.isPending = false;
    refresh();
  };
  const check = make("input", {
    type: "checkbox",
    title: t("In force"),
    "data-testid": "zone-enabled",
    onchange: () => put({ enabled: check.checked }),
  });
  const name = make("input", {
    class: "name",
    maxlength: 80,
    "data-testid": "zone-rename",
    onchange: () => put({ name: name.value.trim() }),
  });
  item.append(
    check,
    make("span", { class: "swatch" }),
    name,
    make(
      "button",
      {
        title: t("Edit outline and rule"),
        "data-testid": "zone-edit",
        onclick: () => setMode("edit", zone()),
      },
      t("Edit"),
    ),
    make(
      "button",
      {
        title: t("Delete"),
        "aria-label": t("Delete zone {name}", first.properties),
        "data-testid": "zone-delete",
        onclick: () => removeZone(zone()),
      },
      "✕",
    ),
    make("span", { class: "terms unit" }),
  );
  return item;
}

// `action`: "undo" or "redo".
export async function step(action) {
  await attempt(() => post(`/zones/${action}`));
  refresh();
}

element("zones-undo").onclick = () => step("undo");
element("zones-redo").onclick = () => step("redo");
savedList(element("zone-sets"), {
  path: "/zone-sets",
  action: "use",
  verb: t("Use"),
  placeholder: t("Name for these zones"),
  nothing: t("Nothing is saved yet. Draw zones, then save them here as a set."),
  describe: (entry) => tn("{n} zone", "{n} zones", entry.zones),
  onLoaded: () => refresh(),
});
