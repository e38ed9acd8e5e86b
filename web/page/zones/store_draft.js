// Storing a finished draft as a zone.

import { post, request } from "../core/link/api.js";
import { capitalised, t } from "../core/text/language.js";
import { notify } from "../core/toasts.js";
import { asZone, draft, isComplete, isDrawing, setMode } from "./draft.js";
import { isReadable, missingOf, note } from "./draft_form.js";

let pending = null;

// The request that is on its way, or null. Until its answer the draft stands, and what a key begins
// meanwhile has to wait. What the pointer begins is another draft, which the answer leaves alone.
export const pendingStore = () => pending;

export function finish() {
  if (!isDrawing() || pending) return;
  if (!isComplete()) {
    note(t("The zone is not complete: {missing}.", { missing: missingOf(draft) }), true);
    return;
  }
  if (!isReadable()) return;
  pending = store().finally(() => {
    pending = null;
  });
}

async function store() {
  const zone = asZone();
  const { number } = draft;
  const isShown = () => draft.number === number;
  try {
    if (draft.mode === "draw") await post("/zones", zone);
    else
      await request("PUT", `/zones/${encodeURIComponent(draft.id)}`, zone, {
        "If-Match": `"${draft.version}"`,
      });
    const { name, enabled } = zone.properties;
    const done = enabled
      ? t("Zone “{name}” is in force.", { name })
      : t("Zone “{name}” is stored; switch it on to put it in force.", { name });
    notify(done, { good: true });
    if (isShown()) setMode("navigate");
  } catch (error) {
    notify(error.message);
    if (!isShown()) return;
    if (error.body?.error?.code === "outdated") {
      draft.version = error.body.stored_version;
      note(
        t("This zone has changed meanwhile: another user has edited it, or it has moved with the map. Finish again to replace that version, Cancel to keep it."),
        true,
      );
    } else {
      note(capitalised(error.message), true);
    }
  }
}
