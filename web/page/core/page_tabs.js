// Tabs of a narrow window or a tablet: they choose the part that is shown, on a tablet beside the map.
// A larger screen shows all parts.

import { element } from "./dom.js";

const parts = [...document.querySelectorAll("[data-on]")];
const tabs = [...document.querySelectorAll(".page-tabs [data-tab]")];

// As in small_screens.css.
const NARROW = "(max-width: 940px), (pointer: coarse) and (max-width: 1180px)";
export const isNarrow = () => matchMedia(NARROW).matches;

export function selectTab(name) {
  for (const tab of tabs) tab.setAttribute("aria-selected", String(tab.dataset.tab === name));
  for (const part of parts)
    part.classList.toggle("elsewhere", !part.dataset.on.split(" ").includes(name));
  document.querySelector("main").scrollTop = 0; // the tabs share one scrolled column
}

// Show the map, whatever part and whatever view is shown now.
export function showMap() {
  selectTab("map");
  element("tab-map").click();
}

for (const tab of tabs) tab.onclick = () => selectTab(tab.dataset.tab);
selectTab("map");
