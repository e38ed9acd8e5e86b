// The list of zones: switched, renamed, edited, deleted; undo and redo of the edits; saved sets.

import { post, request } from "../core/api.js";
import { element, make, reconcile, setText, setValue } from "../core/dom.js";
import { savedList } from "../core/saved_list.js";
import { attempt, notify } from "../core/toasts.js";
import { setMode } from "./draft.js";

const KEEP_OUT_COLOUR = "#d63384";
const SPEED_LIMIT_COLOUR = "#b7791f";
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
      check.setAttribute("aria-label", `Zone ${name} is in force`);
      setValue(input, name);
      child.classList.toggle("off", !enabled);
      child.dataset.name = name;
      input.setAttribute("aria-label", `Name of zone ${name}`);
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
    `${zones.filter((zone) => zone.properties.enabled).length} of ${zones.length} on`,
  );
  for (const [action, verb] of [
    ["undo", "Undo"],
    ["redo", "Redo"],
  ]) {
    element(`zones-${action}`).disabled = collection[action] === null;
    element(`zones-${action}`).title = collection[action]
      ? `${verb}: ${collection[action]}`
      : `Nothing to ${action}`;
  }
}

// Speed limit, margin and end of a zone in words.
function termsOf({ kind, max_speed_mps: limit, margin_m: margin, expires_at_s: end }) {
  const time =
    end === null
      ? ""
      : new Date(end * 1000).toLocaleTimeString([], {
          hour: "2-digit",
          minute: "2-digit",
          hour12: false,
        });
  const parts = [
    kind === "speed-limit" ? `at most ${limit} m/s` : "",
    kind === "stay-inside" ? "stay inside" : "",
    margin ? `margin ${margin} m` : "",
    time ? `until ${time}` : "",
  ];
  return parts.filter(Boolean).join(" · ");
}

const versionOf = (zone) => ({ "If-Match": `"${zone.properties.version}"` });

async function putZone(zone, changes) {
  const { geometry, properties } = zone;
  const feature = { type: "Feature", geometry, properties: { ...properties, ...changes } };
  await attempt(() => request("PUT", addressOf(zone), feature, versionOf(zone)));
}

export async function switchZone(zone, enabled) {
  await putZone(zone, { enabled });
  refresh();
}

export async function removeZone(zone) {
  await attempt(async () => {
    await request("DELETE", addressOf(zone), undefined, versionOf(zone));
    notify(`Zone “${zone.properties.name}” is deleted.`, {
      good: true,
      action: { label: "Undo", run: () => step("undo") },
    });
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
    title: "In force",
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
        title: "Edit outline and rule",
        "data-testid": "zone-edit",
        onclick: () => setMode("edit", zone()),
      },
      "Edit",
    ),
    make(
      "button",
      {
        title: "Delete",
        "aria-label": `Delete zone ${first.properties.name}`,
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
  verb: "Use",
  placeholder: "Name for these zones",
  nothing: "Nothing is saved yet. Draw zones, then save them here as a set.",
  describe: (entry) => `${entry.zones} zone${entry.zones === 1 ? "" : "s"}`,
  onLoaded: () => refresh(),
});
