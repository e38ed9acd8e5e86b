// The order of the rows: a handle that is dragged, or moved by the arrow keys.

import { make } from "../core/dom.js";
import { t } from "../core/text/language.js";

const rowAt = (list, y) =>
  [...list.children].find((row) => {
    const { top, bottom } = row.getBoundingClientRect();
    return y >= top && y < bottom;
  });

// Give a row the place of another one. The row itself stays in the document, or it would lose the
// pointer and the focus.
function moveTo(row, other) {
  const rows = [...row.parentElement.children];
  const [from, to] = [rows.indexOf(row), rows.indexOf(other)];
  if (from < to) row.before(...rows.slice(from + 1, to + 1));
  else row.after(...rows.slice(to, from));
}

// A handle for a row; `store` is called when the row has another place.
export function handleOf(row, name, store) {
  const title = t("Drag to reorder {name}, or press ↑ or ↓", { name });
  const handle = make(
    "button",
    { class: "handle", type: "button", title, "aria-label": title, "data-testid": "beware-handle" },
    "⠿",
  );
  let from = null;
  const place = () => [...row.parentElement.children].indexOf(row);

  handle.onpointerdown = (event) => {
    handle.setPointerCapture(event.pointerId);
    from = place();
    row.classList.add("dragged");
  };
  handle.onpointermove = (event) => {
    if (from === null) return;
    const other = rowAt(row.parentElement, event.clientY);
    if (other && other !== row) moveTo(row, other);
  };
  const end = () => {
    row.classList.remove("dragged");
    if (from !== null && from !== place()) store();
    from = null;
  };
  handle.onpointerup = end;
  handle.onpointercancel = end;
  handle.onkeydown = (event) => {
    const other = { ArrowUp: row.previousElementSibling, ArrowDown: row.nextElementSibling }[event.key];
    if (!other) return;
    event.preventDefault();
    event.stopPropagation();
    moveTo(row, other);
    store();
  };
  return handle;
}
