// Camera image and map change places: the one is large in the middle, the other small beside it.

import { element } from "../core/dom.js";
import { isNarrow } from "../core/page_tabs.js";

const stage = document.querySelector(".stage");
const shot = document.querySelector(".shot");
const map = element("panel-map");
const button = element("swap");
const cameraPlace = shot.parentElement;
const mapBefore = map.nextSibling;
let showMap = () => {};

// Set the function that shows the map instead of the 3D view.
export const showMapBy = (act) => {
  showMap = act;
};
export const isSwapped = () => shot.parentElement === stage;

export function swap(large = !isSwapped()) {
  if (large === isSwapped() || (large && isNarrow())) return;
  if (large) {
    showMap();
    const { width, height } = element("camera");
    stage.style.setProperty("--ratio", width / height);
    stage.append(shot);
    cameraPlace.append(map);
  } else {
    stage.insertBefore(map, mapBefore);
    cameraPlace.append(shot);
  }
  document.body.classList.toggle("camera-large", large);
  button.setAttribute("aria-pressed", String(large));
}

button.onclick = () => swap();
window.addEventListener("resize", () => {
  if (isNarrow()) swap(false);
});
