// The panel of the sites: the list with what one does with each, new sites, and the changes of the
// map. It lies below the header, so that the stop stays within reach while it is open.

import { abortableFetch, get, post, request } from "../core/api.js";
import { clearSent, download, element, make, reconcile, setText } from "../core/dom.js";
import { formatTime } from "../core/format.js";
import { attempt } from "../core/toasts.js";
import * as changes from "./changes.js";
import { buildPlacing } from "./placing.js";

const CONFIRM_MS = 4000;
const NAME_RULE = "[A-Za-z0-9]([A-Za-z0-9 _\\-]{0,38}[A-Za-z0-9_\\-])?";
const panel = element("sites");
const opener = element("sites-button");
const list = make("ul", { class: "list", "data-testid": "sites-list" });
const only = make(
  "p",
  { class: "empty", "data-testid": "sites-only" },
  "One site so far. For another floor or building, type a name and press Make.",
);
const newName = nameField("Name of a new site", "site-name");
let chosen = null;

function nameField(label, testId) {
  return make("input", {
    "aria-label": label,
    placeholder: label,
    required: "",
    maxlength: 40,
    pattern: NAME_RULE,
    title: "1 to 40 letters, digits, blanks, - and _",
    "data-testid": testId,
  });
}

// Called with every state; returns whether the site has changed since the last one.
export function update({ site }) {
  if (site === chosen) return false;
  const isFirst = chosen === null;
  chosen = site;
  setText(opener, `Site ${site} ▾`);
  if (panel.open) refresh();
  return !isFirst;
}

async function refresh() {
  const { sites } = await get("/sites");
  reconcile(list, sites, (site) => site.name, itemOf, fill);
  only.hidden = sites.length > 1;
  await changes.refresh();
}

const pathOf = (name) => `/sites/${encodeURIComponent(name)}`;

// Do something with the sites, say so, and show them as they are now.
const act = (what, said) =>
  attempt(async () => {
    await what();
    // Told in the list itself: a message would lie over its buttons.
    setText(element("sites-said"), said ?? "");
    await refresh();
  });

function itemOf({ name }) {
  const button = (text, testId, onclick, title = text) =>
    make("button", { title: `${title}: ${name}`, "data-testid": testId, onclick }, text);
  const renaming = nameForm(`New name of ${name}`, "Rename", (typed) =>
    act(() => request("PATCH", pathOf(name), { name: typed }), `${name} is called ${typed} now.`),
  );
  const copying = nameForm(`Name of the copy of ${name}`, "Copy", (typed) =>
    act(() => post(`${pathOf(name)}/copy`, { name: typed }), `${typed} is a copy of ${name}.`),
  );
  return make(
    "li",
    { "data-testid": "site", "data-name": name },
    make("span", { class: "label" }, make("span", {}, name), make("small")),
    button("Go on here", "site-choose", () => act(() => post(`${pathOf(name)}/choose`))),
    button("Rename …", "site-rename", () => toggle(renaming)),
    button("Copy …", "site-copy", () => toggle(copying)),
    button("Export", "site-export", () => attempt(() => save(name, "export", "site.zip"))),
    button("Nav2", "site-nav2", () => attempt(() => save(name, "nav2", "nav2.zip")), "Export Nav2"),
    deleteButton(name),
    renaming,
    copying,
  );
}

function fill(item, site) {
  const map = site.map_unix_s
    ? `map of ${formatTime(site.map_unix_s)}, ${(site.map_bytes / 1e6).toFixed(1)} MB`
    : "no map yet";
  const parts = [`${site.zones} zones`, `${site.missions} missions`, map];
  if (site.accepted) parts.push("accepted map");
  if (site.chosen) parts.unshift("the robot is here");
  setText(item.querySelector("small"), parts.join(" · "));
  item.classList.toggle("chosen", site.chosen);
  for (const testId of ["site-choose", "site-delete"])
    item.querySelector(`[data-testid=${testId}]`).disabled = site.chosen;
}

