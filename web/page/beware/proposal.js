// An edit of the beware list before it applies: one that changes nothing on the map applies at once;
// any other one says and shows what it would do, and waits for the operator.

import { make, setText } from "../core/dom.js";
import { isNarrow, selectTab } from "../core/page_tabs.js";
import { capitalised, sentence, t } from "../core/text/language.js";
import { attemptTwice, notify } from "../core/toasts.js";
import { isDrawing, onDraft, setMode } from "../zones/draft.js";
import { effectAsker, showOnMap } from "./effect.js";

const PATIENCE_MS = 400;
const MAX_TOLD = 4;
const ask = effectAsker();
const edit = make("b");
const effect = make("span");
const panel = make(
  "div",
  { class: "unapplied", role: "group", "aria-label": t("Not applied yet"), "data-testid": "proposal" },
  make("p", { role: "status", "data-testid": "proposal-note" }, edit, " ", effect),
  make(
    "div",
    { class: "row" },
    make(
      "button",
      { type: "button", title: t("Escape"), onclick: () => cancel(), "data-testid": "proposal-cancel" },
      t("Cancel"),
    ),
    make(
      "button",
      { type: "button", class: "primary", onclick: () => apply(), "data-testid": "proposal-apply" },
      t("Apply"),
    ),
  ),
);
const listeners = [];
export const onProposal = (listener) => listeners.push(listener);

let proposed = null;
let origin = null;
let timer = 0;

// Propose an edit. `question` is what the preview is asked, `send` applies it with the query of its
// request, `withdraw` is called when it is cancelled, and the panel is shown at the end of `host`.
// It cancels the one before, unless that has the same `withdraw` and so is a part of this one.
export function propose({ question, send, withdraw = null, host }) {
  if (isDrawing()) setMode("navigate");
  if (!withdraw || proposed?.withdraw !== withdraw) cancel();
  proposed = { question, send, withdraw, host };
  origin = document.activeElement;
  for (const listener of listeners) listener();
  renew();
}

// Ask what it would do, again where the list is another one now; without its row it is no edit.
export function renew() {
  if (!proposed?.host?.isConnected) {
    cancel();
    return;
  }
  clearTimeout(timer);
  if (panel.parentElement !== proposed.host) panel.remove();
  // Most answers come before there is anything to read.
  timer = setTimeout(show, PATIENCE_MS, { text: t("Looking at what this would change …") });
  ask(proposed.question, (answer) => {
    clearTimeout(timer);
    // What the operator has read waits for the operator, whatever another one changes meanwhile.
    if (answer.isNothing && !proposed.isTold) apply();
    else if (answer.isRefused) {
      cancel();
      notify(answer.text);
    } else {
      proposed.isTold = true;
      show(answer);
      showOnMap(answer);
    }
  });
}

function show({ text, changes = [], bad = false }) {
  const told = changes.slice(0, MAX_TOLD).map(sentence);
  if (changes.length > MAX_TOLD) told.push("…");
  setText(edit, told.join("; "));
  setText(effect, capitalised(text));
  panel.classList.toggle("bad", bad);
  if (panel.isConnected) return;
  if (isNarrow()) selectTab("more");
  proposed.host.append(panel);
  panel.scrollIntoView({ block: "nearest" });
}

function apply() {
  const { send } = proposed;
  end();
  attemptTwice(t("Empty the list"), send);
}

export function cancel() {
  if (!proposed) return;
  const { withdraw } = proposed;
  end();
  withdraw?.();
}

// The focus goes back to where the edit was made.
function end() {
  clearTimeout(timer);
  ask(null);
  proposed = null;
  const hadFocus = panel.contains(document.activeElement);
  panel.remove();
  showOnMap();
  if (hadFocus && origin.isConnected) origin.focus();
}

onDraft(() => isDrawing() && cancel());
