// What is typed and pressed in the zone's form acts on the draft.

import { element } from "../core/dom.js";
import { changed, draft, finish, redo, setMode, setTool, snapshot, undo } from "./draft.js";
import { note, parseCorners, showKind } from "./draft_form.js";

const field = (name) => element(`draft-${name}`);

field("corners").addEventListener("change", () => {
  try {
    const corners = parseCorners(field("corners").value);
    snapshot();
    if (draft.tool === "circle" && corners.length) draft.corners = [corners[0], [corners[0][0] + (Number(field("size").value) || 0.5), corners[0][1]]];
    else draft.corners = corners;
    changed();
  } catch (error) { note(error.message, true); }
});
field("size").addEventListener("change", () => {
  const size = Number(field("size").value);
  if (!(size > 0)) return;
  snapshot();
  if (draft.tool === "circle" && draft.corners.length) draft.corners[1] = [draft.corners[0][0] + size, draft.corners[0][1]];
  else draft.width = size;
  changed();
});
field("tool").addEventListener("change", () => setTool(field("tool").value));
field("kind").addEventListener("change", () => { showKind(); changed(); });
field("colour").addEventListener("input", () => { field("colour").dataset.own = "true"; });
for (const name of ["margin", "limit", "name"]) field(name).addEventListener("change", changed);
element("draft").addEventListener("submit", (event) => {
  event.preventDefault();
  for (const name of ["corners", "size"]) field(name).blur();
  finish();
});
field("undo").onclick = undo;
field("redo").onclick = redo;
field("cancel").onclick = () => setMode("navigate");
