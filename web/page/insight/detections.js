// The detections: counts of each class, and a card with image and position of each object. A wrong
// one can be corrected for the next training.

import { classTitle } from "../beware/class_title.js";
import { swatchOf } from "../beware/swatch.js";
import { get, post, request } from "../core/link/api.js";
import { element, make, reconcile, setText } from "../core/dom.js";
import { formatAge } from "../core/text/format.js";
import { number, sentence, t, tn } from "../core/text/language.js";
import { attempt, notify } from "../core/toasts.js";
import { reject } from "../map/pointer/reject.js";
import { openMissed } from "./missed_object.js";

// While the tab is closed, the counts are updated only every so many ticks.
const CLOSED_EVERY = 5;
const NONE_OF_LIST = "-";
const VERDICTS = { wrong: t("✕ marked as wrong"), rejected: t("✕ not one") };
let shared;
let tab;
let counts;
let cards;
let collected;
let missed;
let rejected;
let shownRejected = "";
let isBusy = false;
let ticks = 0;

export function build(pane, context, button) {
  shared = context;
  tab = button;
  counts = make("div", { class: "counts", "data-testid": "seen-counts" });
  cards = make("ul", { class: "cards", "data-testid": "detections" });
  collected = make("p", { class: "soft", "data-testid": "labelling" });
  missed = make("div", { class: "missed", hidden: "" });
  rejected = make("ul", { class: "rejected", "data-testid": "rejected" });
  const open = () => attempt(() => openMissed(missed, shared.beware.classes, () => tick(true)));
  const add = make(
    "button",
    {
      "data-testid": "missed-open",
      "data-edits": "",
      title: t("Label an object that the robot did not detect"),
      onclick: open,
    },
    t("+ Add a missed object"),
  );
  pane.append(make("div", { class: "head" }, counts, add), missed, cards, rejected, collected);
}

export async function tick(isOpen) {
  ticks += 1;
  if (isBusy || (!isOpen && ticks % CLOSED_EVERY)) return;
  isBusy = true;
  try {
    show(await get("/sightings"));
    if (isOpen) showRejected((await get("/map/edits")).rejected);
  } catch {
    // a lost connection has its own banner
  }
  isBusy = false;
}

const entryOf = (id) => shared.beware.classes.find((entry) => entry.class_id === id);
// A class that was removed from the list keeps the name with which it was seen.
const titleOf = ({ class_id: id, class_name: name }) => classTitle(entryOf(id) ?? { name });

function show({ seen, sightings, labelling, labelling_failure: failure }) {
  showCounts(seen, sightings);
  // Without the age, which would have the map painted again.
  const onMap = sightings.filter((detection) => !detection.verdict);
  shared.showSightings(
    onMap.map((detection) => {
      const { id, place, confidence, looks } = detection;
      return { id, class_name: titleOf(detection), place, confidence, looks };
    }),
  );
  showInBewareList(seen);
  // A card that says the same stays, and so does an open choice.
  reconcile(cards, sightings, keyOf, cardOf, (card, { id, place, confidence, looks, age_s: age }) => {
    // With a better view both are others.
    const view = `/api/v1/sightings/${id}/picture.jpg?view=${[confidence, ...place].join()}`;
    const image = card.querySelector("img");
    if (image.getAttribute("src") !== view) image.src = view;
    setText(card.querySelector(".sure"), `${Math.round(100 * confidence)} %`);
    setText(
      card.querySelector(".soft"),
      tn("{n} view · {age} ago", "{n} views · {age} ago", looks, { age: formatAge(age ?? 0) }),
    );
  });
  setText(collected, failure === null ? collectedText(labelling) : sentence(failure));
}

function collectedText(labelling) {
  const { pictures, max_pictures: most, folder } = labelling;
  const size = number(labelling.bytes_used / 1e6, 1);
  return t(
    "{pictures} of at most {most} corrected images ({size} MB) for the next training, in {folder}",
    { pictures, most, size, folder },
  );
}

// Numbers begin again with another start of the console; the choice is one of the classes of the list.
const keyOf = ({ id, class_name: name, place, verdict, has_image: hasImage }) => {
  const classes = shared.beware.classes.map((entry) => [entry.name, titleOf(entry)]);
  return [id, name, placeText(place), verdict, hasImage, ...classes].join();
};

