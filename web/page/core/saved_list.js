// A menu of things that are kept under a name: take one, forget one, keep the present one.

import { get, request } from "./api.js";
import { make, spent } from "./dom.js";
import { attempt } from "./toasts.js";

// `take` is the last part of the address that takes one; `say` tells of an entry in words.
export function shelf(menu, { path, take, verb, placeholder, words, taken }) {
  const list = make("ul", { class: "list" });
  const name = make("input", { maxlength: 80, placeholder, "aria-label": placeholder, "data-testid": `${menu.id}-name` });
  const form = make("form", { class: "row", autocomplete: "off" }, name, make("button", { "data-testid": `${menu.id}-save` }, "Save"));
  menu.append(list, form);
  const address = (entry) => `${path}/${encodeURIComponent(entry)}`;

  async function refresh() {
    const entries = await get(path);
    list.replaceChildren(...entries.map((entry) => make("li", { "data-testid": `${menu.id}-entry` },
      make("span", { class: "label" }, make("span", {}, entry.name), make("small", {}, words(entry))),
      make("button", { onclick: () => attempt(async () => { await request("POST", `${address(entry.name)}/${take}`); menu.hidePopover(); taken?.(); }) }, verb),
      make("button", { title: "Forget it", "aria-label": `Forget ${entry.name}`, onclick: () => attempt(async () => { await request("DELETE", address(entry.name)); refresh(); }) }, "✕"),
    )));
    if (!entries.length) list.append(make("li", { class: "empty" }, "nothing kept yet"));
  }

  form.addEventListener("submit", (event) => {
    event.preventDefault();
    const typed = name.value;
    if (typed.trim()) attempt(async () => { await request("PUT", address(typed.trim())); spent(name, typed); refresh(); });
  });
  menu.addEventListener("toggle", (event) => { if (event.newState === "open") attempt(refresh); });
}
