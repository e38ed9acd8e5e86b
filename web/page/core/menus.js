// Menus beside their buttons. They are popovers, in the browser's top layer: no box of the page cuts one off or covers it. Escape
// and a click elsewhere close one; the button has the focus again unless the click gave it to something else.

import { element } from "./dom.js";

const GAP_PX = 4;
const opened = () => document.querySelector(":popover-open");
const buttonOf = (popover) => document.querySelector(`[popovertarget=${popover.id}]`);

// Close a menu, else a dialog; whether one was open.
export function closeOverlay() {
  const dialog = document.querySelector("dialog[open]");
  if (opened()) opened().hidePopover();
  else if (dialog) dialog.close();
  else return false;
  return true;
}

// Below the button or above it, on the side with more room; never over the stop.
function place(menu) {
  const { left, top, bottom } = buttonOf(menu).getBoundingClientRect();
  const stop = element("stop").getBoundingClientRect();
  const end = stop.top > bottom ? stop.top : innerHeight;
  const isBelow = end - bottom > top;
  menu.style.setProperty("--left", `${left}px`);
  menu.style.top = isBelow ? `${bottom + GAP_PX}px` : "auto";
  menu.style.bottom = isBelow ? "auto" : `${innerHeight - top + GAP_PX}px`;
  menu.style.maxHeight = `${(isBelow ? end - bottom : top) - 2 * GAP_PX}px`;
}

for (const popover of document.querySelectorAll("[popover]")) {
  const isMenu = popover.classList.contains("menu");
  popover.addEventListener("beforetoggle", (event) => { if (event.newState === "open" && isMenu) place(popover); });
  popover.addEventListener("toggle", (event) => { if (event.newState === "closed" && document.activeElement === document.body) buttonOf(popover).focus(); });
}
for (const change of ["resize", "scroll"]) window.addEventListener(change, () => { if (opened()?.matches(".menu")) place(opened()); }, true);
// A click in the 3D view is heard by its own document only.
window.addEventListener("blur", () => { if (document.activeElement === element("viewer")) opened()?.hidePopover(); });
