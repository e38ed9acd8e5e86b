// What the page and the 3D view tell each other: clicks, the draft, layers, marks.

import { connect } from "../core/api.js";
import { element, make } from "../core/dom.js";
import { clicked, draft, isDrawing, moveCorner, onDraft, outline } from "../zones/draft.js";
import { finish } from "../zones/store_draft.js";
import { address, drawViewerNow, setConnected } from "./viewer.js";

const MAX_PREVIEW_POINTS = 4000;
const LAYERS = [
  ["cloud", "points"],
  ["floor", "floor grid"],
  ["camera", "camera, frustum"],
  ["path", "planned path"],
  ["waypoints", "waypoints"],
  ["driven", "driven path"],
  ["candidates", "candidate motions"],
  ["people", "people, predicted"],
  ["goals", "goals"],
  ["zones", "zones"],
];
const OFF = new Set(["candidates"]);
const WITHOUT_OPACITY = new Set(["goals"]);
// Modes of which the 3D view knows nothing.
const PAGE_MODES = new Set(["measure", "place"]);
let onOpen = () => {};

// Called when the link is open again and the console has forgotten the marks.
export const onLinkOpen = (act) => {
  onOpen = act;
};

const link = connect(address, {
  onOpen: () => {
    sendDraft();
    onOpen();
  },
  onMessage: (message) => {
    if (message.type === "click") {
      if (clicked(message.x_m, message.y_m)) finish();
    } else if (message.type === "drag") moveCorner(message.index, [message.x_m, message.y_m]);
    else if (message.type === "viewer") setConnected(message.connected);
  },
});

export const mark = (lines, place) => link.send({ type: "mark", lines, place });

// Turn the camera of the 3D view: `at` is "overview", "top", "robot", or "place" with a point.
export function look(at, place) {
  link.send(place ? { type: "look", at, place } : { type: "look", at });
  drawViewerNow();
}

function sendDraft() {
  link.send({
    type: "draft",
    mode: PAGE_MODES.has(draft.mode) ? "navigate" : draft.mode,
    corners: draft.corners,
    outline: isDrawing() ? outline() : [],
    path: draft.preview.slice(0, MAX_PREVIEW_POINTS),
  });
}

function sendLayers() {
  const hidden = [...document.querySelectorAll("[data-layer]")]
    .filter((box) => !box.checked)
    .map((box) => box.dataset.layer);
  const faded = [...document.querySelectorAll("[data-strength]")].filter(
    (range) => Number(range.value) < 100,
  );
  const strength = Object.fromEntries(
    faded.map((range) => [range.dataset.strength, Number(range.value) / 100]),
  );
  link.send({ type: "show", cloud_colour: element("cloud-colour").value, hidden, strength });
}

function layerRow([name, text]) {
  const check = make("input", {
    type: "checkbox",
    "data-layer": name,
    "data-testid": `layer-${name}`,
    onchange: sendLayers,
  });
  check.checked = !OFF.has(name);
  const row = make("li", {}, make("label", {}, check, make("span", {}, text)));
  if (WITHOUT_OPACITY.has(name)) return row;
  row.append(
    make("input", {
      type: "range",
      min: 10,
      max: 100,
      step: 10,
      value: 100,
      "data-strength": name,
      "aria-label": `Opacity of ${text}`,
      title: "Opacity",
      onchange: sendLayers,
    }),
  );
  return row;
}

element("viewer-layers").append(...LAYERS.map(layerRow));
element("cloud-colour").onchange = sendLayers;
for (const button of document.querySelectorAll("[data-look]"))
  button.onclick = () => look(button.dataset.look);
onDraft(() => {
  sendDraft();
  drawViewerNow();
});
