// What was recognised: how many of each class, a card with picture and place of each thing; "wrong" and "add" teach the next training.

import { get, post } from "../core/api.js";
import { age, make, setText } from "../core/dom.js";
import { PATTERNS } from "../beware/beware_list.js";
import { attempt, say } from "../core/toasts.js";

let shared;
let tab;
let counts;
let cards;
let folder;
let teach;
let busy = false;
let shownIds = "";
let turns = 0;
// With its tab closed the counts in the beware list and on the tab follow more slowly.
const EVERY = 5;

export function build(pane, context, button) {
  shared = context;
  tab = button;
  counts = make("div", { class: "counts", "data-testid": "seen-counts" });
  cards = make("ul", { class: "cards", "data-testid": "sightings" });
  folder = make("p", { class: "soft", "data-testid": "labelling" });
  teach = make("div", { class: "teach", hidden: "" });
  const add = make("button", { "data-testid": "teach-open", title: "Show the robot something that it did not recognise", onclick: () => attempt(openTeach) }, "+ Add a missed thing");
  pane.append(make("div", { class: "head" }, counts, add), teach, cards, folder);
}

export async function tick(open) {
  turns += 1;
  if (busy || (!open && turns % EVERY)) return;
  busy = true;
  try { draw(await get("/sightings")); } catch { /* a lost connection has its own banner */ }
  busy = false;
}

const entryOf = (id) => shared.beware.classes.find((entry) => entry.class_id === id);

function swatch(id) {
  const node = make("span", { class: "swatch", "data-pattern": PATTERNS[(id - 1) % PATTERNS.length] });
  node.style.setProperty("--c", entryOf(id)?.display ?? "#888888");
  return node;
}

function draw({ seen, sightings, labelling }) {
  const total = Object.values(seen).reduce((sum, count) => sum + count, 0);
  const title = total ? `Seen · ${total}` : "Seen";
  if (tab.textContent !== title) tab.textContent = title;
  const numbers = JSON.stringify(seen);
  if (counts.dataset.numbers !== numbers) {
    counts.dataset.numbers = numbers;
    counts.replaceChildren(...Object.entries(seen).map(([id, count]) => make("span", { class: "count", "data-class": id }, swatch(Number(id)), `${count} × ${entryOf(Number(id))?.name ?? `class ${id}`}`)));
    if (!total) counts.replaceChildren(make("span", { class: "soft" }, "Nothing of the beware list was recognised yet."));
  }
  tellBewareList(seen);
  // Cards are made anew only when their set or a verdict changes: a choice half made is not wiped.
  const ids = sightings.map((one) => `${one.id}${one.verdict ?? ""}`).join();
  if (ids !== shownIds) { shownIds = ids; cards.replaceChildren(...sightings.map(card)); }
  sightings.forEach((one, i) => { setText(cards.children[i].querySelector(".soft"), `${one.looks} looks · ${age(one.age_s ?? 0)} ago`); });
  setText(folder, `${labelling.pictures} of at most ${labelling.max_pictures} corrected pictures, ${(labelling.bytes_used / 1e6).toFixed(1)} MB, wait for the next training in ${labelling.folder}`);
}

// The count beside each class of the beware list.
function tellBewareList(seen) {
  for (const item of document.getElementById("beware").children) {
    const entry = shared.beware.classes.find((one) => one.name === item.dataset.name);
    let note = item.querySelector(".seen");
    if (!note) { note = make("span", { class: "seen", "data-testid": "seen-count", title: "How many were recognised so far" }); item.querySelector(".label").after(note); }
    const words = entry && seen[entry.class_id] ? `${seen[entry.class_id]} seen` : "";
    if (note.textContent !== words) note.textContent = words;
  }
}

function card(one) {
  const picture = make("img", { src: `/api/v1/sightings/${one.id}/picture.jpg`, alt: `${one.class_name}, as the camera saw it`, loading: "lazy" });
  const [x, y] = one.place;
  const choice = make("select", { "aria-label": `What it is instead of ${one.class_name}`, "data-testid": "wrong-choice" }, make("option", { value: "" }, "wrong: it is …"), make("option", { value: "-" }, "nothing of the list"),
    ...shared.beware.classes.filter((entry) => entry.name !== one.class_name).map((entry) => make("option", { value: entry.name }, entry.name)));
  choice.onchange = () => attempt(async () => {
    await post(`/sightings/${one.id}/wrong`, { class_name: choice.value === "-" ? null : choice.value });
    say("Its picture waits, corrected, for the next training.", { good: true });
    await tick(true);
  });
  const name = make("div", { class: "name" }, swatch(one.class_id), make("b", {}, one.class_name), make("span", {}, `${Math.round(100 * one.confidence)} %`));
  return make("li", { class: one.verdict ?? "", "data-testid": "sighting", "data-class": one.class_name }, picture, name,
    make("span", { class: "soft" }), make("button", { class: "jump", "data-testid": "sighting-jump", onclick: () => shared.look(one.place) }, `◎ ${x.toFixed(1)}, ${y.toFixed(1)}`),
    one.verdict ? make("span", { class: "verdict" }, "✕ called wrong") : choice);
}

// A frozen picture on which the operator drags a box: the robot keeps the same one.
async function openTeach() {
  const { snapshot } = await post("/sightings/snapshots");
  const picture = make("img", { src: `/api/v1/sightings/snapshots/${snapshot}.jpg`, alt: "The camera's picture, frozen", draggable: "false", "data-testid": "teach-picture" });
  const frame = make("div", { class: "box", hidden: "" });
  const stage = make("div", { class: "frozen" }, picture, frame);
  const choice = make("select", { "aria-label": "What it is", "data-testid": "teach-class" }, ...shared.beware.classes.map((entry) => make("option", { value: entry.name }, entry.label ?? entry.name)));
  const done = make("button", { class: "primary", disabled: "", "data-testid": "teach-add" }, "Add");
  const close = () => { teach.hidden = true; teach.replaceChildren(); };
  let box = null;
  stage.onpointerdown = (event) => {
    const area = picture.getBoundingClientRect();
    const at = (e) => [Math.min(Math.max(e.clientX - area.left, 0), area.width), Math.min(Math.max(e.clientY - area.top, 0), area.height)];
    const from = at(event);
    stage.setPointerCapture(event.pointerId);
    stage.onpointermove = (moved) => {
      const to = at(moved);
      const [left, top, right, low] = [Math.min(from[0], to[0]), Math.min(from[1], to[1]), Math.max(from[0], to[0]), Math.max(from[1], to[1])];
      Object.assign(frame.style, { left: `${left}px`, top: `${top}px`, width: `${right - left}px`, height: `${low - top}px` });
      frame.hidden = false;
      const [sx, sy] = [picture.naturalWidth / area.width, picture.naturalHeight / area.height];
      box = [Math.floor(left * sx), Math.floor(top * sy), Math.min(Math.ceil(right * sx), picture.naturalWidth), Math.min(Math.ceil(low * sy), picture.naturalHeight)];
      done.disabled = box[2] - box[0] < 6 || box[3] - box[1] < 6;
    };
    stage.onpointerup = () => { stage.onpointermove = null; };
  };
  done.onclick = () => attempt(async () => {
    await post("/sightings", { snapshot, class_name: choice.value, box });
    say(`A ${choice.value} that was missed waits for the next training.`, { good: true });
    close();
    await tick(true);
  });
  const tools = make("div", { class: "tools" }, make("p", {}, "Drag a box round the thing that was missed, say what it is."), choice, done, make("button", { onclick: close }, "Cancel"));
  teach.replaceChildren(stage, tools);
  teach.hidden = false;
}
