// The changes of the map against the accepted one: listed, drawn on the map, accepted one by one.
// The panel covers the map: while a change is looked at there, the panel is away.

import { get, post } from "../core/link/api.js";
import { element, make, reconcile, set, setText } from "../core/dom.js";
import { showMap } from "../core/page_tabs.js";
import { capitalised, number, t, tn } from "../core/text/language.js";
import { attempt, notify } from "../core/toasts.js";
import { overlays, redraw } from "../map/map.js";
import { centreOn } from "../map/view.js";

const COLOURS = { appeared: "#e5322d", gone: "#0a84ff" };
const TEXTS = { appeared: t("new obstacle"), gone: t("obstacle gone") };
const DASH = [6, 4];
const WIDTH_PX = 2.5;
const RETRY_MS = 1000;
const shown = element("change-shown");
const note = make("p", { class: "empty", role: "status", "data-testid": "changes-note" });
const list = make("ul", { class: "list", "data-testid": "changes" });
const all = make("button", { "data-testid": "changes-all" }, t("Accept the whole map"));
const again = make("button", { "data-testid": "changes-refresh" }, t("Compare again"));
let listed = { areas: [], listing: null };
let panel = { hide: () => {}, show: () => {} };
let looked = null; // the area that is looked at on the map
let retry = 0;
let asks = 0;

// `hide` and `show` put the panel, which covers the map, away and back.
export function buildChanges({ hide: hidePanel, show: showPanel }) {
  panel = { hide: hidePanel, show: showPanel };
  return make(
    "section",
    { "aria-label": t("Changes of the map") },
    make("h2", {}, t("Changes of the map")),
    note,
    list,
    make("div", { class: "row" }, all, again),
  );
}

export async function refresh() {
  clearTimeout(retry);
  set(shown, { hidden: true });
  asks += 1;
  const own = asks;
  const isLate = () => own !== asks; // the panel has been closed meanwhile
  try {
    const changes = await get("/map/changes");
    if (!isLate()) show(changes);
  } catch (error) {
    if (isLate()) return;
    show({ areas: [], listing: null, accepted: true });
    setText(note, capitalised(error.message));
    // At a site that was just entered the map is there with the next image.
    if (error.status === 409) retry = setTimeout(refresh, RETRY_MS);
  }
}

// The panel is closed. Returns whether a change is looked at on the map, which stays drawn then.
export function hide() {
  clearTimeout(retry);
  asks += 1;
  if (!shown.hidden) return true;
  listed = { areas: [], listing: null };
  redraw();
  return false;
}

// What was listed is of another site.
export function forget() {
  set(shown, { hidden: true });
  hide();
}

function lookAt(area, text, place, accept) {
  const back = () => {
    set(shown, { hidden: true });
    panel.show();
  };
  shown.replaceChildren(
    make("p", { "data-testid": "change-text" }, text),
    make("button", { "data-testid": "change-shown-accept", onclick: () => accept().then(back) }, t("Accept")),
    make("button", { "data-testid": "change-back", onclick: back }, t("Back to the list")),
  );
  shown.onkeydown = (event) => {
    if (event.key !== "Escape") return;
    event.stopPropagation();
    back();
  };
  looked = area;
  set(shown, { hidden: false });
  panel.hide();
  showMap();
  centreOn(place);
  shown.querySelector("button").focus();
}

function show(changes) {
  listed = changes;
  // A list that is read again stays as it is: an item that is replaced would lose a click that is under way.
  reconcile(list, changes.areas, keyOf, itemOf, () => {});
  const more = changes.left_out
    ? ` ${t("The {n} smallest are left out.", { n: changes.left_out })}`
    : "";
  setText(
    note,
    !changes.accepted
      ? t("No map has been accepted yet. What is accepted now is what later maps are compared with.")
      : changes.areas.length
        ? inWords(changes.areas.length) + more
        : t("The map is as it was accepted."),
  );
  redraw();
}

const inWords = (count) =>
  tn("{n} area differs from the accepted map.", "{n} areas differ from the accepted map.", count);

function middleOf(outline) {
  const sum = outline.reduce(([x, y], [px, py]) => [x + px, y + py], [0, 0]);
  return sum.map((value) => value / outline.length);
}

const keyOf = ({ id, kind, area_m2, outline }) => [id, kind, area_m2, ...middleOf(outline)].join(" ");

function itemOf(area) {
  const [x, y] = middleOf(area.outline);
  const text = `${TEXTS[area.kind]}, ${number(area.area_m2, 2)} m²`;
  const place = `(${x.toFixed(1)}, ${y.toFixed(1)})`;
  const accept = make("button", { "data-testid": "change-accept" }, t("Accept"));
  accept.setAttribute("aria-label", t("Accept: {text} at {place}", { text, place }));
  const acceptThis = () => attempt(() => acceptAreas(listed.listing, [area.id]));
  accept.onclick = acceptThis;
  const where = make(
    "button",
    { title: t("Show it on the map"), "aria-label": t("Show on the map: {text} at {place}", { text, place }) },
    place,
  );
  where.onclick = () => lookAt(area, text, [x, y], acceptThis);
  const label = make("span", { class: "label" }, text);
  return make("li", { "data-testid": "change", "data-kind": area.kind }, label, where, accept);
}

async function acceptAreas(listing, areas) {
  show(await post("/map/changes/accept", { listing, areas }));
  notify(t("Accepted."), { good: true });
}

all.onclick = () => attempt(() => acceptAreas(null, []));
again.onclick = () => attempt(refresh);
// Dashed, and red or blue: the colour is not the only sign, the list names the kind. The one that is
// looked at is drawn through and thick.
overlays.push(({ line }) => {
  for (const area of listed.areas)
    if (area === looked) line(area.outline, COLOURS[area.kind], 2 * WIDTH_PX, [], true);
    else line(area.outline, COLOURS[area.kind], WIDTH_PX, DASH, true);
});
