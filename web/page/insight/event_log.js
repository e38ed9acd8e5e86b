// The log of decisions: what happened when and where, with a filter, and a jump to the place. It goes back over earlier starts
// of the console, whose entries are told apart.

import { get } from "../core/api.js";
import { clock, make, set } from "../core/dom.js";
import { attempt } from "../core/toasts.js";

const KINDS = {
  stopped: "■ stopped", released: "▶ released", replanned: "⤳ path", goal: "⚑ goal", mission: "● mission",
  seen: "◉ seen", zone: "⬠ zone", beware: "▲ beware", labelled: "✎ labelled",
};
const MOST = 300;
const OLDER = 200;
const chosen = new Set();
let shared;
let list;
let more;
let most = MOST;
let tab;
let newest = 0;
let unread = 0;
let busy = false;

export function build(pane, context, button) {
  shared = context;
  tab = button;
  const filter = make("div", { class: "filter", role: "group", "aria-label": "Show only" });
  for (const [kind, title] of Object.entries(KINDS)) {
    const chip = make("button", { "aria-pressed": "false", "data-testid": `filter-${kind}` }, title);
    chip.onclick = () => {
      if (!chosen.delete(kind)) chosen.add(kind);
      chip.setAttribute("aria-pressed", String(chosen.has(kind)));
      [newest, most] = [0, MOST];
      list.replaceChildren();
      tick(true);
    };
    filter.append(chip);
  }
  list = make("ol", { class: "log", "data-testid": "log", "aria-label": "Decisions, newest first" });
  more = make("button", { class: "older", hidden: "", "data-testid": "log-older", onclick: older, title: "Show what happened before, back over earlier starts of the console" }, "Older ↓");
  filter.append(more);
  pane.append(filter, list, make("p", { class: "empty" }, "Nothing to show: as soon as the robot decides something, it stands here with time and place."));
}

const query = () => [...chosen].map((kind) => `&kind=${kind}`).join("");

export async function tick(open) {
  if (busy) return;
  busy = true;
  try {
    const page = await get(`/journal?since=${newest}&limit=${MOST}${query()}`);
    // Another data folder counts from one again.
    if (page.newest < newest) list.replaceChildren();
    if (newest === 0) set(more, { hidden: page.entries.length < MOST });
    newest = page.newest;
    unread = open ? 0 : unread + page.entries.filter((entry) => entry.start === page.start).length;
    list.prepend(...page.entries.reverse().map(item));
    while (list.children.length > most) { list.lastChild.remove(); more.hidden = false; }
    if (page.entries.length) tellStarts(page.start);
    const words = unread && !open ? `Log · ${unread > 99 ? "99+" : unread} new` : "Log";
    if (tab.textContent !== words) tab.textContent = words;
  } catch { /* a lost connection has its own banner */ }
  busy = false;
}

async function older() {
  const oldest = list.lastElementChild?.dataset.id;
  if (busy || oldest === undefined) return;
  busy = true;
  await attempt(async () => {
    const page = await get(`/journal?before=${oldest}&limit=${OLDER}${query()}`);
    list.append(...page.entries.reverse().map(item));
    most = Math.max(most, list.children.length);
    more.hidden = page.entries.length < OLDER;
    tellStarts(page.start);
    if (page.entries.length) list.querySelector(`[data-id="${oldest}"]`).scrollIntoView({ block: "start" });
  });
  busy = false;
}

// Where the entries of an earlier start of the console begin, a line says so.
function tellStarts(present) {
  let last = String(present);
  for (const entry of list.children) {
    const { start, day } = entry.dataset;
    entry.classList.toggle("earlier", start !== String(present));
    if (start === last) delete entry.dataset.before;
    else entry.dataset.before = `before the console was started anew · ${day}`;
    last = start;
  }
}

function item(entry) {
  const at = new Date(1000 * entry.unix_s);
  const parts = [make("time", { title: at.toLocaleString([], { hour12: false }) }, clock(entry.unix_s)), make("b", { class: `kind kind-${entry.kind}` }, KINDS[entry.kind] ?? entry.kind), make("span", { class: "words" }, entry.text)];
  if (entry.place) {
    const [x, y] = entry.place;
    parts.push(make("button", { class: "jump", title: "Show this place", "data-testid": "jump", onclick: () => shared.look(entry.place) }, `◎ ${x.toFixed(1)}, ${y.toFixed(1)}`));
  }
  return make("li", { "data-testid": "log-entry", "data-kind": entry.kind, "data-id": entry.id, "data-start": entry.start, "data-day": at.toLocaleDateString() }, ...parts);
}
