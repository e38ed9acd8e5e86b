// The beware list: classes switched on and off, their margins and confidences.

import { post, request } from "../core/link/api.js";
import { element, make, reconcile, set, setText, setValue } from "../core/dom.js";
import { capitalised, decimal, sentence, t } from "../core/text/language.js";
import { attempt } from "../core/toasts.js";
import { classTitle } from "./class_title.js";
import { kindOf } from "./colour_picker.js";
import * as entryForm from "./entry.js";
import { point } from "./example.js";
import * as files from "./files.js";
import { handleOf } from "./order.js";
import { cancel, propose, renew } from "./proposal.js";
import { swatchOf } from "./swatch.js";
import * as versions from "./versions.js";

let refresh = () => {};
let limits = {};
let version = null;
// Edits of the rows that are not applied yet, and those being applied: name → changed fields.
let drafted = {};
let sent = {};

// `onNewList` loads and shows the list again after a change.
export function build(onNewList) {
  refresh = onNewList;
  for (const part of [entryForm, files, versions]) part.build(onNewList);
  const call = async (action) => {
    await post(`/beware/${action}`);
    refresh();
  };
  for (const action of ["undo", "redo"])
    element(`beware-${action}`).onclick = () => attempt(() => call(action));
  element("beware-ready-made").onclick = ({ target, currentTarget }) => {
    const name = target.dataset.list;
    if (!name) return;
    currentTarget.hidePopover();
    const send = () => call(`defaults?name=${name}`);
    propose({ question: { ready_made: name }, send, host: element("beware-tools") });
  };
  element("beware-add").onclick = () => entryForm.open(null, null, limits);
  element("beware-this").onclick = () => {
    entryForm.open(null, null, limits);
    point();
  };
}

export function show(beware) {
  const isNew = version !== beware.version;
  ({ limits, version } = beware);
  set(element("beware-add"), { disabled: false });
  set(element("beware-this"), { disabled: beware.no_examples !== null });
  set(element("beware-this-note"), { hidden: beware.no_examples === null });
  setText(element("beware-this-note"), capitalised(sentence(beware.no_examples ?? "")));
  reconcile(
    element("beware"),
    beware.classes,
    (entry) => entry.name,
    itemOf,
    (child, entry) => {
      // A list that was sent before an edit of this row does not undo the edit on the page.
      if (entry.name in drafted || entry.name in sent) return;
      child.classList.remove("drafted");
      if (child.classList.contains("dragged")) return;
      const [check, margin, confidence] = child.querySelectorAll("input");
      check.checked = entry.enabled;
      set(margin, { min: String(limits.margin_m.low), max: String(limits.margin_m.high) });
      set(confidence, {
        min: String(100 * limits.min_confidence.low),
        max: String(100 * limits.min_confidence.high),
      });
      setValue(margin, entry.margin_m);
      setValue(confidence, percentOf(entry));
      child.classList.toggle("off", !entry.enabled);
      const [name, foundBy] = child.querySelector(".label").children;
      const isFound = entry.found_by !== "nothing";
      setText(name, classTitle(entry));
      foundBy.title = isFound
        ? t("What detects it in the camera image")
        : entry.prototype
          ? t("It was shown to another network. Click the thing again.")
          : t("Not detected by this model");
      const eyes =
        entry.found_by === "colour rule" ? kindOf(entry.colour) : sentence(entry.found_by);
      setText(foundBy, isFound ? eyes : t("▲ not detected"));
      foundBy.classList.toggle("lost", !isFound);
    },
  );
  setText(element("beware-version"), t("version {version}", beware));
  element("beware-undo").disabled = !beware.can_undo;
  element("beware-redo").disabled = !beware.can_redo;
  if (isNew) renew();
}

const percentOf = (entry) => Math.round(100 * entry.min_confidence);

