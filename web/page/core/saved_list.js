// A menu of values saved under a name: load one, delete one, save the present one.

import { get, request } from "./link/api.js";
import { clearSent, make } from "./dom.js";
import { t } from "./text/language.js";
import { ask, attempt, notify } from "./toasts.js";
import { askTwice } from "./twice.js";

// `action` is the last part of the address that loads an entry, `verb` its button, `describe` the
// entry in words; `onLoaded` is called after one was loaded; `nothing` says what can be saved here.
export function savedList(menu, { path, action, verb, placeholder, describe, onLoaded, nothing }) {
  const list = make("ul", { class: "list" });
  const name = make("input", {
    maxlength: 80,
    placeholder,
    "aria-label": placeholder,
    "data-testid": `${menu.id}-name`,
  });
  const saveButton = make("button", { "data-testid": `${menu.id}-save` }, t("Save"));
  const form = make("form", { class: "row", autocomplete: "off" }, name, saveButton);
  menu.append(list, form);
  const addressOf = (entryName) => `${path}/${encodeURIComponent(entryName)}`;

  async function load(entry) {
    await request("POST", `${addressOf(entry.name)}/${action}`);
    menu.hidePopover();
    onLoaded?.();
  }

  async function remove(entry) {
    await request("DELETE", addressOf(entry.name));
    refresh();
  }

  // What is deleted is gone for good, so the button asks once more.
  function deleteButton(entry) {
    const label = t("Delete {name}", entry);
    const button = make("button", { title: t("Delete"), "aria-label": label }, "✕");
    askTwice(button, t("Delete?"), () => attempt(() => remove(entry)));
    return button;
  }

  const itemOf = (entry) =>
    make(
      "li",
      { "data-testid": `${menu.id}-entry` },
      make(
        "span",
        { class: "label" },
        make("span", {}, entry.name),
        make("small", {}, describe(entry)),
      ),
      make("button", { onclick: () => attempt(() => load(entry)) }, verb),
      deleteButton(entry),
    );

  async function refresh() {
    const entries = await get(path);
    list.replaceChildren(...entries.map(itemOf));
    if (!entries.length) list.append(make("li", { class: "empty" }, nothing));
  }

  form.addEventListener("submit", (event) => {
    event.preventDefault();
    const typed = name.value;
    if (!typed.trim()) {
      notify(t("Give it a name first."));
      return;
    }
    attempt(async () => {
      await save(typed, addressOf(typed.trim()));
    });
  });

  // A name that is taken is replaced only when the operator says so.
  async function save(typed, address) {
    try {
      await request("PUT", address);
    } catch (error) {
      if (!error.body?.there) throw error;
      const replace = () => attempt(() => save(typed, `${address}?replace=true`));
      ask(error.message, [{ label: t("Replace"), run: replace }]);
      return;
    }
    notify(t("“{name}” is saved.", { name: typed.trim() }), { good: true });
    clearSent(name, typed);
    refresh();
  }
  menu.addEventListener("toggle", (event) => {
    if (event.newState === "open") attempt(refresh);
  });
}
