// What is selected on the map and in the lists: a zone, a goal, a sighting or a person. Its row and
// its shape light up together.

import { world } from "../world.js";

// `kind`: "zone", "goal", "sighting", "person" or null.
export const selection = { kind: null, id: null };
// What lies below a mouse that only looks.
export const hovered = { kind: null, id: null };
const listeners = [];
// List of the page → kind of what its rows show.
const LISTS = { zones: "zone", goals: "goal" };

export const onSelect = (listener) => listeners.push(listener);
export const isSelected = (kind, id) => selection.kind === kind && selection.id === id;
export const isLit = (kind, id) =>
  isSelected(kind, id) || (hovered.kind === kind && hovered.id === id);

export function select(target) {
  Object.assign(selection, { kind: target?.kind ?? null, id: target?.id ?? null });
  lightRows(true);
  for (const listener of listeners) listener(selection);
}

// Returns whether something else is below the pointer now.
export function hover(target) {
  const [kind, id] = [target?.kind ?? null, target?.id ?? null];
  if (hovered.kind === kind && hovered.id === id) return false;
  Object.assign(hovered, { kind, id });
  return true;
}

// Mark the row of what is selected; called again when the lists have changed.
export function lightRows(scrolls = false) {
  for (const [listId, kind] of Object.entries(LISTS)) {
    for (const row of document.getElementById(listId).children) {
      const isLitRow = row.item && isSelected(kind, row.item.id) && !row.matches(".reached");
      row.classList.toggle("selected", Boolean(isLitRow));
      if (isLitRow && scrolls) row.scrollIntoView({ block: "nearest" });
    }
  }
}

// The selected thing as it is now, or null where it has gone.
export function selectedItem() {
  const { kind, id } = selection;
  const items = {
    zone: world.zones,
    goal: world.state?.queue ?? [],
    sighting: world.sightings,
    person: world.people,
  }[kind];
  return items?.find((item) => item.id === id) ?? null;
}

for (const [listId, kind] of Object.entries(LISTS)) {
  document.getElementById(listId).addEventListener("click", (event) => {
    const row = event.target.closest("li");
    if (!row?.item || event.target.closest("button, input[type=checkbox]")) return;
    select({ kind, id: row.item.id });
  });
}