// Draft changed fields of a row, together with those of other rows; a field as it is stored is no
// change.
function draft(row, changes) {
  const entry = row.item;
  const fields = Object.entries({ ...drafted[entry.name], ...changes }).filter(
    ([key, value]) => value !== entry[key],
  );
  delete drafted[entry.name];
  if (fields.length) drafted[entry.name] = Object.fromEntries(fields);
  row.classList.toggle("drafted", fields.length > 0);
  if (!Object.keys(drafted).length) cancel();
  else propose({ question: { changes: drafted }, send: sendRows, withdraw: withdrawRows, host: row });
}

async function sendRows() {
  [sent, drafted] = [drafted, {}];
  let at = version;
  try {
    for (const [name, fields] of Object.entries(sent)) {
      const path = `/beware/${encodeURIComponent(name)}`;
      ({ version: at } = await request("PATCH", path, fields, { "If-Match": `"${at}"` }));
    }
  } catch (error) {
    restore(sent);
    throw error;
  } finally {
    sent = {};
    refresh();
  }
}

function withdrawRows() {
  const withdrawn = drafted;
  drafted = {};
  restore(withdrawn);
}

// Have rows show what is in force again, also in a field that has the focus.
function restore(edits) {
  for (const row of element("beware").children) if (row.dataset.name in edits) row.restore();
}

function itemOf(entry) {
  const item = make("li", { "data-testid": "beware-class", "data-name": entry.name });
  const check = make("input", {
    type: "checkbox",
    title: t("Keep away from it"),
    "aria-label": t("Keep away from {name}", entry),
    "data-testid": `beware-${entry.class_id}`,
  });
  check.onchange = () => draft(item, { enabled: check.checked });
  const refused = make("small", { class: "refused", role: "alert", hidden: "" });
  const margin = numberInput(t("Margin around {name} in metres", entry), 0.05);
  const confidence = numberInput(t("Least confidence for {name} in percent", entry), 5);
  item.restore = () => {
    const fields = { ...item.item, ...drafted[entry.name] };
    check.checked = fields.enabled;
    margin.value = fields.margin_m;
    confidence.value = percentOf(fields);
    item.classList.toggle("drafted", entry.name in drafted);
  };
  // A figure that is refused gives way to the stored one, so that the field shows what is in force.
  const send = (input, key, scale, unit) => {
    const { low, high } = limits[key] ?? { low: 0, high: 0 };
    const value = input.value === "" ? NaN : Number(input.value) / scale;
    const fits = value >= low && value <= high;
    set(refused, { hidden: fits });
    input.setAttribute("aria-invalid", String(!fits));
    draft(item, { [key]: fits ? value : item.item[key] });
    if (fits) return;
    item.restore();
    const range = { name: input.title, low: decimal(scale * low), high: decimal(scale * high), unit };
    setText(refused, t("{name}: {low} to {high} {unit}.", range));
  };
  margin.onchange = () => send(margin, "margin_m", 1, "m");
  confidence.onchange = () => send(confidence, "min_confidence", 100, "%");
  const label = make(
    "button",
    {
      class: "label",
      type: "button",
      title: t("Edit {name}", entry),
      "data-testid": "beware-edit",
      onclick: () => entryForm.open(item.item, version, limits),
    },
    make("span"),
    make("small", { "data-testid": "found-by" }),
  );
  const storeOrder = async () => {
    const names = [...element("beware").children].map((row) => row.dataset.name);
    await attempt(() => request("PUT", "/beware/order", { names }));
    refresh();
  };
  item.append(
    handleOf(item, entry.name, storeOrder),
    check,
    swatchOf(entry),
    label,
    // Filled in by the detections; it has its place in the row from the beginning.
    make("span", { class: "seen", "data-testid": "seen-count", title: t("Objects detected so far") }),
    margin,
    make("span", { class: "unit" }, "m"),
    confidence,
    make("span", { class: "unit" }, "%"),
    refused,
  );
  return item;
}

function numberInput(title, step) {
  return make("input", { class: "margin", type: "number", step, title, "aria-label": title });
}
