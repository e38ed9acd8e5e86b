// The panel of the sites: the list with what one does with each, new sites, and the changes of the
// map. It lies below the header, so that the stop stays within reach while it is open.

import { abortableFetch, FILE_S, get, post, request, setSite } from "../core/link/api.js";
import { clearSent, download, element, make, reconcile, setText } from "../core/dom.js";
import { oneAtATime } from "../core/link/updates.js";
import { formatMoment } from "../core/text/format.js";
import { number, sentence, t, tn } from "../core/text/language.js";
import { attempt } from "../core/toasts.js";
import { askTwice } from "../core/twice.js";
import * as changes from "./changes.js";
import { buildDockAndTags, enter, follow, load } from "./dock_tags.js";
import { buildPlacing } from "./placing.js";

const NAME_RULE = "[\\p{L}\\p{Nd}]([\\p{L}\\p{M}\\p{Nd} _\\-]{0,38}[\\p{L}\\p{M}\\p{Nd}_\\-])?";
const panel = element("sites");
const opener = element("sites-button");
const list = make("ul", { class: "list", "data-testid": "sites-list" });
const only = make(
  "p",
  { class: "empty", "data-testid": "sites-only" },
  t("One site so far. For another floor or building, type a name and press Make."),
);
const newName = nameField(t("Name of a new site"), "site-name");
let chosen = null;
const loadChosen = oneAtATime(load);
const refreshAgain = oneAtATime(refresh);
let chosenId = null;

function nameField(label, testId) {
  return make("input", {
    "aria-label": label,
    placeholder: label,
    required: "",
    maxlength: 40,
    pattern: NAME_RULE,
    title: t("1 to 40 letters, digits, blanks, - and _, beginning with a letter or digit"),
    "data-testid": testId,
    onchange: ({ target }) => (target.value = target.value.normalize("NFC").trim().replace(/ +/g, " ")),
  });
}

// Called with every state; returns whether the site has changed since the last one.
export function update(state) {
  const { site, site_id } = state;
  follow(state);
  if (site === chosen && site_id === chosenId) return false;
  const isOther = chosenId !== null && site_id !== chosenId; // and not the same under another name
  [chosen, chosenId] = [site, site_id];
  setSite(site_id);
  setText(opener, t("Site {site} ▾", { site }));
  if (isOther) changes.forget();
  enter(site);
  if (panel.open) refreshAgain();
  else loadChosen();
  return isOther;
}

async function refresh() {
  loadChosen();
  const { sites } = await get("/sites");
  reconcile(list, sites, (site) => site.name, itemOf, fill);
  only.hidden = sites.length > 1;
  if (panel.open) await changes.refresh();
}

const pathOf = (name) => `/sites/${encodeURIComponent(name)}`;

// Do something with the sites, say so, and show them as they are now.
// Returns whether it was done.
const act = (what, said) =>
  attempt(async () => {
    await what();
    // Told in the list itself: a message would lie over its buttons.
    setText(element("sites-said"), said ?? "");
    await refresh();
    return true;
  });

function itemOf({ name }) {
  const button = (text, testId, onclick, title = text) =>
    make("button", { title: `${title}: ${name}`, "data-testid": testId, onclick }, text);
  const renaming = nameForm(t("New name of {name}", { name }), t("Rename"), "site-rename-name", (typed) =>
    act(
      () => request("PATCH", pathOf(name), { name: typed }),
      t("{name} is called {typed} now.", { name, typed }),
    ),
  );
  const copying = nameForm(t("Name of the copy of {name}", { name }), t("Copy"), "site-copy-name", (typed) =>
    act(
      () => post(`${pathOf(name)}/copy`, { name: typed }),
      t("{typed} is a copy of {name}.", { name, typed }),
    ),
  );
  return make(
    "li",
    { "data-testid": "site", "data-name": name },
    make("span", { class: "label" }, make("span", {}, name), make("small")),
    button(t("Go on here"), "site-choose", () => act(() => post(`${pathOf(name)}/choose`))),
    button(t("Rename …"), "site-rename", () => toggle(renaming, name)),
    button(t("Copy …"), "site-copy", () => toggle(copying)),
    button(t("Export"), "site-export", () => attempt(() => save(name, "export", "site.zip"))),
    button("Nav2", "site-nav2", () => attempt(() => save(name, "nav2", "nav2.zip")), t("Export Nav2")),
    deleteButton(name),
    renaming,
    copying,
  );
}

