// The audit log for admins: the requests of every user, newest first, by name and time.

import { get } from "../core/link/api.js";
import { make } from "../core/dom.js";
import { formatDateTime } from "../core/text/format.js";
import { sentence, t } from "../core/text/language.js";
import { attempt } from "../core/toasts.js";

const PAGE_SIZE = 100;
const user = make("input", {
  list: "audit-names",
  maxlength: 60,
  placeholder: t("all users"),
  "data-testid": "audit-who",
});
const names = make("datalist", { id: "audit-names" });
const since = make("input", { type: "datetime-local", "data-testid": "audit-since" });
const until = make("input", { type: "datetime-local", "data-testid": "audit-until" });
const list = make("ol", {
  class: "audit",
  "data-testid": "audit",
  "aria-label": t("Audit log, newest first"),
});
const empty = make("p", { class: "empty" }, t("No entries match."));
const older = make(
  "button",
  {
    type: "button",
    "data-testid": "audit-older",
    onclick: () => load(list.lastElementChild?.dataset.id),
  },
  t("Older ↓"),
);

export function build(pane) {
  const form = make(
    "form",
    { class: "row", autocomplete: "off" },
    make("label", { class: "field" }, t("User"), user),
    names,
    make("label", { class: "field" }, t("From"), since),
    make("label", { class: "field" }, t("Until"), until),
    make("button", { class: "primary", "data-testid": "audit-show" }, t("Show")),
    older,
  );
  form.onsubmit = (event) => {
    event.preventDefault();
    refresh();
  };
  for (const field of [user, since, until]) field.onchange = () => refresh();
  pane.append(form, list, empty);
}

export function suggestNames(known) {
  names.replaceChildren(...known.map((value) => make("option", { value })));
}

export const refresh = () => load();

// Number of the newest request: the answers of those before it show what is not asked for any more.
let newest = 0;

async function load(before) {
  const number = ++newest;
  older.disabled = true; // a second click would append the same page once more
  const query = new URLSearchParams({ count: PAGE_SIZE });
  if (before) query.set("before", before);
  if (user.value.trim()) query.set("who", user.value.trim());
  for (const [key, field] of [
    ["since", since],
    ["until", until],
  ]) {
    if (field.value) query.set(key, new Date(field.value).toISOString());
  }
  await attempt(async () => {
    const entries = await get(`/audit?${query}`);
    if (number !== newest) return;
    if (!before) list.replaceChildren();
    list.append(...entries.map(itemOf));
    older.hidden = entries.length < PAGE_SIZE;
    empty.hidden = list.children.length > 0;
  });
  if (number === newest) older.disabled = false;
}

function itemOf(entry) {
  const time = new Date(entry.at);
  const detail =
    entry.detail === undefined
      ? ""
      : typeof entry.detail === "string"
        ? entry.detail
        : JSON.stringify(entry.detail);
  const address = `${entry.method ?? ""} ${entry.path ?? ""} ${detail}`;
  return make(
    "li",
    { "data-testid": "audit-entry", "data-id": entry.id },
    make("time", { datetime: entry.at }, formatDateTime(time)),
    make("b", { title: entry.role ?? entry.from ?? "" }, entry.who ?? "–"),
    make("span", { class: "what", title: address }, sentence(entry.text)),
    make("span", { class: entry.status >= 400 ? "refused" : "outcome" }, outcome(entry.status)),
  );
}

function outcome(status) {
  if (status === undefined) return "";
  return status < 400 ? t("✓ done") : t("✕ refused");
}
