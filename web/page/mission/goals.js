// The queue of goals: added, named, reordered, repeated, saved; a blocked goal is offered the
// nearest free position.

import { post, request, siteHeader } from "../core/link/api.js";
import { onStale } from "../core/link/connection.js";
import { clearSent, element, make, reconcile, set, setText, setValue } from "../core/dom.js";
import { rounded } from "../core/geometry.js";
import { t, tn } from "../core/text/language.js";
import { savedList } from "../core/saved_list.js";
import { attempt, notify, showRefusal } from "../core/toasts.js";
import { typedPose } from "../core/text/typed_pose.js";

const REACHED_SHOWN = 5;
// The nearest free position to a blocked goal, or null.
export const offer = { position: null, yaw: null };
const listeners = [];
export const onOffer = (listener) => listeners.push(listener);
let ids = [];

// Returns whether the goal was accepted.
export async function addGoal([x, y], yaw = null) {
  setOffer(null);
  const site = siteHeader()["Site-Id"];
  try {
    await post("/goals", { x_m: rounded(x), y_m: rounded(y), yaw_rad: yaw });
    return true;
  } catch (error) {
    const nearest = error.body?.nearest;
    // A position that comes after a change of site is nowhere on the present map.
    if (!nearest || site !== siteHeader()["Site-Id"]) {
      showRefusal(error);
      return false;
    }
    setOffer([nearest.x_m, nearest.y_m], yaw);
    notify(error.message, {
      action: {
        label: t("Take {place}", { place: `${nearest.x_m.toFixed(2)}, ${nearest.y_m.toFixed(2)}` }),
        run: acceptOffer,
      },
    });
    return false;
  }
}

export function acceptOffer() {
  if (offer.position) addGoal(offer.position, offer.yaw);
}

export function dropOffer() {
  if (offer.position) setOffer(null);
}

function setOffer(position, yaw = null) {
  Object.assign(offer, { position, yaw });
  for (const listener of listeners) listener();
}

let phase = "";

export function showGoals(state) {
  if (state.phase !== phase) dropOffer(); // who has gone on does without it
  phase = state.phase;
  ids = state.queue.map((goal) => goal.id);
  const waiting = state.queue.map((goal, i) => ({ ...goal, number: i + 1 }));
  const reached = state.reached
    .slice(-REACHED_SHOWN)
    .reverse()
    .map((goal) => ({ ...goal, number: 0 }));
  const keyOf = (goal) => `${goal.number ? "w" : "r"}${goal.id}`;
  reconcile(element("goals"), [...waiting, ...reached], keyOf, itemOf, (child, goal) => {
    setText(child.querySelector(".number"), goal.number ? `⚑ ${goal.number}` : "✓");
    const name = child.querySelector(".name");
    if (name) {
      setValue(name, goal.name);
      showPosition(child, goal);
    } else setText(child.querySelector(".place"), `${goal.name} ${positionText(goal)}`);
    setText(child.querySelector(".status"), statusText(goal, state.phase === "driving"));
    const up = child.querySelector("[data-up]");
    if (up) set(up, { hidden: goal.number === 1 });
  });
  set(element("no-goals"), { hidden: waiting.length + reached.length > 0 });
  const counts = tn("{n} waiting · {reached} reached", "{n} waiting · {reached} reached", waiting.length, {
    reached: state.reached_count,
  });
  setText(element("goal-count"), counts);
  if (!isLoopPending) element("loop").checked = state.loop;
}

onStale(() => {
  setText(element("goal-count"), t("unknown"));
  for (const status of element("goals").querySelectorAll("li:not(.reached) .status"))
    setText(status, status.textContent && t("unknown"));
});

function statusText(goal, isDriving) {
  if (goal.number === 0) return t("reached");
  if (goal.number > 1) return "";
  return isDriving ? t("driving here") : t("next");
}

const degrees = (yaw) => `${Math.round((yaw * 180) / Math.PI)}°`;
const positionText = (goal, digits = 2) =>
  `${goal.x_m.toFixed(digits)}, ${goal.y_m.toFixed(digits)}${goal.yaw_rad === null ? "" : ` ∠ ${degrees(goal.yaw_rad)}`}`;

function itemOf(goal) {
  const item = make("li", {
    "data-testid": goal.number ? "goal" : "goal-reached",
    class: goal.number ? "" : "reached",
  });
  item.append(make("span", { class: "number" }));
  if (!goal.number) {
    item.append(make("span", { class: "place" }), make("span", { class: "status" }));
    return item;
  }
  const rename = (event) =>
    attempt(() => request("PATCH", `/goals/${goal.id}`, { name: event.target.value.trim() }));
  const remove = () => attempt(() => request("DELETE", `/goals/${goal.id}`));
  item.append(
    make("input", {
      class: "name",
      maxlength: 80,
      "data-testid": "goal-name",
      onchange: rename,
    }),
    make("span", { class: "status" }),
    make(
      "button",
      {
        "data-up": "",
        "data-testid": "goal-up",
        title: t("Drive here earlier"),
        onclick: () => moveUp(goal.id),
      },
      "↑",
    ),
    make(
      "button",
      {
        title: t("Remove"),
        "data-remove": "",
        "data-testid": "goal-remove",
        onclick: remove,
      },
      "✕",
    ),
  );
  return item;
}

// A goal moves when an operator drags it, and with corrections of the map.
function showPosition(item, goal) {
  const where = positionText(goal);
  set(item.querySelector(".name"), {
    placeholder: positionText(goal, 1), // as in messages; all of it fits beside the status
    title: where,
    ariaLabel: t("Name of the goal at {where}", { where }),
  });
  set(item.querySelector("[data-up]"), { ariaLabel: t("Drive to {where} earlier", { where }) });
  set(item.querySelector("[data-remove]"), { ariaLabel: t("Remove the goal at {where}", { where }) });
}

function moveUp(id) {
  const order = ids.filter((other) => other !== id);
  order.splice(ids.indexOf(id) - 1, 0, id);
  attempt(() => request("PUT", "/goals/order", { ids: order }));
}

// A state that was sent before the box was ticked does not untick it.
let isLoopPending = false;
element("loop").onchange = async () => {
  isLoopPending = true;
  await attempt(() => request("PUT", "/mission/loop", { loop: element("loop").checked }));
  isLoopPending = false;
};

element("goal-form").addEventListener("submit", (event) => {
  event.preventDefault();
  const input = event.target.elements.place;
  const typed = input.value;
  attempt(async () => {
    const { x_m: x, y_m: y, yaw_rad: yaw } = typedPose(typed);
    if (await addGoal([x, y], yaw)) clearSent(input, typed);
  });
});

savedList(element("missions"), {
  path: "/missions",
  action: "load",
  verb: t("Load"),
  placeholder: t("Name for the waiting goals"),
  nothing: t("Nothing is saved yet. Add goals, then save them here under a name."),
  describe: (entry) =>
    tn("{n} goal", "{n} goals", entry.goals) + (entry.loop ? `, ${t("repeated")}` : ""),
});
