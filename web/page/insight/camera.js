// The camera image, with the detections over it.

import { element } from "../core/dom.js";
import { oneAtATime, pause } from "../core/updates.js";

const IMAGE_MS = 250;
const image = element("camera");
let serial = null;

const load = oneAtATime(async () => {
  const overlay = element("overlay").checked ? "segmentation" : "none";
  image.src = await loaded(`/api/v1/camera.jpg?overlay=${overlay}&v=${serial}`);
  await pause(IMAGE_MS);
});

// Return the address once its image is in the cache, so that the page never shows half of one.
function loaded(source) {
  return new Promise((resolve, reject) => {
    const loader = new Image();
    loader.onload = () => resolve(source);
    loader.onerror = () => reject(new Error("no camera image"));
    loader.src = source;
  });
}

export function follow(state) {
  if (state.picture_serial === null || serial === state.picture_serial) return;
  serial = state.picture_serial;
  if (image.offsetParent) load();
}

element("overlay").onchange = () => load();