function showCounts(seen, sightings) {
  const total = Object.values(seen).reduce((sum, count) => sum + count, 0);
  setText(tab, total ? `${t("Detections")} · ${total}` : t("Detections"));
  const key = JSON.stringify([seen, sightings.length > 0, shared.beware.classes.map(titleOf)]);
  if (counts.dataset.key === key) return;
  counts.dataset.key = key;
  counts.replaceChildren(
    ...Object.entries(seen).map(([text, count]) => {
      const id = Number(text);
      const seenAs = sightings.find((detection) => detection.class_id === id)?.class_name;
      const name = titleOf({ class_id: id, class_name: seenAs ?? t("class {id}", { id }) });
      return make(
        "span",
        { class: "count", "data-class": id },
        swatchOf(entryOf(id)),
        `${count} × ${name}`,
      );
    }),
  );
  if (total) return;
  const nothing = sightings.length
    ? t("None of the detections counts: each was rejected or corrected.")
    : t("No object of the beware list was detected yet.");
  counts.replaceChildren(make("span", { class: "soft" }, nothing));
}

// Where the operator said "not one": kept with the map until it is taken back.
function showRejected(places) {
  const key = JSON.stringify([places, places.map(titleOf)]);
  if (key === shownRejected) return;
  shownRejected = key;
  rejected.replaceChildren(
    ...places.map(({ id, place, ...rejection }) =>
      make(
        "li",
        { "data-testid": "rejected-place" },
        make("span", {}, t("You said that this is no {name}:", { name: titleOf(rejection) })),
        placeButton(place),
        make(
          "button",
          {
            title: t("Take it seriously there again"),
            "data-testid": "rejected-forget",
            "data-edits": "",
            onclick: () => takeBack(id),
          },
          t("Take back"),
        ),
      ),
    ),
  );
}

const takeBack = (id) =>
  attempt(async () => {
    await request("DELETE", `/map/rejected/${id}`);
    await tick(true);
  });

// The count beside each class of the beware list.
function showInBewareList(seen) {
  for (const item of element("beware").children) {
    const entry = shared.beware.classes.find((one) => one.name === item.dataset.name);
    const note = item.querySelector(".seen");
    setText(note, entry && seen[entry.class_id] ? t("{n} seen", { n: seen[entry.class_id] }) : "");
  }
}

function cardOf(detection) {
  const { id, place, verdict } = detection;
  const name = titleOf(detection);
  const image = make("img", {
    alt: t("{name}, as the camera saw it", { name }),
    loading: "lazy",
  });
  return make(
    "li",
    { class: verdict ?? "", "data-testid": "detection", "data-class": detection.class_name },
    image,
    make(
      "div",
      { class: "name" },
      swatchOf(entryOf(detection.class_id)),
      make("b", {}, name),
      make("span", { class: "sure" }),
    ),
    make("span", { class: "soft" }),
    placeButton(place),
    verdict
      ? make("span", { class: "verdict" }, VERDICTS[verdict])
      : make(
          "span",
          { class: "corrections", "data-edits": "" },
          ...rejectButtons(id, name),
          // Without its image nothing can be learned from a correction.
          ...(detection.has_image ? [correctionChoice(detection)] : []),
        ),
  );
}

const placeText = ([x, y]) => `◎ ${x.toFixed(1)}, ${y.toFixed(1)}`;

function placeButton(place) {
  const look = () => shared.look(place);
  return make(
    "button",
    { class: "jump", title: t("Show this place"), "data-testid": "detection-jump", onclick: look },
    placeText(place),
  );
}

const rejectButtons = (id, name) => [
  make(
    "button",
    {
      title: t("This is no {name}: free its place, and ask for better evidence there", { name }),
      "data-testid": "reject",
      onclick: () => rejectSighting(id, name, false),
    },
    t("✕ Not one"),
  ),
  make(
    "button",
    {
      title: t("None of all that was taken for a {name} here is one", { name }),
      "data-testid": "reject-all",
      onclick: () => rejectSighting(id, name, true),
    },
    t("✕ None of this kind"),
  ),
];

const rejectSighting = (id, name, isAll) =>
  reject(`/sightings/${id}/reject`, { all_of_class: isAll }, name, () => tick(true));

const notA = (name) =>
  /^[aeiou]/i.test(name) ? t("Not an {name} → …", { name }) : t("Not a {name} → …", { name });

function correctionChoice(detection) {
  const { id, class_id: classId } = detection;
  const name = titleOf(detection);
  const others = shared.beware.classes.filter((entry) => entry.class_id !== classId);
  const choice = make(
    "select",
    { "aria-label": t("What it is instead of {name}", { name }), "data-testid": "correction" },
    make("option", { value: "" }, notA(name)),
    make("option", { value: NONE_OF_LIST }, t("nothing on the list")),
    ...others.map((entry) => make("option", { value: entry.name }, titleOf(entry))),
  );
  choice.onchange = () =>
    attempt(async () => {
      await post(`/sightings/${id}/wrong`, {
        class_name: choice.value === NONE_OF_LIST ? null : choice.value,
      });
      notify(t("The corrected image is kept for the next training."), { good: true });
      await tick(true);
    });
  return choice;
}
