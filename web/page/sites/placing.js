// A Nav2 map becomes a site: two points are clicked on its image, and the same two on the map.

import { FILE_S, post } from "../core/link/api.js";
import { make, setText } from "../core/dom.js";
import { roundedPoint } from "../core/geometry.js";
import { t, typedNumbers } from "../core/text/language.js";
import { attempt, notify } from "../core/toasts.js";
import { askPoint } from "../map/pointer/pick.js";
import { decodeImage, readDescription } from "./nav2_image.js";

const DOT_PX = 5;
const COLOURS = ["#e5322d", "#0a84ff"];
const NAMES = ["A", "B"];

// `hide` and `show` close and open the panel, which covers the map; `onMade` is called with the name of a site.
export function buildPlacing({ hide, show, onMade }) {
  const picture = make("canvas", {
    tabindex: "0",
    role: "img",
    "aria-label": t("Image of the Nav2 map; a click sets point A, the next one point B"),
    "data-testid": "placing-image",
  });
  const note = make("p", { class: "empty", role: "status", "data-testid": "placing-note" });
  const fields = NAMES.map((name) => ({
    onMap: pointField(t("Point {name} on the Nav2 map, x, y in metres", { name }), `placing-map-${name}`),
    onSite: pointField(t("Point {name} at the site, x, y in metres", { name }), `placing-site-${name}`),
  }));
  const rows = fields.map(({ onMap, onSite }, i) => {
    const pick = make(
      "button",
      { type: "button", "data-testid": `placing-pick-${NAMES[i]}` },
      t("Click {name} on the map", { name: NAMES[i] }),
    );
    pick.onclick = () => pickOnMap(NAMES[i], onSite);
    return make("div", { class: "row" }, onMap.label, onSite.label, pick);
  });
  const form = make(
    "form",
    { hidden: "", autocomplete: "off", "data-testid": "placing" },
    note,
    picture,
    ...rows,
    make(
      "div",
      { class: "row" },
      make("button", { class: "primary", "data-testid": "placing-make" }, t("Make the site")),
      cancelButton(() => {
        form.hidden = true;
      }),
    ),
  );
  let map = null;

  function pickOnMap(name, field) {
    hide();
    askPoint(t("Click point {name} on the map.", { name }), (at) => {
      write(field, at);
      show();
    });
  }

  function drawPoints() {
    const pen = picture.getContext("2d");
    pen.putImageData(map.image, 0, 0);
    fields.forEach(({ onMap }, i) => {
      const point = pointOf(onMap);
      if (!point) return;
      const { resolution, x, y } = map.description;
      pen.fillStyle = COLOURS[i];
      pen.beginPath();
      const down = picture.height - (point[1] - y) / resolution;
      pen.arc((point[0] - x) / resolution, down, DOT_PX * scale(), 0, 2 * Math.PI);
      pen.fill();
    });
  }

  const scale = () => picture.width / Math.max(picture.clientWidth, 1);

  picture.onclick = (event) => {
    const { resolution, x, y } = map.description;
    const [right, down] = [event.offsetX * scale(), event.offsetY * scale()];
    const next = fields.find(({ onMap }) => !pointOf(onMap)) ?? fields[0];
    if (next === fields[0]) fields[1].onMap.input.value = "";
    write(next.onMap, [x + right * resolution, y + (picture.height - down) * resolution]);
    drawPoints();
  };

  form.onsubmit = (event) => {
    event.preventDefault();
    attempt(async () => {
      await post("/sites/import-nav2", { ...map.files, alignment: alignmentOf(fields) }, FILE_S);
      form.hidden = true;
      notify(t("Site {name} is made.", map.files), { good: true });
      onMade(map.files.name);
    });
  };

  async function start(files, name) {
    const find = (pattern) => files.find((file) => pattern.test(file.name));
    const [yaml, image] = [find(/\.ya?ml$/i), find(/\.(pgm|png)$/i)];
    if (!yaml || !image) throw new Error(t("choose the YAML file and the image of a Nav2 map together"));
    const text = await yaml.text();
    const description = readDescription(text);
    const bytes = new Uint8Array(await image.arrayBuffer());
    map = {
      description,
      image: await decodeImage(bytes, image),
      files: { name, yaml: text, picture: base64(bytes) },
    };
    for (const { onMap, onSite } of fields) onMap.input.value = onSite.input.value = "";
    [picture.width, picture.height] = [map.image.width, map.image.height];
    const isOther = description.image && description.image !== image.name;
    const mix = t("▲ The YAML file is of {named}, the image that was chosen is {chosen}.", {
      named: description.image,
      chosen: image.name,
    });
    const words = t(
      "Site {name}: click two points that you know on the image, far from each other, and the " +
        "same two on the map. Without points the image's own frame is that of the site.",
      { name },
    );
    setText(note, isOther ? `${mix} ${words}` : words);
    form.hidden = false;
    drawPoints();
    form.scrollIntoView();
  }

  return { form, start };
}

function pointField(name, testId) {
  const input = make("input", { inputmode: "text", placeholder: "x, y", "data-testid": testId });
  return { input, label: make("label", { class: "field" }, name, input) };
}

function cancelButton(onclick) {
  return make("button", { type: "button", "data-testid": "placing-cancel", onclick }, t("Cancel"));
}

function write(field, point) {
  field.input.value = roundedPoint(point).join(", ");
}

// The point that a field says; null where it is empty or no point.
function pointOf({ input }) {
  const numbers = typedNumbers(input.value);
  return numbers.length === 2 && numbers.every(Number.isFinite) ? numbers : null;
}

function alignmentOf(fields) {
  const all = fields.flatMap(({ onMap, onSite }) => [onMap, onSite]);
  if (all.every(({ input }) => !input.value.trim())) return null;
  if (!all.every(pointOf)) throw new Error(t("give both points in both frames, or none"));
  return {
    on_map: fields.map(({ onMap }) => pointOf(onMap)),
    on_site: fields.map(({ onSite }) => pointOf(onSite)),
  };
}

function base64(bytes) {
  return btoa(Array.from(bytes, (byte) => String.fromCharCode(byte)).join(""));
}
