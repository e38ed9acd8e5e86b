// The layers of the map: each has a switch and a slider, remembered by this browser.

import { classTitle } from "../beware/class_title.js";
import { signOf } from "../beware/legend.js";
import { swatchOf } from "../beware/swatch.js";
import { element, loadSetting, make, reconcile, saveSetting, set, setText } from "../core/dom.js";
import { t } from "../core/text/language.js";
import { onTheme } from "../core/theme.js";
import { pen } from "./drawing/strokes.js";

const KEY = "console.layers";
const FIXED = [
  ["unknown", t("not seen")],
  ["free", t("floor, seen")],
  ["obstacle", t("obstacles")],
  ["inflation", t("too close")],
  ["prior", t("prior map")],
  ["zones", t("zones")],
  ["path", t("planned path")],
  ["waypoints", t("waypoints")],
  ["driven", t("driven path")],
  ["people", t("people, predicted")],
  ["view", t("camera view")],
  ["motion", t("commanded motion")],
  ["candidates", t("candidate motions")],
];
// Off until the operator wants it: the robot computes it on request.
const OFF = new Set(["candidates"]);
const settings = loadSetting(KEY, {});
const listeners = [];
let shownClasses = [];

export const onLayers = (listener) => listeners.push(listener);

const settingOf = (layer) => ({ on: !OFF.has(layer), fade: 1, ...settings[layer] });

// The layer of a class. At another site its number is that of another class.
export const layerOf = ({ name }) => `class-${name}`;

// Opacity of a layer, 0 to 1; 0 where it is off.
export function strength(layer) {
  const { on, fade } = settingOf(layer);
  return on ? fade : 0;
}

export function drawLayer(name, draw) {
  const opacity = strength(name);
  if (opacity === 0) return;
  pen.globalAlpha = opacity;
  draw();
  pen.globalAlpha = 1;
}

export function showLayers(classes = shownClasses) {
  shownClasses = classes;
  const layers = [
    ...FIXED,
    ...classes.map((entry) => [layerOf(entry), classTitle(entry), entry]),
  ];
  reconcile(
    element("map-layers"),
    layers,
    ([id]) => id,
    itemOf,
    (item, [id, text, entry]) => {
      item.querySelector(".swatch").replaceWith(entry ? swatchOf(entry) : signOf(id));
      setText(item.querySelector("label").lastChild, text);
      set(item.lastChild, { ariaLabel: t("Opacity of {text}", { text }) });
    },
  );
}

function itemOf([id]) {
  const { on, fade } = settingOf(id);
  const check = make("input", { type: "checkbox", "data-testid": `layer-${id}`, onchange: save });
  const slider = make("input", {
    type: "range",
    min: 0.1,
    max: 1,
    step: 0.1,
    title: t("Opacity"),
    oninput: save,
  });
  [check.checked, slider.value] = [on, fade];
  function save() {
    settings[id] = { on: check.checked, fade: Number(slider.value) };
    saveSetting(KEY, settings);
    for (const listener of listeners) listener();
  }
  return make("li", {}, make("label", {}, check, make("span", { class: "swatch" }), make("span")), slider);
}

onTheme(() => showLayers());
