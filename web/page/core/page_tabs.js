// Tabs of a narrow window: one column, of which they show a part. A larger screen shows all parts.

const parts = [...document.querySelectorAll("[data-on]")];
const tabs = [...document.querySelectorAll(".page-tabs [data-tab]")];

export const isNarrow = () => matchMedia("(max-width: 940px)").matches; // as in small_screens.css

export function selectTab(name) {
  for (const tab of tabs) tab.setAttribute("aria-selected", String(tab.dataset.tab === name));
  for (const part of parts)
    part.classList.toggle("elsewhere", !part.dataset.on.split(" ").includes(name));
}

for (const tab of tabs) tab.onclick = () => selectTab(tab.dataset.tab);
selectTab("map");
