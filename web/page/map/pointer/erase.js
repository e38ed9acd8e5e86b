// Erasing from the map, with its undo. What the camera sees there later comes back.

import { edit, get, post } from "../../core/link/api.js";
import { sentence, t } from "../../core/text/language.js";
import { attempt, notify } from "../../core/toasts.js";
import { offerUndo } from "../../core/undo.js";

const RADIUS_M = 0.3;
const CHOICES = [
  ["both", t("⌫ Everything"), t("Everything on the map there is erased.")],
  ["geometry", t("⌫ Obstacles only"), t("The obstacles there are erased.")],
  ["beware", t("⌫ What the robot bewares of only"), t("What the robot bewares of there is erased.")],
];

export const discAt = ([x, y]) => ({ type: "Point", coordinates: [x, y], radius_m: RADIUS_M });

// The choices of what to erase in a geometry, as items of a menu; `then` runs after a choice.
export const choicesFor = (geometry, then = () => {}) =>
  CHOICES.map(([what, text, done]) => {
    const run = () => {
      erase(geometry, what, done);
      then();
    };
    return [`erase-${what}`, text, run];
  });

// Undo and redo of the edits of the map by any operator, as items of a menu.
export async function historyItems() {
  const { undo, redo } = await get("/map/edits").catch(() => ({}));
  const items = [];
  if (undo) items.push(["edit-undo", `↶ ${t("Undo")}: ${sentence(undo)}`, () => step("undo")]);
  if (redo) items.push(["edit-redo", `↷ ${t("Redo")}: ${sentence(redo)}`, () => step("redo")]);
  return items;
}

function erase(geometry, what, done) {
  return attempt(async () => {
    const made = await edit("POST", "/map/erase", { geometry, what });
    offerUndo(`${done} ${t("What the camera sees there comes back.")}`, made);
  });
}

function step(action) {
  return attempt(async () => {
    await post(`/map/${action}`);
    notify(action === "undo" ? t("It is back on the map.") : t("It is done again."), { good: true });
  });
}
