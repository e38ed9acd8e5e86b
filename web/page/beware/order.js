// The order of the rows: a handle that is dragged, or moved by the arrow keys.

import { make } from "../core/dom.js";
import { t } from "../core/language.js";

const rowAt = (list, y) =>
  [...list.children].find((row) => {
    const { top, bottom } = row.getBoundingClientRect();
    return y >= top && y < bottom;
  });

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
    if (!other || other === row) return;
    if (place() < [...row.parentElement.children].indexOf(other)) other.after(row);
    else other.before(row);
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
    if (event.key === "ArrowUp") other.before(row);
    else other.after(row);
    handle.focus();
    store();
  };
  return handle;
}
