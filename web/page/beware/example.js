// "Beware of this": clicks on a thing in the camera image become an example of a new class; what it
// takes is shown over the image and over images of the last minutes, in which one can click, too.

import { post } from "../core/link/api.js";
import { element, make, set, setText } from "../core/dom.js";
import { formatAge } from "../core/text/format.js";
import { capitalised, number, t, tn } from "../core/text/language.js";
import { isNarrow, selectTab } from "../core/page_tabs.js";
import { attempt } from "../core/toasts.js";
import { clickIn, onImage, positionIn } from "../insight/camera.js";

const PERIOD_MS = 2000;
const MAX_CLICKS = 16;
const image = element("camera");
const mask = element("camera-mask");
const part = element("entry-example");
const note = element("entry-example-note");
const strip = element("entry-example-looks");
const takesAway = element("entry-away");

let clicks = [];
let away = [];
let made = [[], []]; // the clicks of which the prototype was made, and what they take away
let isRefused = false; // whether nothing could be made of those since
let marked = false; // whether the mask is that of a click
let prototype = null;
let pointing = false;
let newest = 0;
let timer = 0;
let onChange = () => {};

export const exampleOf = () => prototype;
export const onExample = (listener) => {
  onChange = listener;
};

// Show the example of a stored class, null for none; clicks are taken only after `point`.
export function showExample(stored) {
  clearTimeout(timer);
  newest += 1;
  [clicks, away, made, isRefused, prototype] = [[], [], [[], []], false, stored];
  takesAway.checked = false;
  setPointing(false);
  strip.replaceChildren();
  set(part, { hidden: !stored });
  const count = stored?.clicks ?? 0;
  setText(note, count ? tn("Made of {n} click on a thing.", "Made of {n} clicks on a thing.", count) : "");
}

// Take clicks into the image from now on.
export function point() {
  set(part, { hidden: false });
  setText(note, t("Click the thing in the camera image, up to five times from several sides."));
  setPointing(true);
}

function setPointing(points) {
  pointing = points;
  document.body.classList.toggle("picking", points);
  set(element("entry-away-field"), { hidden: !points });
  if (points && isNarrow()) selectTab("camera");
}

// Take a click into the camera image, or into a named older one.
async function take(event, click, isLive) {
  // What is typed next is its name, also while the console has not answered: letters and the space
  // bar are keys of the page elsewhere.
  element("entry-name").focus();
  const { key, mask: region } = await post("/beware/example/click", click);
  if (!pointing) return;
  const isAway = takesAway.checked || event.shiftKey;
  // Refused clicks make room for the next one, unless that takes away what they have too much of.
  if (isRefused && !isAway) [clicks, away] = made.map((keys) => [...keys]);
  const taken = isAway ? away : clicks;
  taken.push(key);
  if (taken.length > MAX_CLICKS) taken.shift();
  // A newer image has the thing elsewhere.
  marked = isLive && click.frame === image.dataset.frame;
  if (marked) {
    mask.src = region;
    mask.hidden = false;
  }
  await learn();
}

onImage(() => {
  if (marked) mask.hidden = true;
});

// Make a prototype of the clicks; only the newest answer counts.
async function learn() {
  clearTimeout(timer);
  if (!clicks.length) return;
  newest += 1;
  const asked = newest;
  try {
    const sent = [[...clicks], [...away]];
    const answer = await post("/beware/example", { clicks, away });
    if (asked !== newest) return;
    [made, isRefused, prototype] = [sent, false, answer.prototype];
    show(answer.looks);
    timer = setTimeout(look, PERIOD_MS, asked);
  } catch (error) {
    if (asked !== newest) return;
    isRefused = error.status === 409;
    mask.hidden = true;
    setText(note, capitalised(error.message));
  }
  onChange();
}

// Ask again what it takes, while the form is open.
async function look(asked) {
  try {
    if (!document.hidden) {
      const { looks } = await post("/beware/example/looks", prototype);
      if (asked === newest) show(looks);
    }
  } catch (error) {
    if (asked === newest) setText(note, capitalised(error.message));
  }
  if (asked === newest) timer = setTimeout(look, PERIOD_MS, asked);
}

function show([live, ...older]) {
  marked = false;
  mask.src = live.mask;
  mask.hidden = false;
  const percent = number(100 * live.share, 1);
  setText(
    note,
    tn(
      "{n} click; it takes {percent} % of the camera image now.",
      "{n} clicks; it takes {percent} % of the camera image now.",
      clicks.length,
      { percent },
    ),
  );
  strip.replaceChildren(
    ...older.map((one) => {
      const shown = make("img", { src: one.picture, alt: t("Camera image {age} ago", { age: formatAge(one.age_s) }) });
      const cover = make("img", { src: one.mask, alt: "" });
      return make(
        "figure",
        {
          "data-testid": "entry-example-look",
          onclick: (event) => {
            const click = { ...positionIn(shown, event), frame: one.frame };
            if (pointing) attempt(() => take(event, click, false));
          },
        },
        make("span", {}, shown, cover),
        make(
          "figcaption",
          {},
          t("{age} ago, {percent} %", { age: formatAge(one.age_s), percent: number(100 * one.share, 1) }),
        ),
      );
    }),
  );
}

// Before the click that drafts a zone.
image.parentElement.addEventListener(
  "click",
  (event) => {
    if (event.target !== image || !pointing) return;
    event.stopImmediatePropagation();
    attempt(() => take(event, clickIn(event), true));
  },
  true,
);
