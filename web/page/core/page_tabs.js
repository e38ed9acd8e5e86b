// On a phone the page is one column, and a bar of tabs says which part of it is shown. On a larger screen all parts are.

import { drawing, onDraft } from "../zones/draft.js";

const parts = [...document.querySelectorAll("[data-on]")];
const tabs = [...document.querySelectorAll(".page-tabs [data-tab]")];
let wasDrawing = false;

export const isNarrow = () => matchMedia("(max-width: 940px)").matches; // as in phone.css

function turnTo(name) {
  for (const tab of tabs) tab.setAttribute("aria-selected", String(tab.dataset.tab === name));
  for (const part of parts) part.classList.toggle("elsewhere", !part.dataset.on.split(" ").includes(name));
}

for (const tab of tabs) tab.onclick = () => turnTo(tab.dataset.tab);
// A zone is drawn on the map, wherever its drawing was begun.
onDraft(() => {
  if (drawing() && !wasDrawing) turnTo("map");
  wasDrawing = drawing();
});
turnTo("map");
