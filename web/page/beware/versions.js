// The stored versions of the beware list: who, when and what; compared with the list in force, and
// brought back.

import { get, post } from "../core/link/api.js";
import { element, make } from "../core/dom.js";
import { formatDateTime } from "../core/text/format.js";
import { sentence, t } from "../core/text/language.js";
import { attempt, notify } from "../core/toasts.js";
import { propose } from "./proposal.js";

const menu = element("beware-versions");
const list = make("ul", { class: "list", "data-testid": "beware-versions-list" });
menu.append(list);
let refresh = () => {};

// `onNewList` loads and shows the list again.
export function build(onNewList) {
  refresh = onNewList;
}

const dated = (unixS) =>
  unixS === null ? "" : formatDateTime(new Date(1000 * unixS));

function rowOf(entry, isNewest) {
  const changes = make("small", { class: "changes", hidden: "" });
  const row = make(
    "li",
    { "data-testid": "beware-version-row", "data-version": entry.version },
    make(
      "span",
      { class: "label" },
      make("span", {}, t("version {version}", entry)),
      make("small", {}, [dated(entry.unix_s), entry.by].filter(Boolean).join(" · ")),
      make("small", { class: "changes" }, sentence(entry.what)),
      changes,
    ),
  );
  if (isNewest) return row;
  const compare = make("button", { type: "button", "data-testid": "beware-compare" }, t("Compare"));
  compare.onclick = () =>
    attempt(async () => {
      const { changes: told } = await get(`/beware/versions/${entry.version}`);
      changes.textContent = told.length
        ? `${t("Bringing it back:")} ${told.map(sentence).join("; ")}`
        : t("It says the same as the list in force.");
      changes.hidden = false;
    });
  const back = make("button", { type: "button", "data-testid": "beware-restore" }, t("Bring back"));
  const bringBack = async (query) => {
    await post(`/beware/versions/${entry.version}/restore${query}`);
    notify(t("Version {version} is in force again.", entry), { good: true });
    refresh();
  };
  back.onclick = () => {
    menu.hidePopover();
    const question = { version: entry.version };
    propose({ question, send: bringBack, host: element("beware-tools") });
  };
  row.append(compare, back);
  return row;
}

menu.addEventListener("toggle", (event) => {
  if (event.newState !== "open") return;
  attempt(async () => {
    const { versions } = await get("/beware/versions");
    list.replaceChildren(...versions.map((entry, i) => rowOf(entry, i === 0)));
    if (!versions.length)
      list.append(make("li", { class: "empty" }, t("The list has not been edited yet.")));
  });
});
