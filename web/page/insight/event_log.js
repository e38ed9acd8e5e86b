// The event log: what happened when and where, repeats in one row, with a search, filters and a jump
// to the place. It goes back over earlier starts of the console, whose entries are marked.

import { get } from "../core/link/api.js";
import { make, set, setText } from "../core/dom.js";
import { formatDate, formatDateTime, formatTime } from "../core/text/format.js";
import { sentence, t } from "../core/text/language.js";
import { attempt } from "../core/toasts.js";
import { countText, fold, levelOf, LEVELS, newFold, rowFor } from "./log_folding.js";

const KINDS = {
  stopped: t("■ stopped"),
  released: t("▶ released"),
  replanned: t("↝ path"),
  goal: t("⚑ goal"),
  mission: t("● mission"),
  seen: t("◉ seen"),
  zone: t("⬠ zone"),
  beware: t("▲ beware"),
  labelled: t("✎ labelled"),
  place: t("⊕ place"),
  map: t("⌫ map"),
};
const LEVEL_NAMES = { detail: t("everything"), notice: t("goals, zones, stops"), alert: t("stops") };
const MAX_NEW = 300;
const OLDER = 200;
const MAX_UNREAD = 99;
const chosenKinds = new Set();
let shared;
let tab;
let list;
let nothing;
let olderButton;
let searchField;
let levelField;
let maxShown = MAX_NEW;
let newestId = 0;
let oldestId = null;
let unread = 0;
let running = null;
let presentStart = null;
let markedDay = null;

export function build(pane, context, button) {
  shared = context;
  tab = button;
  list = make("ol", { class: "log", "data-testid": "log", "aria-label": t("Events, newest first") });
  nothing = make("p", { class: "empty" });
  olderButton = make(
    "button",
    {
      class: "older",
      hidden: "",
      "data-testid": "log-older",
      onclick: loadOlder,
      title: t("Show earlier events, also those before the last start of the console"),
    },
    t("Older ↓"),
  );
  searchField = make("input", {
    type: "search",
    placeholder: t("Search"),
    "aria-label": t("Search the log"),
    "data-testid": "log-search",
    oninput: showMatching,
  });
  levelField = make(
    "select",
    { "aria-label": t("Show"), "data-testid": "log-level", onchange: showMatching },
    ...LEVELS.map((level) => make("option", { value: level }, LEVEL_NAMES[level])),
  );
  const filter = make(
    "div",
    { class: "filter", role: "group", "aria-label": t("Show only") },
    searchField,
    levelField,
    ...Object.entries(KINDS).map(filterButton),
    olderButton,
  );
  pane.append(filter, list, nothing);
  showMatching();
}

function filterButton([kind, title]) {
  const button = make(
    "button",
    { "aria-pressed": "false", "data-testid": `filter-${kind}` },
    title,
  );
  button.onclick = () => {
    if (!chosenKinds.delete(kind)) chosenKinds.add(kind);
    button.setAttribute("aria-pressed", String(chosenKinds.has(kind)));
    inTurn(() => beginAgain(true));
  };
  return button;
}

const kindQuery = () => [...chosenKinds].map((kind) => `&kind=${kind}`).join("");

// Show the rows that contain the searched words and matter enough.
function showMatching() {
  const words = searchField.value.trim().toLowerCase();
  const least = LEVELS.indexOf(levelField.value);
  let shownRows = 0;
  for (const row of list.children) {
    const isShown =
      LEVELS.indexOf(row.dataset.level) >= least && row.textContent.toLowerCase().includes(words);
    set(row, { hidden: !isShown });
    shownRows += Number(isShown);
  }
  markStarts();
  set(nothing, { hidden: shownRows > 0 });
  setText(
    nothing,
    list.children.length
      ? t("No event matches.")
      : t("No events yet. What the robot decides appears here with time and place."),
  );
}

export async function tick(isOpen) {
  if (!running) await inTurn(() => loadNewest(isOpen));
}

// Run one request after the other: what is asked for by hand waits for the poll under way.
async function inTurn(load) {
  while (running) await running;
  running = load().finally(() => (running = null));
  await running;
}

function beginAgain(isOpen) {
  [newestId, oldestId, maxShown] = [0, null, MAX_NEW];
  list.replaceChildren();
  return loadNewest(isOpen);
}

