// "Not one": what was taken for a class is none; its place is free, and it takes better evidence
// there.

import { classTitle } from "../../beware/class_title.js";
import { edit } from "../../core/link/api.js";
import { t } from "../../core/text/language.js";
import { attempt } from "../../core/toasts.js";
import { offerUndo } from "../../core/undo.js";

// Reject by a route of the API; `then` runs after it.
export const reject = (path, body, name, then = () => {}) =>
  attempt(async () => {
    const done = body.all_of_class
      ? t("Every place of a {name} is free.", { name })
      : t("The place of the {name} is free.", { name });
    const made = await edit("POST", path, body);
    offerUndo(`${done} ${t("It counts there only when the robot is surer.")}`, made);
    await then();
  });

// The items of a menu for a class that the map holds at a place.
export function rejectItems(entry, [x, y]) {
  const { class_id } = entry;
  const shown = classTitle(entry);
  const run = (isAll) => () =>
    reject("/map/reject", { class_id, at: [x, y], all_of_class: isAll }, shown);
  return [
    ["not-one", `${t("✕ Not one")} (${shown})`, run(false)],
    ["none-of-kind", `${t("✕ None of this kind")} (${shown})`, run(true)],
  ];
}
