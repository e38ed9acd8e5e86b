// Which layers of the map are shown, and how strongly: each with a switch and a slider, remembered by this browser.

import { element, make, reconcile, remember, remembered } from "../core/dom.js";

const KEY = "console.layers";
const FIXED = [
  ["unknown", "not seen"], ["free", "floor, seen"], ["obstacle", "obstacles"], ["inflation", "too close"], ["prior", "prior map"],
  ["zones", "zones"], ["path", "planned path"], ["waypoints", "waypoints"], ["driven", "driven way"], ["people", "people, where they go"],
  ["view", "what the camera sees"], ["motion", "where it steers"],
  ["candidates", "motions to choose from"],
];
// What costs the robot something to work out is off until somebody wants to see it.
const OFF = new Set(["candidates"]);
const settings = remembered(KEY, {});
const watchers = [];

export const onLayers = (watcher) => watchers.push(watcher);
// 0 where a layer is off, else how strong it is, to 1.
export function strength(layer) {
  const { on, fade } = setting(layer);
  return on ? fade : 0;
}

const setting = (layer) => ({ on: !OFF.has(layer), fade: 1, ...settings[layer] });

export function showLayers(classes) {
  const layers = [...FIXED, ...classes.map((entry) => [`class-${entry.class_id}`, entry.label ?? entry.name])];
  reconcile(element("map-layers"), layers, ([id]) => id, layerItem, () => {});
}

function layerItem([id, text]) {
  const { on, fade } = setting(id);
  const check = make("input", { type: "checkbox", "data-testid": `layer-${id}`, onchange: set });
  const slider = make("input", { type: "range", min: 0.1, max: 1, step: 0.1, "aria-label": `How strongly ${text} is shown`, oninput: set });
  [check.checked, slider.value] = [on, fade];
  function set() {
    settings[id] = { on: check.checked, fade: Number(slider.value) };
    remember(KEY, settings);
    for (const watcher of watchers) watcher();
  }
  return make("li", {}, make("label", {}, check, make("span", {}, text)), slider);
}
