// Undo and redo of the operators' edits, whether of zones, beware list, map or path settings.

import { get, post } from "./api.js";
import { sentence, t } from "./language.js";
import { attempt, notify } from "./toasts.js";

const DONE = { undo: t("Undone"), redo: t("Redone") };

export const stepEdits = (action, query = "") =>
  attempt(async () => {
    const { text } = await post(`/edits/${action}${query}`);
    notify(`${DONE[action]}: ${sentence(text)}`, { good: true });
  });

// Say what was done, with a button that takes it back, but no edit that was made since.
export async function offerUndo(text) {
  const { undo_number: number } = await get("/edits");
  const run = () => stepEdits("undo", `?number=${number}`);
  notify(text, { good: true, action: { label: t("Undo"), run } });
}
