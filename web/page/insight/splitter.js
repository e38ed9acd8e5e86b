// The bar between map and drawer: dragged, or moved with the arrow keys; its place is remembered.

import { loadSetting, make, saveSetting } from "../core/dom.js";
import { t } from "../core/text/language.js";

const KEY = "console.drawer_px";
const DEFAULT_PX = 228;
const MIN_PX = 120;
const MIN_MAP_PX = 160;
const STEP_PX = 24;

export function makeSplitter(drawer) {
  const bar = make("div", {
    class: "splitter",
    role: "separator",
    tabindex: 0,
    hidden: "",
    "aria-orientation": "horizontal",
    "aria-controls": drawer.id,
    "aria-label": t("Height of the drawer"),
    "data-testid": "splitter",
  });
  let height = loadSetting(KEY, DEFAULT_PX);

  function setHeight(px) {
    const stage = document.querySelector(".stage");
    const largest = Math.max(stage.clientHeight + drawer.clientHeight - MIN_MAP_PX, MIN_PX);
    height = Math.round(Math.min(Math.max(px, MIN_PX), stage.clientHeight ? largest : px));
    drawer.style.height = `${height}px`;
    bar.setAttribute("aria-valuenow", height);
  }

  bar.onpointerdown = (event) => {
    bar.setPointerCapture(event.pointerId);
    const [from, heightThen] = [event.clientY, height];
    bar.onpointermove = (moved) => setHeight(heightThen + from - moved.clientY);
  };
  bar.onpointerup = bar.onpointercancel = () => {
    bar.onpointermove = null;
    saveSetting(KEY, height);
  };
  bar.onkeydown = (event) => {
    const step = { ArrowUp: STEP_PX, ArrowDown: -STEP_PX }[event.key];
    if (!step) return;
    event.preventDefault();
    setHeight(height + step);
    saveSetting(KEY, height);
  };
  setHeight(height);
  return bar;
}
