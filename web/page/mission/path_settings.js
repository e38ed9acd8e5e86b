// The settings of the path: what a metre of floor that was not seen yet costs. The map shows the
// path that a new value would give, before it is applied.

import { edit, get } from "../core/link/api.js";
import { element, set, setText } from "../core/dom.js";
import { decimal, t } from "../core/text/language.js";
import { attempt } from "../core/toasts.js";
import { offerUndo } from "../core/undo.js";
import { asker, readPreview } from "../zones/preview.js";

const button = document.querySelector("[popovertarget=path-menu]");
const menu = element("path-menu");
const slider = element("path-price");
// What the map shows of the value that is tried.
export const pathDraft = { path: [] };
const listeners = [];
export const onPathDraft = (listener) => listeners.push(listener);
const ask = asker("/preview", readPreview);
let inForce = 1;

export function showPathSettings({ unknown_price: price }) {
  if (price === inForce) return;
  inForce = price;
  setText(button, price === 1 ? t("Path ▾") : t("Path × {price} ▾", { price: decimal(price) }));
  if (menu.matches(":popover-open")) describe();
}

function meaning(price) {
  if (price === 1) return t("Floor that was not seen yet costs no more than seen floor.");
  return t("1 m of floor that was not seen yet counts as {n} m of seen floor.", { n: decimal(price) });
}

function describe() {
  const price = Number(slider.value);
  setText(element("path-price-shown"), `× ${decimal(price)}`);
  setText(element("path-note"), meaning(price));
  set(element("path-apply"), { disabled: price === inForce });
  show({ text: "", path: [] });
  ask(price === inForce ? null : { unknown_price: price }, show);
}

function show({ text, path, bad = false }) {
  setText(element("path-effect"), text);
  element("path-effect").classList.toggle("bad", bad);
  pathDraft.path = path;
  for (const listener of listeners) listener();
}

menu.addEventListener("toggle", (event) => {
  if (event.newState === "closed") {
    set(slider, { disabled: true }); // what is set before the value in force is known would be lost
    ask(null);
    show({ text: "", path: [] });
    return;
  }
  attempt(async () => {
    const { unknown_price: price, limits } = await get("/path/settings");
    const { low: min, high: max } = limits.unknown_price;
    set(slider, { min, max, disabled: false });
    slider.value = inForce = price;
    describe();
  });
});
slider.addEventListener("input", describe);
element("path-apply").onclick = () =>
  attempt(async () => {
    const price = Number(slider.value);
    const made = await edit("PUT", "/path/settings", { unknown_price: price });
    menu.hidePopover();
    offerUndo(meaning(price), made);
  });
