// The beware list: classes switched on and off, their margins and confidences.

import { post, request } from "../core/api.js";
import { element, make, reconcile, setText, setValue } from "../core/dom.js";
import { attempt } from "../core/toasts.js";
import { swatchOf } from "./swatch.js";

let refresh = () => {};

// `onNewList` loads and shows the list again after a change.
export function build(onNewList) {
  refresh = onNewList;
  for (const action of ["undo", "defaults"]) {
    element(`beware-${action}`).onclick = async () => {
      await attempt(() => post(`/beware/${action}`));
      refresh();
    };
  }
}

export function show(beware) {
  reconcile(
    element("beware"),
    beware.classes,
    (entry) => entry.name,
    itemOf,
    (child, entry) => {
      // A list that was sent before an edit of this row does not undo the edit on the page.
      if (child.isPending) return;
      const [check, margin, confidence] = child.querySelectorAll("input");
      check.checked = entry.enabled;
      setValue(margin, entry.margin_m);
      setValue(confidence, Math.round(100 * entry.min_confidence));
      child.classList.toggle("off", !entry.enabled);
      child.dataset.version = beware.version;
      const [name, foundBy] = child.querySelector(".label").children;
      const isFound = entry.found_by !== "nothing";
      setText(name, entry.label ?? entry.name);
      foundBy.title = isFound
        ? "What detects it in the camera image"
        : "Not detected by this model";
      setText(foundBy, isFound ? entry.found_by : "▲ not detected");
      foundBy.classList.toggle("lost", !isFound);
    },
  );
  setText(element("beware-version"), `version ${beware.version}`);
  element("beware-undo").disabled = !beware.can_undo;
}

function itemOf(entry) {
  const item = make("li", { "data-testid": "beware-class", "data-name": entry.name });
  const patch = async (changes) => {
    const path = `/beware/${encodeURIComponent(entry.name)}`;
    item.isPending = true;
    await attempt(() =>
      request("PATCH", path, changes, { "If-Match": `"${item.dataset.version}"` }),
    );
    item.isPending = false;
    refresh();
  };
  const check = make("input", {
    type: "checkbox",
    title: "Keep away from it",
    "aria-label": `Keep away from ${entry.name}`,
    "data-testid": `beware-${entry.class_id}`,
  });
  check.onchange = () => patch({ enabled: check.checked });
  const margin = make("input", {
    class: "margin",
    type: "number",
    min: 0,
    max: 2,
    step: 0.05,
    title: "Margin kept around it, metres",
    "aria-label": `Margin around ${entry.name} in metres`,
  });
  margin.onchange = () => patch({ margin_m: margin.value === "" ? null : Number(margin.value) });
  const confidence = make("input", {
    class: "margin",
    type: "number",
    min: 0,
    max: 100,
    step: 5,
    title: "Least confidence of a detection, percent",
    "aria-label": `Least confidence for ${entry.name} in percent`,
  });
  confidence.onchange = () =>
    patch({ min_confidence: confidence.value === "" ? null : Number(confidence.value) / 100 });
  const label = make(
    "span",
    { class: "label", title: entry.name },
    make("span"),
    make("small", { "data-testid": "found-by" }),
  );
  item.append(
    check,
    swatchOf(entry),
    label,
    margin,
    make("span", { class: "unit" }, "m"),
    confidence,
    make("span", { class: "unit" }, "%"),
  );
  return item;
}
