// A click on an object in the camera image drafts a zone under it.

import { isOpen as isClassOpen } from "../beware/entry.js";
import { post } from "../core/link/api.js";
import { element } from "../core/dom.js";
import { attempt } from "../core/toasts.js";
import { clickIn } from "../insight/camera.js";
import { propose } from "./draft.js";

const SHOWN_MS = 4000;
const image = element("camera");
const outline = element("camera-outline");
let timer = 0;

image.addEventListener("click", (event) => {
  if (isClassOpen()) return; // a zone would end the class that is being edited
  const click = clickIn(event);
  attempt(async () => {
    const region = await post("/camera/region", click);
    showOutline(region.outline);
    propose(
      region.footprint,
      region.name ? `${region.name[0].toUpperCase()}${region.name.slice(1)}` : "",
    );
  });
});

function showOutline(points) {
  outline
    .querySelector("polygon")
    .setAttribute("points", points.map(([x, y]) => `${x},${y}`).join(" "));
  outline.removeAttribute("hidden");
  clearTimeout(timer);
  timer = setTimeout(() => outline.setAttribute("hidden", ""), SHOWN_MS);
}
