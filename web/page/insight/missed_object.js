// A box drawn on a frozen camera image labels an object that was not detected.

import { classTitle } from "../beware/class_title.js";
import { post } from "../core/link/api.js";
import { make } from "../core/dom.js";
import { t } from "../core/text/language.js";
import { attempt, notify } from "../core/toasts.js";

const MIN_BOX_PX = 6;

// Show the newest image in `pane`; `onAdded` is called after an object was labelled.
export async function openMissed(pane, classes, onAdded) {
  const { snapshot } = await post("/sightings/snapshots");
  const image = make("img", {
    src: `/api/v1/sightings/snapshots/${snapshot}.jpg`,
    alt: t("Frozen camera image"),
    draggable: "false",
    "data-testid": "missed-image",
  });
  const choice = make(
    "select",
    { "aria-label": t("Class of the object"), "data-testid": "missed-class" },
    ...classes.map((entry) => make("option", { value: entry.name }, classTitle(entry))),
  );
  const add = make(
    "button",
    { class: "primary", disabled: "", "data-testid": "missed-add" },
    t("Add"),
  );
  const close = () => {
    pane.hidden = true;
    pane.replaceChildren();
  };
  let box = null;
  const stage = boxStage(image, (drawn) => {
    box = drawn;
    add.disabled = box[2] - box[0] < MIN_BOX_PX || box[3] - box[1] < MIN_BOX_PX;
  });
  add.onclick = () =>
    attempt(async () => {
      await post("/sightings", { snapshot, class_name: choice.value, box });
      notify(t("The missed {name} is kept for the next training.", { name: choice.value }), { good: true });
      close();
      await onAdded();
    });
  const words = make("p", {}, t("Drag a box around the missed object and choose its class."));
  pane.replaceChildren(
    stage,
    make(
      "div",
      { class: "tools" },
      words,
      choice,
      add,
      make("button", { onclick: close }, t("Cancel")),
    ),
  );
  pane.hidden = false;
}

// The image, on which a drag draws a box; `onBox` gets (left, top, right, bottom) in pixels of the
// image.
function boxStage(image, onBox) {
  const frame = make("div", { class: "box", hidden: "" });
  const stage = make("div", { class: "frozen" }, image, frame);
  stage.onpointerdown = (event) => {
    const area = image.getBoundingClientRect();
    const clamp = (value, size) => Math.min(Math.max(value, 0), size);
    const positionOf = ({ clientX, clientY }) => [
      clamp(clientX - area.left, area.width),
      clamp(clientY - area.top, area.height),
    ];
    const [fromX, fromY] = positionOf(event);
    stage.setPointerCapture(event.pointerId);
    stage.onpointermove = (moved) => {
      const [toX, toY] = positionOf(moved);
      const [left, right] = [Math.min(fromX, toX), Math.max(fromX, toX)];
      const [top, bottom] = [Math.min(fromY, toY), Math.max(fromY, toY)];
      Object.assign(frame.style, {
        left: `${left}px`,
        top: `${top}px`,
        width: `${right - left}px`,
        height: `${bottom - top}px`,
      });
      frame.hidden = false;
      const [scaleX, scaleY] = [image.naturalWidth / area.width, image.naturalHeight / area.height];
      onBox([
        Math.floor(left * scaleX),
        Math.floor(top * scaleY),
        Math.min(Math.ceil(right * scaleX), image.naturalWidth),
        Math.min(Math.ceil(bottom * scaleY), image.naturalHeight),
      ]);
    };
    stage.onpointerup = () => {
      stage.onpointermove = null;
    };
  };
  return stage;
}
