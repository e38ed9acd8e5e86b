// Input in the form of a draft changes the draft.

import { element } from "../core/dom.js";
import { askWhatToErase } from "../map/pointer/map_menu.js";
import { asZone, changed, draft, redo, setMode, setTool, snapshot, undo } from "./draft.js";
import { field, note, showKind, typedCorners } from "./draft_form.js";
import { finish } from "./store_draft.js";

const DEFAULT_RADIUS_M = 0.5;

field("corners").addEventListener("focus", snapshot);
// While it is typed the draft follows; what is not readable yet is reported at the end.
for (const kind of ["input", "change"])
  field("corners").addEventListener(kind, () => takeCorners(kind === "change"));

function takeCorners(isEnd) {
  try {
    const corners = typedCorners();
    if (draft.tool === "circle" && corners.length) {
      const [x, y] = corners[0];
      draft.corners = [
        [x, y],
        [x + (Number(field("size").value) || DEFAULT_RADIUS_M), y],
      ];
    } else {
      draft.corners = corners;
    }
    changed();
  } catch (error) {
    if (isEnd) note(error.message, true);
  }
}
field("size").addEventListener("change", () => {
  const size = Number(field("size").value);
  if (!(size > 0)) return;
  snapshot();
  if (draft.tool === "circle" && draft.corners.length)
    draft.corners[1] = [draft.corners[0][0] + size, draft.corners[0][1]];
  else draft.width = size;
  changed();
});
field("tool").addEventListener("change", () => setTool(field("tool").value));
field("kind").addEventListener("change", () => {
  showKind();
  changed();
});
field("colour").addEventListener("input", () => {
  field("colour").dataset.own = "true";
});
for (const name of ["margin", "limit", "name"]) field(name).addEventListener("change", changed);
element("draft").addEventListener("submit", (event) => {
  event.preventDefault();
  for (const name of ["corners", "size"]) field(name).blur();
  finish();
});
field("undo").onclick = undo;
field("redo").onclick = redo;
field("erase").onclick = () =>
  askWhatToErase(asZone().geometry, field("erase"), () => setMode("navigate"));
field("cancel").onclick = () => setMode("navigate");
