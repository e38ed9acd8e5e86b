// What the 3D view shows: each page has its own layers, colours and opacities, remembered by the
// browser.

import { element, loadSetting, make, saveSetting } from "../core/dom.js";
import { t } from "../core/text/language.js";
import { fadeViewer } from "./viewer.js";
import { look, showDisplay } from "./link.js";

const KEY = "console.viewer";
const LAYERS = [
  ["cloud", t("points")],
  ["floor", t("floor grid")],
  ["robot", t("robot")],
  ["camera", t("camera, frustum")],
  ["path", t("planned path")],
  ["waypoints", t("waypoints")],
  ["driven", t("driven path")],
  ["candidates", t("candidate motions")],
  ["people", t("people, predicted")],
  ["goals", t("goals")],
  ["zones", t("zones")],
];
const WITHOUT_OPACITY = new Set(["goals", "robot"]);
const settings = {
  hidden: ["candidates"],
  colour: "camera",
  follows: false,
  strength: {}, // by layer, 0 to 1; 1 for those not named
  ...loadSetting(KEY, {}),
};
const colour = element("cloud-colour");
const followButton = document.querySelector("[data-look=follow]");

function changed() {
  saveSetting(KEY, settings);
  send();
}

function send() {
  followButton.setAttribute("aria-pressed", String(settings.follows));
  showDisplay({ cloud_colour: settings.colour, hidden: settings.hidden, follows: settings.follows });
  fadeViewer(settings.strength);
}

function layerRow([name, text]) {
  const check = make("input", {
    type: "checkbox",
    "data-testid": `layer-3d-${name}`,
    onchange: () => {
      settings.hidden = settings.hidden.filter((other) => other !== name);
      if (!check.checked) settings.hidden.push(name);
      changed();
    },
  });
  check.checked = !settings.hidden.includes(name);
  const row = make("li", {}, make("label", {}, check, make("span", {}, text)));
  if (WITHOUT_OPACITY.has(name)) return row;
  const range = make("input", {
    type: "range",
    min: 10,
    max: 100,
    step: 10,
    value: Math.round(100 * (settings.strength[name] ?? 1)),
    "data-testid": `opacity-3d-${name}`,
    "aria-label": t("Opacity of {text}", { text }),
    title: t("Opacity"),
    oninput: () => {
      settings.strength[name] = Number(range.value) / 100;
      changed();
    },
  });
  row.append(range);
  return row;
}

element("viewer-layers").append(...LAYERS.map(layerRow));
colour.value = settings.colour;
colour.onchange = () => {
  settings.colour = colour.value;
  changed();
};
for (const button of document.querySelectorAll("[data-look]"))
  button.onclick = () => look(button.dataset.look);
followButton.onclick = () => {
  settings.follows = !settings.follows;
  changed();
};
send();
