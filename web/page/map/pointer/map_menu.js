// The menu of a point of the map, by right click, long press or the menu key: what is there, and what
// can be done with it.

import { request, siteHeader } from "../../core/link/api.js";
import { element, make } from "../../core/dom.js";
import { t } from "../../core/text/language.js";
import { attempt, notify } from "../../core/toasts.js";
import { addGoal } from "../../mission/goals.js";
import { proposeCircle, setMode } from "../../zones/draft.js";
import { removeZone, switchZone } from "../../zones/zones.js";
import { choicesFor, discAt, historyItems } from "./erase.js";
import { startMeasuring, startPlacing } from "./pick.js";
import { rejectItems } from "./reject.js";
import { select } from "./selection.js";
import { classAt, describe, targetAt } from "./targets.js";
import { canvas, toWorld } from "../view.js";
import { world } from "../world.js";

const menu = element("map-menu");
const EDGE_PX = 8;
let openedAt = [0, 0];

const isViewer = () => document.body.dataset.role === "viewer";
const nameOf = (item) =>
  item.name || t("the goal at {place}", { place: `${item.x_m.toFixed(1)}, ${item.y_m.toFixed(1)}` });

// Items of the menu as [test id, text, action].
function itemsOf(at, target) {
  const { kind, item } = target ?? {};
  const items = [];
  const add = (id, text, act) => items.push([id, text, act]);
  if (!isViewer()) {
    if (kind === "zone") {
      const { name, enabled } = item.properties;
      add("edit-zone", t("Edit zone “{name}”", { name }), () => setMode("edit", item));
      add("switch-zone", enabled ? t("Switch it off") : t("Switch it on"), () => switchZone(item, !enabled));
      add("delete-zone", t("Delete it"), () => removeZone(item));
      add("erase-zone", t("⌫ Erase inside it …"), () => choose(choicesFor(item.geometry)));
    }
    if (kind === "goal") {
      add("goal-first", t("Drive to {name} first", { name: nameOf(item) }), () => driveFirst(item));
      add("goal-delete", t("Remove this goal"), () =>
        attempt(() => request("DELETE", `/goals/${item.id}`)),
      );
    }
    add("goal-here", t("⚑ Goal here"), () => addGoal(at));
    add("zone-here", t("⬠ Zone here"), () => proposeCircle(at));
    const held = classAt(at);
    if (held) items.push(...rejectItems(held, at));
    add("erase-here", t("⌫ Erase here …"), () => choose(choicesFor(discAt(at))));
    add("robot-here", t("◎ The robot is here …"), () => startPlacing(at));
  }
  add("measure", t("↔ Measure from here"), () => startMeasuring(at));
  return items;
}

function driveFirst(goal) {
  const ids = world.state.queue.map(({ id }) => id).filter((id) => id !== goal.id);
  attempt(() => request("PUT", "/goals/order", { ids: [goal.id, ...ids] }));
}

// Open the menu for a pixel of the canvas.
export function openMenu([px, py], { byKeyboard = false } = {}) {
  if (!world.map) return;
  const at = toWorld(px, py);
  const target = targetAt([px, py]);
  select(target);
  const place = `x ${at[0].toFixed(2)}, y ${at[1].toFixed(2)} m`;
  const edits = make("div", { class: "edits" });
  menu.replaceChildren(
    make("p", { class: "what", "data-testid": "map-menu-what" }, describe(at, target)),
    make("p", {}, place),
    ...itemsOf(at, target).map(buttonOf),
    edits,
  );
  if (!isViewer()) showHistory(edits);
  openedAt = [px, py];
  show(px, py);
  if (byKeyboard) menu.querySelector("button").focus();
}

// The undo and redo of the map's edits, as soon as the console has said what they are.
async function showHistory(edits) {
  edits.replaceChildren(...(await historyItems()).map(buttonOf));
  if (edits.isConnected && menu.matches(":popover-open")) show(...openedAt);
}

// Ask for one of some items where the menu was, the first of which has the focus.
function choose(items) {
  menu.replaceChildren(...items.map(buttonOf));
  show(...openedAt);
  menu.querySelector("button").focus();
}

// Ask what to erase in a geometry, beside a button of the page; `then` runs after a choice.
export function askWhatToErase(geometry, button, then) {
  const [box, own] = [canvas.getBoundingClientRect(), button.getBoundingClientRect()];
  openedAt = [own.left - box.left, own.top - box.top];
  choose(choicesFor(geometry, then));
}

function buttonOf([id, text, act]) {
  const run = () => {
    closeMenu();
    act();
  };
  return make("button", { role: "menuitem", "data-testid": `map-${id}`, onclick: run }, text);
}

// Beside the point, inside the window and above the stop of a narrow one.
function show(px, py) {
  const box = canvas.getBoundingClientRect();
  if (!menu.matches(":popover-open")) menu.showPopover();
  const stop = element("stop").getBoundingClientRect();
  const floor = stop.top > box.top ? Math.min(stop.top, innerHeight) : innerHeight;
  const fit = (value, size, end) => Math.max(Math.min(value, end - size - EDGE_PX), EDGE_PX);
  menu.style.left = `${fit(box.left + px + 2, menu.offsetWidth, innerWidth)}px`;
  menu.style.top = `${fit(box.top + py + 2, menu.offsetHeight, floor)}px`;
}

export function closeMenu() {
  if (menu.matches(":popover-open")) menu.hidePopover();
}

menu.addEventListener("keydown", (event) => {
  const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
  if (!step) return;
  event.preventDefault();
  event.stopPropagation();
  const buttons = [...menu.querySelectorAll("button")];
  const at = buttons.indexOf(document.activeElement);
  buttons.at((at + step) % buttons.length).focus();
});
menu.addEventListener("beforetoggle", (event) => {
  if (event.newState === "closed" && menu.contains(document.activeElement)) canvas.focus();
});
for (const kind of ["pointerdown", "wheel"])
  window.addEventListener(
    kind,
    (event) => {
      if (!menu.contains(event.target)) closeMenu();
    },
    { capture: true, passive: true },
  );
window.addEventListener("resize", closeMenu);

// Move a goal; one click takes it back. Every site counts its goals from 1: the goal is that of the
// present site, also later.
export async function moveGoal(goal, [x, y]) {
  const site = siteHeader();
  const put = (toX, toY) => request("PATCH", `/goals/${goal.id}`, { x_m: toX, y_m: toY }, site);
  await attempt(async () => {
    await put(x, y);
    notify(t("The goal is moved."), {
      good: true,
      action: { label: t("Undo"), run: () => attempt(() => put(goal.x_m, goal.y_m)) },
    });
  });
}
