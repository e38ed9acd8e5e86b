// Menus beside their buttons. They are popovers in the browser's top layer, so that no part of the
// page clips or covers one. Escape and a click elsewhere close a menu; then the button has the
// focus again, unless the click gave it to another element.

import { element } from "./dom.js";

const GAP_PX = 4;
const openPopover = () => document.querySelector(":popover-open");
const buttonOf = (popover) => document.querySelector(`[popovertarget=${popover.id}]`);

// Close the open menu, else the open dialog; returns whether one was open.
export function closeOverlay() {
  const dialog = document.querySelector("dialog[open]");
  if (openPopover()) openPopover().hidePopover();
  else if (dialog) dialog.close();
  else return false;
  return true;
}

// Below or above the button, on the side with more space; never over the stop.
function positionMenu(menu) {
  const { left, top, bottom } = buttonOf(menu).getBoundingClientRect();
  const stop = element("stop").getBoundingClientRect();
  const end = stop.top > bottom ? stop.top : innerHeight;
  const start = stop.bottom < top ? stop.bottom : 0;
  const isBelow = end - bottom > top - start;
  menu.style.setProperty("--left", `${left}px`);
  menu.style.top = isBelow ? `${bottom + GAP_PX}px` : "auto";
  menu.style.bottom = isBelow ? "auto" : `${innerHeight - top + GAP_PX}px`;
  menu.style.maxHeight = `${(isBelow ? end - bottom : top - start) - 2 * GAP_PX}px`;
}

for (const popover of document.querySelectorAll("[popover]")) {
  const isMenu = buttonOf(popover) !== null && popover.classList.contains("menu");
  popover.addEventListener("beforetoggle", (event) => {
    if (event.newState === "open" && isMenu) positionMenu(popover);
  });
  popover.addEventListener("toggle", (event) => {
    if (event.newState === "closed" && document.activeElement === document.body)
      (buttonOf(popover) ?? element("map-canvas")).focus();
  });
}
for (const change of ["resize", "scroll"]) {
  window.addEventListener(
    change,
    () => {
      const open = openPopover();
      if (open?.matches(".menu") && buttonOf(open)) positionMenu(open);
    },
    true,
  );
}
// A click in the 3D view reaches only its own document.
window.addEventListener("blur", () => {
  if (document.activeElement === element("viewer")) openPopover()?.hidePopover();
});
