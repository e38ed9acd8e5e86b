// A colour rule from a click into the camera image; what it takes is shown as a mask over the image
// and over images of the last minutes.

import { post } from "../core/link/api.js";
import { element, make, set, setText } from "../core/dom.js";
import { formatAge } from "../core/text/format.js";
import { number, t } from "../core/text/language.js";
import { isNarrow, selectTab } from "../core/page_tabs.js";
import { attempt } from "../core/toasts.js";

const DELAY_MS = 120;
const PERIOD_MS = 1000;
const image = element("camera");
const mask = element("camera-mask");
const button = element("entry-pick");
const strip = element("entry-looks");
const share = element("entry-share");
const field = (name) => element(`entry-${name}`);
// Field → its value in the rule, and the rule's value in the field.
const SLIDERS = ["hue-first", "hue-last", "saturation", "value"];

let rule = null;
let shown = false;
let newest = 0;
let timer = 0;
let onChange = () => {};

export const ruleOf = () => rule;
export const onRule = (listener) => {
  onChange = listener;
};

// Show a rule, null for none, and what it takes from now on; `isOpen` is false to end.
export function showRule(next, isOpen = true) {
  rule = next;
  shown = isOpen;
  setPicking(false);
  fillFields();
  look();
}

const isPicking = () => button.getAttribute("aria-pressed") === "true";

function setPicking(picks) {
  button.setAttribute("aria-pressed", String(picks));
  document.body.classList.toggle("picking", picks);
  if (picks && isNarrow()) selectTab("camera");
}

function fillFields() {
  element("entry-rule").hidden = rule === null;
  element("entry-unrule").hidden = rule === null;
  if (!rule) return;
  const [first, last] = rule.hue_deg;
  const values = [first, last, 100 * rule.min_saturation, 100 * rule.min_value];
  SLIDERS.forEach((name, i) => set(field(name), { value: String(Math.round(values[i])) }));
  set(field("height"), { value: String(rule.max_height_m) });
  field("alone").checked = Boolean(rule.alone);
}

function readFields() {
  const [first, last, saturation, value] = SLIDERS.map((name) => Number(field(name).value));
  rule = {
    ...rule,
    hue_deg: [first, last],
    min_saturation: saturation / 100,
    min_value: value / 100,
    max_height_m: Number(field("height").value),
    alone: field("alone").checked,
  };
  onChange();
  look();
}

// Ask what the rule takes once it has not changed for a moment; only the newest answer counts.
function look() {
  clearTimeout(timer);
  newest += 1;
  if (!shown || !rule) {
    mask.hidden = true;
    setText(share, "");
    strip.replaceChildren();
    return;
  }
  const asked = newest;
  timer = setTimeout(async () => {
    try {
      const { looks } = await post("/beware/colour/looks", rule);
      if (asked === newest) show(looks);
    } catch (error) {
      if (asked === newest) setText(share, error.message);
    }
    if (asked === newest) timer = setTimeout(look, PERIOD_MS);
  }, DELAY_MS);
}

function show([live, ...older]) {
  if (!live) return;
  mask.src = live.mask;
  mask.hidden = false;
  const percent = number(100 * live.share, 1);
  setText(share, t("It takes {percent} % of the camera image now.", { percent }));
  strip.replaceChildren(
    ...older.map((one) =>
      make(
        "figure",
        { "data-testid": "entry-look" },
        make(
          "span",
          {},
          make("img", { src: one.picture, alt: "" }),
          make("img", { src: one.mask, alt: "" }),
        ),
        make(
          "figcaption",
          {},
          t("{age} ago, {percent} %", {
            age: formatAge(one.age_s),
            percent: number(100 * one.share, 1),
          }),
        ),
      ),
    ),
  );
}

button.onclick = () => setPicking(!isPicking());
element("entry-unrule").onclick = () => {
  showRule(null);
  onChange();
};
for (const name of [...SLIDERS, "height", "alone"]) field(name).oninput = readFields;
// Before the click that drafts a zone.
image.parentElement.addEventListener(
  "click",
  (event) => {
    if (event.target !== image || !isPicking()) return;
    event.stopImmediatePropagation();
    const box = image.getBoundingClientRect();
    const pixel = {
      right: Math.min(Math.max((event.clientX - box.left) / box.width, 0), 1),
      down: Math.min(Math.max((event.clientY - box.top) / box.height, 0), 1),
    };
    attempt(async () => {
      const answer = await post("/beware/colour", pixel);
      showRule(answer.rule);
      onChange();
    });
  },
  true,
);
