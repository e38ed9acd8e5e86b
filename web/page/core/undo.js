// Undo and redo of the operators' edits, whether of zones, beware list, map or path settings.

import { post } from "./link/api.js";
import { sentence, t } from "./text/language.js";
import { attempt, notify } from "./toasts.js";

const DONE = { undo: t("Undone"), redo: t("Redone") };

export const stepEdits = (action, query = "") =>
  attempt(async () => {
    const { text } = await post(`/edits/${action}${query}`);
    notify(`${DONE[action]}: ${sentence(text)}`, { good: true });
  });

// Say what an edit has done, with a button that takes it back, but no edit that was made since. An
// edit that has changed nothing has no number.
export function offerUndo(text, { undoNumber }) {
  const run = () => stepEdits("undo", `?number=${undoNumber}`);
  notify(text, { good: true, action: undoNumber && { label: t("Undo"), run } });
}
