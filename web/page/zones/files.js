// Zones read from and written to files: GeoJSON, and keep-out masks of Nav2.

import { abortableFetch, FILE_S, post, refusalOf } from "../core/link/api.js";
import { download, element } from "../core/dom.js";
import { t } from "../core/text/language.js";
import { ask, attempt, notify } from "../core/toasts.js";

let refresh = () => {};

// `onNewZones` loads and shows the zones again after an import.
export function build(onNewZones) {
  refresh = onNewZones;
}

async function importFiles(files) {
  const find = (pattern) => files.find((file) => pattern.test(file.name));
  const [plan, yaml, image] = [find(/\.(geo)?json$/i), find(/\.ya?ml$/i), find(/\.(pgm|png)$/i)];
  if (plan) await send("/zones/import", parsed(await plan.text(), plan.name));
  else if (yaml && image)
    await send("/zones/import-mask", {
      yaml: await yaml.text(),
      picture: await base64(image),
      name: yaml.name.replace(/\.ya?ml$/i, ""),
    });
  else
    throw new Error(t("choose one GeoJSON file, or the YAML and the image of a Nav2 mask together"));
}

// Zones of the file that are there already are the operator's choice.
async function send(path, body, existing = "ask") {
  try {
    await post(`${path}?existing=${existing}`, body, FILE_S);
  } catch (error) {
    if (!error.body?.there) throw error;
    const choose = (label, value) => ({ label, run: () => attempt(() => send(path, body, value)) });
    ask(`${error.message}.`, [
      choose(t("Replace"), "replace"),
      choose(t("Keep both"), "keep"),
      choose(t("Skip"), "skip"),
    ]);
    return;
  }
  notify(t("The zones of the file are in force."), { good: true });
  refresh();
}

async function base64(file) {
  const bytes = new Uint8Array(await file.arrayBuffer());
  return btoa(Array.from(bytes, (byte) => String.fromCharCode(byte)).join(""));
}

function parsed(text, name) {
  try {
    return JSON.parse(text);
  } catch {
    throw new Error(t("{name} is not readable as JSON", { name }));
  }
}

async function fetched(route) {
  const response = await abortableFetch(`/api/v1/${route}`, {}, FILE_S);
  if (!response.ok) throw await refusalOf(response);
  return { bytes: await response.arrayBuffer(), grid: response.headers.get("Grid") };
}

// Both files of the mask on one grid; where the map grows in between both are asked for again.
async function mask(tries = 3) {
  const yaml = await fetched("zones.yaml");
  try {
    return [yaml, await fetched(`zones.pgm?grid=${encodeURIComponent(yaml.grid)}`)];
  } catch (error) {
    if (error.code !== "outdated" || tries === 1) throw error;
    return mask(tries - 1);
  }
}

const save = ({ bytes }, name, type) => download(name, new Blob([bytes], { type }));

element("zones-file").onchange = (event) =>
  attempt(async () => {
    const files = [...event.target.files];
    event.target.value = "";
    await importFiles(files);
  });
element("zones-geojson").onclick = () =>
  attempt(async () => save(await fetched("zones"), "zones.geojson", "application/geo+json"));
element("zones-mask").onclick = () =>
  attempt(async () => {
    const [yaml, image] = await mask();
    save(yaml, "zones.yaml", "application/yaml");
    save(image, "zones.pgm", "image/x-portable-graymap");
  });
