// The event log: what happened when and where, with a filter and a jump to the place. It goes back
// over earlier starts of the console, whose entries are marked.

import { get } from "../core/api.js";
import { formatTime, make, set, setText } from "../core/dom.js";
import { attempt } from "../core/toasts.js";

const KINDS = {
  stopped: "■ stopped",
  released: "▶ released",
  replanned: "⤳ path",
  goal: "⚑ goal",
  mission: "● mission",
  seen: "◉ seen",
  zone: "⬠ zone",
  beware: "▲ beware",
  labelled: "✎ labelled",
};
const MAX_NEW = 300;
const OLDER = 200;
const MAX_UNREAD = 99;
const chosenKinds = new Set();
let shared;
let tab;
let list;
let olderButton;
let maxShown = MAX_NEW;
let newestId = 0;
let unread = 0;
let isBusy = false;

export function build(pane, context, button) {
  shared = context;
  tab = button;
  list = make("ol", { class: "log", "data-testid": "log", "aria-label": "Events, newest first" });
  olderButton = make(
    "button",
    {
      class: "older",
      hidden: "",
      "data-testid": "log-older",
      onclick: loadOlder,
      title: "Show earlier events, also those before the last start of the console",
    },
    "Older ↓",
  );
  const filter = make(
    "div",
    { class: "filter", role: "group", "aria-label": "Show only" },
    ...Object.entries(KINDS).map(filterButton),
    olderButton,
  );
  pane.append(
    filter,
    list,
    make(
      "p",
      { class: "empty" },
      "No events yet. What the robot decides appears here with time and place.",
    ),
  );
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
    [newestId, maxShown] = [0, MAX_NEW];
    list.replaceChildren();
    tick(true);
  };
  return button;
}

const kindQuery = () => [...chosenKinds].map((kind) => `&kind=${kind}`).join("");

export async function tick(isOpen) {
  if (isBusy) return;
  isBusy = true;
  try {
    const page = await get(`/journal?since=${newestId}&limit=${MAX_NEW}${kindQuery()}`);
    // Another data folder counts from one again.
    if (page.newest < newestId) list.replaceChildren();
    if (newestId === 0) set(olderButton, { hidden: page.entries.length < MAX_NEW });
    newestId = page.newest;
    unread = isOpen
      ? 0
      : unread + page.entries.filter((entry) => entry.start === page.start).length;
    list.prepend(...page.entries.reverse().map(itemOf));
    while (list.children.length > maxShown) {
      list.lastChild.remove();
      olderButton.hidden = false;
    }
    if (page.entries.length) markStarts(page.start);
    setText(tab, unread ? `Log · ${unread > MAX_UNREAD ? `${MAX_UNREAD}+` : unread} new` : "Log");
  } catch {
    // a lost connection has its own banner
  }
  isBusy = false;
}

async function loadOlder() {
  const oldestId = list.lastElementChild?.dataset.id;
  if (isBusy || oldestId === undefined) return;
  isBusy = true;
  await attempt(async () => {
    const page = await get(`/journal?before=${oldestId}&limit=${OLDER}${kindQuery()}`);
    list.append(...page.entries.reverse().map(itemOf));
    maxShown = Math.max(maxShown, list.children.length);
    olderButton.hidden = page.entries.length < OLDER;
    markStarts(page.start);
    if (page.entries.length)
      list.querySelector(`[data-id="${oldestId}"]`).scrollIntoView({ block: "start" });
  });
  isBusy = false;
}

// A line above the newest entry of each earlier start of the console.
function markStarts(present) {
  let last = String(present);
  for (const entry of list.children) {
    const { start, day } = entry.dataset;
    entry.classList.toggle("earlier", start !== String(present));
    if (start === last) delete entry.dataset.before;
    else entry.dataset.before = `before the console was restarted · ${day}`;
    last = start;
  }
}

function itemOf(entry) {
  const time = new Date(1000 * entry.unix_s);
  const item = make(
    "li",
    {
      "data-testid": "log-entry",
      "data-kind": entry.kind,
      "data-id": entry.id,
      "data-start": entry.start,
      "data-day": time.toLocaleDateString(),
    },
    make("time", { title: time.toLocaleString([], { hour12: false }) }, formatTime(entry.unix_s)),
    make("b", { class: `kind kind-${entry.kind}` }, KINDS[entry.kind] ?? entry.kind),
    make("span", { class: "words" }, entry.text),
  );
  if (entry.place) item.append(jumpButton(entry.place));
  return item;
}

function jumpButton([x, y]) {
  const look = () => shared.look([x, y]);
  return make(
    "button",
    { class: "jump", title: "Show this place", "data-testid": "jump", onclick: look },
    `◎ ${x.toFixed(1)}, ${y.toFixed(1)}`,
  );
}