async function loadNewest(isOpen) {
  try {
    const page = await get(`/journal?since=${newestId}&limit=${MAX_NEW}${kindQuery()}`);
    // Another data folder counts from one again; of more new entries than asked for, those between
    // would be missing in the list.
    const hasGap = newestId > 0 && page.entries.length === MAX_NEW;
    if (page.newest < newestId || hasGap) {
      await beginAgain(isOpen);
      return;
    }
    if (newestId === 0) set(olderButton, { hidden: page.entries.length < MAX_NEW });
    newestId = page.newest;
    const matters = (entry) => entry.start === page.start && levelOf(entry) !== "detail";
    unread = isOpen ? 0 : unread + page.entries.filter(matters).length;
    for (const entry of page.entries) addNewest(entry);
    while (list.children.length > maxShown) {
      list.lastChild.remove();
      oldestId = list.lastChild.firstId;
      olderButton.hidden = false;
    }
    presentStart = page.start;
    if (page.entries.length || markedDay !== formatDate(new Date())) showMatching();
    const shown = unread > MAX_UNREAD ? `${MAX_UNREAD}+` : unread;
    setText(tab, unread ? t("Log · {n} new", { n: shown }) : t("Log"));
  } catch {
    // a lost connection has its own banner
  }
}

function addNewest(entry) {
  oldestId ??= entry.id;
  const row = rowFor(entry, [...list.children]);
  if (row) repeat(row, entry, entry);
  list.prepend(row ?? itemOf(entry));
}

function addOldest(entry) {
  oldestId = entry.id;
  const row = rowFor(entry, [...list.children].slice(-1));
  if (row) repeat(row, entry, null);
  else list.append(itemOf(entry));
}

// Count an entry in the row that says the same; the row shows the newest words.
function repeat(row, entry, shownEntry) {
  fold(row.folded, entry);
  row.firstId = Math.min(row.firstId, entry.id);
  setText(row.querySelector(".count"), countText(row.folded));
  if (!shownEntry) return;
  showTime(row, shownEntry);
  setText(row.querySelector(".words"), sentence(shownEntry.text));
  row.querySelector(".jump")?.replaceWith(jumpButton(shownEntry.place ?? row.place));
}

const loadOlder = () => inTurn(() => attempt(addOlder));

async function addOlder() {
  if (oldestId === null) return;
  const last = list.lastElementChild;
  const page = await get(`/journal?before=${oldestId}&limit=${OLDER}${kindQuery()}`);
  for (const entry of page.entries.reverse()) addOldest(entry);
  maxShown = Math.max(maxShown, list.children.length);
  olderButton.hidden = page.entries.length < OLDER;
  presentStart = page.start;
  showMatching();
  if (page.entries.length) last?.scrollIntoView({ block: "start" });
}

// A line above the newest shown entry of each earlier start of the console, and of each day but the
// present one.
function markStarts() {
  markedDay = formatDate(new Date());
  let [lastStart, lastDay] = [String(presentStart), markedDay];
  for (const row of list.children) {
    if (row.hidden) continue;
    const { start } = row.dataset;
    const { day } = row;
    row.classList.toggle("earlier", start !== String(presentStart));
    if (start !== lastStart) row.dataset.before = `${t("before the console was restarted")} · ${day}`;
    else if (day !== lastDay) row.dataset.before = day;
    else delete row.dataset.before;
    [lastStart, lastDay] = [start, day];
  }
}

function showTime(row, { unix_s: unixS }) {
  const [time, moment] = [row.querySelector("time"), new Date(1000 * unixS)];
  row.day = formatDate(moment);
  set(time, { title: formatDateTime(moment) });
  setText(time, formatTime(unixS));
}

function itemOf(entry) {
  const item = make(
    "li",
    {
      "data-testid": "log-entry",
      "data-kind": entry.kind,
      "data-level": levelOf(entry),
      "data-start": entry.start,
    },
    make("time"),
    make("b", { class: `kind kind-${entry.kind}` }, KINDS[entry.kind] ?? entry.kind),
    make("span", { class: "words" }, sentence(entry.text)),
    make("span", { class: "count", "data-testid": "log-count" }),
  );
  showTime(item, entry);
  Object.assign(item, { folded: newFold(entry), firstId: entry.id, place: entry.place });
  if (entry.place) item.append(jumpButton(entry.place));
  return item;
}

function jumpButton([x, y]) {
  const look = () => shared.look([x, y]);
  return make(
    "button",
    { class: "jump", title: t("Show this place"), "data-testid": "jump", onclick: look },
    `◎ ${x.toFixed(1)}, ${y.toFixed(1)}`,
  );
}
