// For admins: who did what and when, newest first, by name and time.

import { get } from "../core/api.js";
import { make } from "../core/dom.js";
import { attempt } from "../core/toasts.js";

const PART = 100;
const who = make("input", { list: "audit-names", maxlength: 60, placeholder: "anybody", "data-testid": "audit-who" });
const names = make("datalist", { id: "audit-names" });
const since = make("input", { type: "datetime-local", "data-testid": "audit-since" });
const until = make("input", { type: "datetime-local", "data-testid": "audit-until" });
const list = make("ol", { class: "audit", "data-testid": "audit", "aria-label": "Who did what, newest first" });
const empty = make("p", { class: "empty" }, "Nothing was done then by whoever this is.");
const more = make("button", { type: "button", "data-testid": "audit-older", onclick: () => load(list.lastElementChild?.dataset.id) }, "Older ↓");

export function build(pane) {
  const form = make("form", { class: "row", autocomplete: "off" },
    make("label", { class: "field" }, "Who", who), names,
    make("label", { class: "field" }, "From", since), make("label", { class: "field" }, "Until", until),
    make("button", { class: "primary", "data-testid": "audit-show" }, "Show"), more);
  form.onsubmit = (event) => { event.preventDefault(); refresh(); };
  for (const field of [who, since, until]) field.onchange = () => refresh();
  pane.append(form, list, empty);
}

// Names to choose from.
export function name(known) { names.replaceChildren(...known.map((value) => make("option", { value }))); }

export const refresh = () => load();

function load(before) {
  const asked = new URLSearchParams({ count: PART });
  if (before) asked.set("before", before);
  if (who.value.trim()) asked.set("who", who.value.trim());
  for (const [key, field] of [["since", since], ["until", until]]) if (field.value) asked.set(key, new Date(field.value).toISOString());
  return attempt(async () => {
    const entries = await get(`/audit?${asked}`);
    if (!before) list.replaceChildren();
    list.append(...entries.map(item));
    more.hidden = entries.length < PART;
    empty.hidden = list.children.length > 0;
  });
}

function item(entry) {
  const at = new Date(entry.at);
  const detail = entry.detail === undefined ? "" : typeof entry.detail === "string" ? entry.detail : JSON.stringify(entry.detail);
  const what = `${entry.method ?? ""} ${(entry.path ?? "").replace("/api/v1", "")}`;
  return make("li", { "data-testid": "audit-entry", "data-id": entry.id },
    make("time", { datetime: entry.at }, at.toLocaleString([], { hour12: false })),
    make("b", { title: entry.role ?? entry.from ?? "" }, entry.who ?? "–"),
    make("span", { class: "what", title: detail }, what, make("small", {}, detail)),
    make("span", { class: entry.status >= 400 ? "refused" : "outcome" }, outcome(entry.status)));
}

function outcome(status) {
  if (status === undefined) return "";
  return status < 400 ? "✓ done" : `✕ refused, ${status}`;
}
