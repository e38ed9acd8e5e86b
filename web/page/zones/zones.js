// The table of zones: what holds where, switched, edited, taken back; sets of them; files in and out.

import { fetched, post, request } from "../core/api.js";
import { download, element, make, reconcile, setText, setValue } from "../core/dom.js";
import { setMode } from "./draft.js";
import { shelf } from "../core/saved_list.js";
import { attempt, say } from "../core/toasts.js";

let refetch = () => {};
const address = (zone) => `/zones/${encodeURIComponent(zone.id)}`;
export const colourOf = (zone) => zone.properties.colour ?? (zone.properties.kind === "speed-limit" ? "#b7791f" : "#d63384");

export function showZones(collection, again) {
  refetch = again;
  const zones = collection.features;
  reconcile(element("zones"), zones, (zone) => zone.id, zoneItem, (child, zone) => {
    const { name, enabled } = zone.properties;
    const [check, input] = child.querySelectorAll("input");
    check.checked = enabled;
    check.setAttribute("aria-label", `Zone ${name} binds the robot`);
    setValue(input, name);
    child.classList.toggle("off", !enabled);
    child.dataset.name = name;
    setText(child.querySelector(".rules"), rules(zone.properties));
    child.querySelector(".swatch").style.setProperty("--c", colourOf(zone));
    child.querySelector(".swatch").dataset.pattern = zone.properties.kind === "speed-limit" ? "dots" : "stripes falling";
  });
  element("no-zones").hidden = zones.length > 0;
  setText(element("zone-count"), `${zones.filter((zone) => zone.properties.enabled).length} of ${zones.length} on`);
  for (const way of ["undo", "redo"]) {
    element(`zones-${way}`).disabled = collection[way] === null;
    element(`zones-${way}`).title = collection[way] ? `${way === "undo" ? "Take back" : "Do again"}: ${collection[way]}` : `Nothing to ${way}`;
  }
}

function rules(p) {
  const until = p.expires_at_s === null ? "" : ` until ${new Date(p.expires_at_s * 1000).toLocaleTimeString([], { hour: "2-digit", minute: "2-digit" })}`;
  return `${p.kind === "speed-limit" ? `≤ ${p.max_speed_mps} m/s` : ""}${p.margin_m ? ` +${p.margin_m} m` : ""}${until}`.trim();
}

function zoneItem(first) {
  const item = make("li", { "data-testid": "zone" });
  const zone = () => item.item;
  const guarded = () => ({ "If-Match": `"${zone().properties.version}"` });
  const put = async (changes) => {
    const { geometry, properties } = zone();
    await attempt(() => request("PUT", address(zone()), { type: "Feature", geometry, properties: { ...properties, ...changes } }, guarded()));
    refetch();
  };
  const remove = async () => { await attempt(() => request("DELETE", address(zone()), undefined, guarded())); refetch(); };
  const check = make("input", { type: "checkbox", title: "Binds the robot", "data-testid": "zone-enabled", onchange: () => put({ enabled: check.checked }) });
  const name = make("input", { class: "name", maxlength: 80, "aria-label": "Name of the zone", "data-testid": "zone-rename", onchange: () => put({ name: name.value.trim() }) });
  item.append(
    check, make("span", { class: "swatch" }), name, make("span", { class: "rules unit" }),
    make("button", { title: "Edit outline and rules", "data-testid": "zone-edit", onclick: () => setMode("edit", zone()) }, "Edit"),
    make("button", { title: "Delete", "aria-label": `Delete zone ${first.properties.name}`, "data-testid": "zone-delete", onclick: remove }, "✕"),
  );
  return item;
}

export async function travel(way) {
  await attempt(() => post(`/zones/${way}`));
  refetch();
}

// Files

const READ = { text: (file) => file.text(), base64: async (file) => btoa(Array.from(new Uint8Array(await file.arrayBuffer()), (byte) => String.fromCharCode(byte)).join("")) };

async function bring(files) {
  const [plan] = files.filter((file) => /\.(geo)?json$/i.test(file.name));
  const [yaml] = files.filter((file) => /\.ya?ml$/i.test(file.name));
  const [picture] = files.filter((file) => /\.(pgm|png)$/i.test(file.name));
  if (plan) await post("/zones/import", parsed(await READ.text(plan), plan.name));
  else if (yaml && picture) await post("/zones/import-mask", { yaml: await READ.text(yaml), picture: await READ.base64(picture), name: yaml.name.replace(/\.ya?ml$/i, "") });
  else throw new Error("choose one GeoJSON file, or the YAML and the picture of a Nav2 mask together");
  say("The zones of the file are stored and bind the robot.", { good: true });
  refetch();
}

function parsed(text, name) {
  try { return JSON.parse(text); } catch { throw new Error(`${name} is not readable as JSON`); }
}

async function give(name, type) {
  const response = await fetched(`/api/v1/${name}`);
  if (!response.ok) throw new Error("the console did not give the file");
  download(name === "zones" ? "zones.geojson" : name, new Blob([await response.arrayBuffer()], { type }));
}

element("zones-undo").onclick = () => travel("undo");
element("zones-redo").onclick = () => travel("redo");
element("zones-file").onchange = (event) => attempt(async () => { const files = [...event.target.files]; event.target.value = ""; await bring(files); });
element("zones-geojson").onclick = () => attempt(() => give("zones", "application/geo+json"));
element("zones-mask").onclick = () => attempt(async () => { await give("zones.yaml", "application/yaml"); await give("zones.pgm", "image/x-portable-graymap"); });
shelf(element("zone-sets"), { path: "/zone-sets", take: "use", verb: "Use", placeholder: "Name for these zones", words: (entry) => `${entry.zones} zone${entry.zones === 1 ? "" : "s"}`, taken: () => refetch() });
