// The camera image; what was detected is tinted in it and named by the page, so that the names are
// readable at every size.

import { abortableFetch, get } from "../core/link/api.js";
import { element, make, reconcile, setText } from "../core/dom.js";
import { named, t } from "../core/text/language.js";
import { oneAtATime, pause } from "../core/link/updates.js";

const IMAGE_MS = 250;
const ROW_SHARE = 0.07; // of the image's height, between names that would cover each other
const image = element("camera");
const screen = image.getContext("bitmaprenderer");
const names = element("camera-labels");
let serial = null;
let afterImage = () => {};

// Called when a newer image is shown.
export const onImage = (listener) => {
  afterImage = listener;
};

const load = oneAtATime(async () => {
  const isNamed = element("overlay").checked;
  const overlay = isNamed ? "tint" : "none";
  const shown = serial;
  const [{ bitmap, frame }, { labels }] = await Promise.all([
    imageOf(`/api/v1/camera.jpg?overlay=${overlay}&v=${shown}`),
    isNamed ? get("/camera/labels") : { labels: [] },
  ]);
  draw(bitmap);
  if (frame !== image.dataset.frame) afterImage();
  Object.assign(image.dataset, { serial: shown, frame });
  showNames(labels);
  await pause(IMAGE_MS);
});

// An <img> would leave every image decoded in the browser's cache, 4 MB for ten of them.
async function imageOf(address) {
  const answer = await abortableFetch(address);
  if (!answer.ok) throw new Error(t("no camera image"));
  const bitmap = await createImageBitmap(await answer.blob());
  return { bitmap, frame: answer.headers.get("Frame") };
}

// Where a click is in an image, as shares of its width and height.
export function positionIn(shown, { clientX, clientY }) {
  const box = shown.getBoundingClientRect();
  const share = (at) => Math.min(Math.max(at, 0), 1);
  return {
    right: share((clientX - box.left) / box.width),
    down: share((clientY - box.top) / box.height),
  };
}

// The same in the camera image, with the name of the image that is shown: the next one may be there
// before the click arrives.
export const clickIn = (event) => ({ ...positionIn(image, event), frame: image.dataset.frame });

function draw(bitmap) {
  const { width, height } = bitmap;
  if (image.width !== width || image.height !== height) Object.assign(image, { width, height });
  screen.transferFromImageBitmap(bitmap); // the one before is freed
}

const percent = (share) => `${(100 * share).toFixed(1)}%`;

function showNames(labels) {
  const rows = [];
  const placed = labels.map((label, i) => {
    const [left, top] = label.box;
    let row = Math.max(top, ROW_SHARE);
    while (rows.some((other) => Math.abs(other - row) < ROW_SHARE)) row += ROW_SHARE;
    rows.push(row);
    return { ...label, key: i, left: Math.min(left, 0.7), row };
  });
  reconcile(
    names,
    placed,
    ({ key }) => key,
    () => make("span", { "data-testid": "camera-label" }),
    (node, { name, confidence, left, row }) => {
      setText(node, `${named(name)} ${Math.round(100 * confidence)} %`);
      node.style.left = percent(left);
      node.style.top = percent(row);
    },
  );
}

export function follow(state) {
  if (state.picture_serial === null || serial === state.picture_serial) return;
  if (!image.offsetParent) return; // loaded when it is seen
  serial = state.picture_serial;
  load();
}

element("overlay").onchange = () => load();
