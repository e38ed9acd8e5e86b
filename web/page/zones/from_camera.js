// Draw from the picture: a click on a thing in the camera's picture becomes a draft of a zone under it.

import { post } from "../core/api.js";
import { element } from "../core/dom.js";
import { propose } from "./draft.js";
import { attempt } from "../core/toasts.js";

const SHOWN_MS = 4000;
const image = element("camera");
const outline = element("camera-outline");
let timer = 0;

image.addEventListener("click", (event) => {
  const box = image.getBoundingClientRect();
  const share = (value) => Math.min(Math.max(value, 0), 1);
  const pixel = { right: share((event.clientX - box.left) / box.width), down: share((event.clientY - box.top) / box.height) };
  attempt(async () => {
    const region = await post("/camera/region", pixel);
    outline.querySelector("polygon").setAttribute("points", region.outline.map(([x, y]) => `${x},${y}`).join(" "));
    outline.removeAttribute("hidden");
    clearTimeout(timer);
    timer = setTimeout(() => outline.setAttribute("hidden", ""), SHOWN_MS);
    propose(region.footprint, region.name ? `${region.name[0].toUpperCase()}${region.name.slice(1)}` : "");
  });
});
