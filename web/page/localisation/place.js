// The robot's place: what it knows of it, and a place that the operator proposes.

import { post } from "../core/link/api.js";
import { onStale } from "../core/link/connection.js";
import { element, make, set, setText } from "../core/dom.js";
import { showMap } from "../core/page_tabs.js";
import { sentence, t } from "../core/text/language.js";
import { attempt, notify } from "../core/toasts.js";

const UNKNOWN = new Set(["ambiguous", "lost"]);
const UNSURE = new Set([...UNKNOWN, "checking"]);
// The place that is proposed: the pose that was asked for and the answer of the console.
export const proposal = { asked: null, checked: null };
const listeners = [];

export const onProposal = (listener) => listeners.push(listener);

export const isPlaceKnown = ({ pose, place }) => pose.x_m !== null && !UNSURE.has(place.state);

// Reason why the robot may not look round now, or "" where it may.
function refusalOf(phase, isStopped) {
  if (isStopped) return t("The stop is latched: reset it first");
  return phase === "driving" || phase === "leaving" ? t("Pause the mission first") : "";
}

export function showPlace({ place, phase, stop_latched: isStopped }) {
  const isUnknown = UNKNOWN.has(place.state);
  set(element("place-unknown"), { hidden: !isUnknown });
  if (!isUnknown) return;
  setText(element("place-text"), `◎ ${sentence(place.text)}`);
  const refusal = refusalOf(phase, isStopped);
  set(element("place-search"), {
    disabled: place.searching || refusal !== "",
    title: refusal || t("Turn round once and look for the place in the whole map"),
  });
  setText(element("place-search"), place.searching ? t("Looking round …") : t("Look round"));
}

let asks = 0;

// Ask how well the camera's view fits at a pose, and offer to take it.
export async function propose(pose) {
  asks += 1;
  const own = asks;
  await attempt(async () => {
    const checked = await post("/pose?check=true", pose);
    if (own === asks) show(pose, checked);
  });
}

function show(asked, checked) {
  Object.assign(proposal, { asked, checked });
  const panel = element("place-proposal");
  set(panel, { hidden: !checked });
  if (checked) {
    showMap();
    const [text, id] = checked.fits ? [t("Accept"), "place-accept"] : [t("Accept anyway"), "place-force"];
    panel.replaceChildren(
      make("p", { "data-testid": "place-fit" }, sentence(checked.text)),
      ...(checked.fits ? [] : [make("p", {}, t("What the robot sees from here is taken back if its way does not fit, or if you show it another place. If you are not sure, let it look round."))]),
      ...(checked.fits ? [] : [make("button", { "data-testid": "place-look", onclick: lookRound }, t("Look round"))]),
      make("button", { "data-testid": id, onclick: () => accept(!checked.fits) }, text),
      make("button", { "data-testid": "place-cancel", onclick: withdraw }, t("Cancel")),
    );
    panel.querySelector("button").focus();
  }
  for (const listener of listeners) listener();
}

export function withdraw() {
  asks += 1; // nor is an answer shown that is still on its way
  if (proposal.checked) show(null, null);
}

async function accept(isForced) {
  const { asked } = proposal;
  await attempt(async () => {
    await post(`/pose${isForced ? "?force=true" : ""}`, asked);
    notify(t("The robot takes this to be its place."), { good: true });
    withdraw();
  });
}

onStale(() => set(element("place-unknown"), { hidden: true }));

const search = () => attempt(() => post("/localisation/search"));

function lookRound() {
  withdraw();
  search();
}

element("place-search").onclick = search;
element("place-proposal").addEventListener("keydown", (event) => {
  if (event.key !== "Escape") return;
  event.stopPropagation();
  withdraw();
});
