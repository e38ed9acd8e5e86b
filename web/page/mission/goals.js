// The goals that wait: picked, named, ordered, looped, kept; and the offer of a better place when one is refused.

import { post, request } from "../core/api.js";
import { element, make, reconcile, set, setText, setValue, spent } from "../core/dom.js";
import { rounded } from "../core/geometry.js";
import { shelf } from "../core/saved_list.js";
import { attempt, say } from "../core/toasts.js";

export const offer = { place: null, yaw: null };
const watchers = [];
export const onOffer = (watcher) => watchers.push(watcher);
let ids = [];

// Whether it was taken.
export async function addGoal([x, y], yaw = null, name = "") {
  setOffer(null);
  try {
    await post("/goals", { x_m: rounded(x), y_m: rounded(y), yaw_rad: yaw, name });
    return true;
  } catch (error) {
    const nearest = error.body?.nearest;
    if (!nearest) { say(error.message); return false; }
    setOffer([nearest.x_m, nearest.y_m], yaw);
    say(error.message, { action: { label: `Take ${nearest.x_m.toFixed(2)}, ${nearest.y_m.toFixed(2)}`, act: takeOffer } });
    return false;
  }
}

export function takeOffer() { if (offer.place) addGoal(offer.place, offer.yaw); }

function setOffer(place, yaw = null) {
  Object.assign(offer, { place, yaw });
  for (const watcher of watchers) watcher();
}

export const degrees = (yaw) => `${Math.round((yaw * 180) / Math.PI)}°`;

export function showGoals(state) {
  ids = state.queue.map((goal) => goal.id);
  const waiting = state.queue.map((goal, i) => ({ ...goal, number: i + 1 }));
  const reached = state.reached.slice(-5).reverse().map((goal) => ({ ...goal, number: 0 }));
  reconcile(element("goals"), [...waiting, ...reached], (goal) => `${goal.number ? "w" : "r"}${goal.id}`, goalItem, (child, goal) => {
    setText(child.querySelector(".number"), goal.number ? `⚑ ${goal.number}` : "✓");
    const name = child.querySelector(".name");
    if (name) setValue(name, goal.name);
    else setText(child.querySelector(".place"), `${goal.name} ${spot(goal)}`);
    setText(child.querySelector(".present"), goal.number === 1 ? (state.moving ? "driving here" : "next") : goal.number ? "" : "reached");
    const up = child.querySelector("[data-up]");
    if (up) set(up, { disabled: goal.number === 1 });
  });
  set(element("no-goals"), { hidden: waiting.length + reached.length > 0 });
  setText(element("goal-count"), `${waiting.length} waiting · ${state.reached.length} reached`);
  if (!looping) element("loop").checked = state.loop;
}

const spot = (goal) => `${goal.x_m.toFixed(2)}, ${goal.y_m.toFixed(2)}${goal.yaw_rad === null ? "" : ` ∠ ${degrees(goal.yaw_rad)}`}`;

function goalItem(goal) {
  const item = make("li", { "data-testid": goal.number ? "goal" : "goal-reached", class: goal.number ? "" : "reached" });
  item.append(make("span", { class: "number" }));
  if (!goal.number) {
    item.append(make("span", { class: "place" }), make("span", { class: "present" }));
    return item;
  }
  const where = spot(goal);
  const rename = (event) => attempt(() => request("PATCH", `/goals/${goal.id}`, { name: event.target.value.trim() }));
  const up = () => {
    const at = ids.indexOf(goal.id);
    const order = ids.filter((id) => id !== goal.id);
    order.splice(at - 1, 0, goal.id);
    attempt(() => request("PUT", "/goals/order", { ids: order }));
  };
  item.append(
    make("input", { class: "name", maxlength: 80, placeholder: where, title: where, "aria-label": `Name of the goal at ${where}`, "data-testid": "goal-name", onchange: rename }),
    make("span", { class: "present" }),
    make("button", { "data-up": "", "data-testid": "goal-up", title: "Earlier", "aria-label": `Drive to ${where} earlier`, onclick: up }, "↑"),
    make("button", { title: "Remove", "aria-label": `Remove the goal at ${where}`, "data-testid": "goal-remove", onclick: () => attempt(() => request("DELETE", `/goals/${goal.id}`)) }, "✕"),
  );
  return item;
}

// A state that was on its way when the box was ticked does not untick it.
let looping = false;
element("loop").onchange = async () => {
  looping = true;
  await attempt(() => request("PUT", "/mission/loop", { loop: element("loop").checked }));
  looping = false;
};
element("goal-form").addEventListener("submit", (event) => {
  event.preventDefault();
  const input = event.target.elements.place, typed = input.value;
  attempt(async () => {
    const numbers = typed.split(/[,\s]+/).filter(Boolean).map(Number);
    if (![2, 3].includes(numbers.length) || !numbers.every(Number.isFinite)) throw new Error(`“${typed}” is no goal; write x, y in metres and, if it matters, the heading in degrees`);
    if (await addGoal(numbers, numbers.length === 3 ? (numbers[2] * Math.PI) / 180 : null)) spent(input, typed);
  });
});
shelf(element("missions"), { path: "/missions", take: "load", verb: "Load", placeholder: "Name for the waiting goals", words: (entry) => `${entry.goals} goal${entry.goals > 1 ? "s" : ""}${entry.loop ? ", again and again" : ""}` });