function fill(item, site) {
  const map = t("map of {time}, {size} MB", {
    time: formatMoment(site.map_unix_s),
    size: number(site.map_bytes / 1e6, 1),
  });
  const parts = [
    tn("{n} zone", "{n} zones", site.zones),
    tn("{n} mission", "{n} missions", site.missions),
  ];
  if (site.map_unix_s) parts.push(map);
  if (site.accepted) parts.push(t("accepted map"));
  if (!site.map_unix_s && !site.accepted) parts.push(t("no map yet"));
  if (site.chosen) parts.unshift(t("the robot is here"));
  setText(item.querySelector("small"), parts.join(" · "));
  item.classList.toggle("chosen", site.chosen);
  for (const testId of ["site-choose", "site-delete"])
    item.querySelector(`[data-testid=${testId}]`).disabled = site.chosen;
}

function toggle(form, name = "") {
  form.hidden = !form.hidden;
  if (form.hidden) return;
  const field = form.querySelector("input");
  field.value = name;
  field.select();
}

function nameForm(label, verb, testId, onName) {
  const field = nameField(label, testId);
  const save = make("button", { class: "primary" }, verb);
  const form = make("form", { class: "row", hidden: "", autocomplete: "off" }, field, save);
  form.onsubmit = async (event) => {
    event.preventDefault();
    if (await onName(field.value)) form.hidden = true;
  };
  return form;
}

// A site is gone for good, so the button asks once more.
function deleteButton(name) {
  const button = make(
    "button",
    { title: t("Delete"), "aria-label": t("Delete {name}", { name }), "data-testid": "site-delete" },
    "✕",
  );
  askTwice(button, t("Delete?"), () =>
    act(() => request("DELETE", pathOf(name)), t("{name} is deleted.", { name })),
  );
  return button;
}

async function save(name, kind, ending) {
  const response = await answered(`${pathOf(name)}/${kind}`);
  download(`${name}.${ending}`, await response.blob());
}

async function answered(path, options) {
  const response = await abortableFetch(`/api/v1${path}`, options, FILE_S);
  if (response.ok) return response;
  throw new Error(sentence((await response.json()).error?.message) ?? t("the console refuses the file"));
}

// The name that was typed, else one made of the name of a file, and of a number if a site has it.
function nameFor(file) {
  if (newName.value) return newName.value;
  // Names of files on a Mac have an umlaut in two parts.
  const whole = file.name.normalize("NFC").replace(/(\.site)?\.[a-z0-9]+$/i, "");
  const made = whole.replace(/[^\p{L}\p{M}\p{Nd} _-]+/gu, "-");
  const bare = made.replace(/^[-_ \p{M}]+|[- ]+$/gu, "");
  const name = [...bare].slice(0, 36).join("").trimEnd() || "site";
  const taken = new Set([...list.children].map((item) => item.dataset.name));
  let number = 1;
  while (taken.has(numbered(name, number))) number += 1;
  return numbered(name, number);
}

const numbered = (name, number) => (number === 1 ? name : `${name} ${number}`);

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
  const [name, typed] = [nameFor(file), newName.value];
  await act(async () => {
    await answered(`/sites/import?name=${encodeURIComponent(name)}`, { method: "POST", body: file });
    clearSent(newName, typed);
  }, t("Site {name} is made.", { name }));
}

export function open() {
  panel.show();
  attempt(refresh);
}

function close() {
  panel.close();
}

// While something is done on the map, the panel is away; it comes back as it was left.
let scrolled = 0;
const aside = {
  hide: () => {
    scrolled = panel.scrollTop;
    close();
  },
  show: () => {
    open();
    panel.scrollTop = scrolled;
  },
};

function build() {
  const closing = make(
    "button",
    { class: "round", title: t("Close (Esc)"), "aria-label": t("Close"), "data-testid": "sites-close" },
    "✕",
  );
  closing.onclick = close;
  const making = make(
    "form",
    { class: "row", autocomplete: "off" },
    newName,
    make("button", { class: "primary", "data-testid": "site-make" }, t("Make")),
  );
  making.onsubmit = (event) => {
    event.preventDefault();
    const typed = newName.value;
    act(async () => {
      await post("/sites", { name: typed });
      clearSent(newName, typed);
    }, t("Site {name} is made.", { name: typed }));
  };
  const placing = buildPlacing({
    ...aside,
    onMade: (name) => {
      clearSent(newName, name);
      return refresh();
    },
  });
  const files = make(
    "div",
    { class: "row" },
    fileButton(t("Import archive …"), "site-import", ".zip", importArchive),
    fileButton(t("Import Nav2 map …"), "site-import-nav2", ".yaml,.yml,.pgm,.png", (chosenFiles) =>
      placing.start(chosenFiles, nameFor(chosenFiles[0])),
    ),
  );
  panel.append(
    make("header", {}, make("h2", {}, t("Sites")), make("span", { id: "sites-said", role: "status" }), closing),
    make("section", {}, list, only, making, files, placing.form),
    buildDockAndTags(aside),
    changes.buildChanges(aside),
  );
}

build();
opener.onclick = () => (panel.open ? close() : open());
panel.addEventListener("close", () => {
  if (!changes.hide()) opener.focus();
});
