// The log of decisions: what happened when and where, with a filter, and a jump to the place.

import { get } from "./api.js";
import { clock, make } from "./dom.js";

const KINDS = {
  stopped: "■ stopped", released: "▶ released", replanned: "⤳ path", goal: "⚑ goal", mission: "● mission",
  seen: "◉ seen", zone: "⬠ zone", beware: "▲ beware", labelled: "✎ labelled",
};
const MOST = 300;
const chosen = new Set();
let shared;
let list;
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
      newest = 0;
      list.replaceChildren();
      tick(true);
    };
    filter.append(chip);
  }
  list = make("ol", { class: "log", "data-testid": "log", "aria-label": "Decisions, newest first" });
  pane.append(filter, list, make("p", { class: "empty" }, "Nothing to show: as soon as the robot decides something, it stands here with time and place."));
}

export async function tick(open) {
  if (busy) return;
  busy = true;
  try {
    const kinds = [...chosen].map((kind) => `&kind=${kind}`).join("");
    const page = await get(`/journal?since=${newest}&limit=${MOST}${kinds}`);
    // A console that was started anew counts from one again.
    if (page.newest < newest) list.replaceChildren();
    newest = page.newest;
    unread = open ? 0 : unread + page.entries.length;
    list.prepend(...page.entries.reverse().map(item));
    while (list.children.length > MOST) list.lastChild.remove();
    const words = unread && !open ? `Log · ${unread > 99 ? "99+" : unread} new` : "Log";
    if (tab.textContent !== words) tab.textContent = words;
  } catch { /* a lost connection has its own banner */ }
  busy = false;
}

function item(entry) {
  const parts = [make("time", {}, clock(entry.unix_s)), make("b", { class: `kind kind-${entry.kind}` }, KINDS[entry.kind] ?? entry.kind), make("span", { class: "words" }, entry.text)];
  if (entry.place) {
    const [x, y] = entry.place;
    parts.push(make("button", { class: "jump", title: "Show this place", "data-testid": "jump", onclick: () => shared.look(entry.place) }, `◎ ${x.toFixed(1)}, ${y.toFixed(1)}`));
  }
  return make("li", { "data-testid": "log-entry", "data-kind": entry.kind }, ...parts);
}