function toggle(form) {
  form.hidden = !form.hidden;
  if (!form.hidden) form.querySelector("input").focus();
}

function nameForm(label, verb, onName) {
  const field = nameField(label, `site-${verb.toLowerCase()}-name`);
  const save = make("button", { class: "primary" }, verb);
  const form = make("form", { class: "row", hidden: "", autocomplete: "off" }, field, save);
  form.onsubmit = (event) => {
    event.preventDefault();
    form.hidden = true;
    onName(field.value);
  };
  return form;
}

// A site is gone for good, so the button asks once more.
function deleteButton(name) {
  const button = make(
    "button",
    { title: "Delete", "aria-label": `Delete ${name}`, "data-testid": "site-delete" },
    "✕",
  );
  button.onclick = () => {
    if (button.classList.contains("confirm")) {
      act(() => request("DELETE", pathOf(name)), `${name} is deleted.`);
      return;
    }
    button.classList.add("confirm");
    setText(button, "Delete?");
    setTimeout(() => {
      button.classList.remove("confirm");
      setText(button, "✕");
    }, CONFIRM_MS);
  };
  return button;
}

async function save(name, kind, ending) {
  const response = await answered(`${pathOf(name)}/${kind}`);
  download(`${name}.${ending}`, await response.blob());
}

async function answered(path, options) {
  const response = await abortableFetch(`/api/v1${path}`, options);
  if (response.ok) return response;
  throw new Error((await response.json()).error?.message ?? "the console refuses the file");
}

// The name that was typed, else one made of the name of a file.
function nameFor(file) {
  const made = file.name.replace(/(\.site)?\.[a-z0-9]+$/i, "").replace(/[^A-Za-z0-9_-]+/g, "-");
  return newName.value || made.replace(/^[-_]+|-+$/g, "").slice(0, 40) || "site";
}

function fileButton(label, testId, accept, onFiles) {
  const input = make("input", { type: "file", accept, "data-testid": testId });
  input.multiple = accept.includes("yaml");
  input.onchange = () => {
    const files = [...input.files];
    input.value = "";
    attempt(() => onFiles(files));
  };
  return make("label", { class: "button" }, label, input);
}

async function importArchive([file]) {
  const name = nameFor(file);
  await act(
    () => answered(`/sites/import?name=${encodeURIComponent(name)}`, { method: "POST", body: file }),
    `Site ${name} is made.`,
  );
}

export function open() {
  panel.show();
  attempt(refresh);
}

function close() {
  panel.close();
}

function build() {
  const closing = make(
    "button",
    { class: "round", title: "Close (Esc)", "aria-label": "Close", "data-testid": "sites-close" },
    "✕",
  );
  closing.onclick = close;
  const making = make(
    "form",
    { class: "row", autocomplete: "off" },
    newName,
    make("button", { class: "primary", "data-testid": "site-make" }, "Make"),
  );
  making.onsubmit = (event) => {
    event.preventDefault();
    const typed = newName.value;
    act(async () => {
      await post("/sites", { name: typed });
      clearSent(newName, typed);
    }, `Site ${typed} is made.`);
  };
  const placing = buildPlacing({ hide: close, show: open, onMade: refresh });
  const files = make(
    "div",
    { class: "row" },
    fileButton("Import archive …", "site-import", ".zip", importArchive),
    fileButton("Import Nav2 map …", "site-import-nav2", ".yaml,.yml,.pgm,.png", (chosenFiles) =>
      placing.start(chosenFiles, nameFor(chosenFiles[0])),
    ),
  );
  panel.append(
    make("header", {}, make("h2", {}, "Sites"), make("span", { id: "sites-said", role: "status" }), closing),
    make("section", {}, list, only, making, files, placing.form),
    changes.section,
  );
}

build();
opener.onclick = () => (panel.open ? close() : open());
panel.addEventListener("close", () => {
  changes.hide();
  opener.focus();
});
