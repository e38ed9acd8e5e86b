// A colour rule from a click into the camera image; what it takes is shown as a mask over the image
// and over images of the last minutes.

import { post } from "../core/link/api.js";
import { element, make, set, setText } from "../core/dom.js";
import { formatAge } from "../core/text/format.js";
import { capitalised, number, t } from "../core/text/language.js";
import { isNarrow, selectTab } from "../core/page_tabs.js";
import { attempt } from "../core/toasts.js";
import { clickIn } from "../insight/camera.js";

const DELAY_MS = 120;
const PERIOD_MS = 1000;
const image = element("camera");
const mask = element("camera-mask");
const strip = element("entry-looks");
const share = element("entry-share");
const field = (name) => element(`entry-${name}`);
const PICKS = { first: field("pick"), second: field("pick-second") };
// Ranges of a colour: name, text and largest figure of the two sliders, degrees or percent.
const HUE = "hue";
const RANGES = [
  [HUE, t("Hue"), 360],
  ["saturation", t("Saturation"), 100],
  ["value", t("Brightness"), 100],
];
// The second colour of a new pattern is next to the first one within this distance, metres.
const GAP_M = 0.3;

let rule = null;
let shown = false;
let picking = null;
let newest = 0;
let timer = 0;
let onChange = () => {};

export const ruleOf = () => rule;

// What a rule looks for.
export function kindOf({ pattern, line }) {
  if (pattern) return t("pattern of colours");
  return line ? t("bright line") : t("colour rule");
}

export const onRule = (listener) => {
  onChange = listener;
};

// Show a rule, null for none, and what it takes from now on; `isOpen` is false to end.
export function showRule(next, isOpen = true) {
  rule = next;
  shown = isOpen;
  setPicking(null);
  fillFields();
  look();
}

// Take the next click into the image for the "first" or the "second" colour; null for none.
function setPicking(which) {
  picking = which;
  for (const [name, button] of Object.entries(PICKS))
    button.setAttribute("aria-pressed", String(name === which));
  document.body.classList.toggle("picking", which !== null);
  if (which && isNarrow()) {
    selectTab("camera");
    image.scrollIntoView({ block: "nearest" });
  }
}

// The sliders of a colour: `read` returns its ranges as a rule has them, `show` sets them.
function slidersOf(box, which) {
  const sliders = RANGES.map(([name, text, most]) => {
    const ends = [t("{range} from", { range: text }), t("{range} to", { range: text })].map(
      (title, i) =>
        make("input", {
          type: "range",
          min: "0",
          max: String(most),
          title,
          "aria-label": title,
          "data-testid": `entry-${which}-${name}-${["from", "to"][i]}`,
        }),
    );
    // Only hues go round; any other range that is turned over takes the other end along.
    const change = (moved, other, isOver) => {
      if (name !== HUE && isOver(Number(moved.value), Number(other.value))) other.value = moved.value;
      readFields();
    };
    ends[0].oninput = () => change(ends[0], ends[1], (from, to) => from > to);
    ends[1].oninput = () => change(ends[1], ends[0], (to, from) => to < from);
    box.append(make("div", { class: "range" }, make("span", {}, text), ...ends));
    return ends;
  });
  const valuesOf = (ends, scale) => ends.map((end) => Number(end.value) / scale);
  return {
    read: () => {
      const [hues, saturations, values] = sliders.map((ends, i) => valuesOf(ends, i ? 100 : 1));
      return {
        hue_deg: hues,
        min_saturation: saturations[0],
        max_saturation: saturations[1],
        min_value: values[0],
        max_value: values[1],
      };
    },
    show: (colour) => {
      const shares = ["saturation", "value"].map((name) =>
        [colour[`min_${name}`], colour[`max_${name}`]].map((value) => 100 * value),
      );
      [colour.hue_deg, ...shares].forEach((values, i) =>
        values.forEach((value, end) => set(sliders[i][end], { value: String(Math.round(value)) })),
      );
    },
  };
}

const first = slidersOf(field("first"), "first");
const second = slidersOf(field("second"), "second");

function fillFields() {
  const pattern = rule?.pattern ?? null;
  field("rule").hidden = rule === null;
  field("unrule").hidden = rule === null;
  field("pattern").hidden = pattern === null;
  field("unpattern").hidden = pattern === null;
  if (!rule) return;
  first.show(rule);
  set(field("height"), { value: String(rule.max_height_m) });
  field("alone").checked = Boolean(rule.alone);
  if (!pattern) return;
  second.show(pattern);
  set(field("gap"), { value: String(pattern.max_gap_m) });
}

function readFields() {
  const { pattern } = rule;
  change({
    ...rule,
    ...first.read(),
    max_height_m: Number(field("height").value),
    alone: field("alone").checked,
    pattern: pattern && { ...pattern, ...second.read(), max_gap_m: Number(field("gap").value) },
  });
}

function change(next) {
  rule = setByHand(next);
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
      if (!document.hidden) {
        const { looks } = await post("/beware/colour/looks", rule);
        if (asked === newest) show(looks);
      }
    } catch (error) {
      if (asked === newest) setText(share, capitalised(error.message));
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

for (const [which, button] of Object.entries(PICKS))
  button.onclick = () => setPicking(picking === which ? null : which);
field("unrule").onclick = () => pick(null);
field("unpattern").onclick = () => pick({ ...rule, pattern: null });
for (const name of ["height", "alone", "gap"]) field(name).oninput = readFields;

// A rule that the operator sets counts also where the network knows the class.
const setByHand = (next) => next && { ...next, fallback: false };

function pick(next) {
  showRule(setByHand(next));
  onChange();
}

// The rule with the colour that was clicked.
function withColour(clicked) {
  if (picking === "first") return { ...clicked, pattern: rule?.pattern ?? null };
  const { hue_deg, min_saturation, max_saturation, min_value, max_value } = clicked;
  const colour = { hue_deg, min_saturation, max_saturation, min_value, max_value };
  return { ...rule, pattern: { max_gap_m: GAP_M, ...rule.pattern, ...colour } };
}

// Before the click that drafts a zone.
image.parentElement.addEventListener(
  "click",
  (event) => {
    if (event.target !== image || !picking) return;
    event.stopImmediatePropagation();
    const click = clickIn(event);
    attempt(async () => {
      const { rule: clicked } = await post("/beware/colour", click);
      if (picking) pick(withColour(clicked));
    });
  },
  true,
);
