// The buttons of the mission and of the stop, each off where it would be refused, with the reason.

import { post } from "../core/link/api.js";
import { onStale } from "../core/link/connection.js";
import { element, set } from "../core/dom.js";
import { sentence, t } from "../core/text/language.js";
import { attempt, notify } from "../core/toasts.js";

const TITLES = { leave: t("Drive out of the area by the shortest path") };

// Why no mission drives while the robot does not know its place, by the state of that.
const UNKNOWN = {
  checking: t("The robot is still comparing what it sees with the map"),
  ambiguous: t("The robot does not know where it is"),
  lost: t("The robot does not know where it is"),
};

// Reason why an action is not possible now, or "" where it is.
function refusalsOf(state) {
  const { phase, queue, stop_latched: isStopped } = state;
  const stopped = isStopped ? t("The stop is latched: reset it first") : "";
  const held = stopped || UNKNOWN[state.place.state] || "";
  const moves = ["driving", "leaving"].includes(phase) || state.goes_on || state.place.searching || state.backs_off;
  return {
    start:
      stopped ||
      (phase !== "idle" && t("The mission has begun")) ||
      (!queue.length && t("Add a goal first")) ||
      held,
    pause: moves ? "" : t("Nothing drives"),
    resume: phase === "paused" ? held : t("The mission is not paused"),
    cancel: queue.length > 0 || phase !== "idle" ? "" : t("There is no mission"),
    leave: stopped || (state.in_zone ? "" : t("The robot is in no area")),
  };
}

// Messages of what would not hold over a restart; each stays until it would, and comes back some
// time after it was dismissed.
const unstored = {};
const REMIND_MS = 600_000;

function warnOf(name, text) {
  const told = unstored[name];
  if (text === told?.text) {
    if (!text || told.toast.isConnected) return;
    if (Date.now() - (told.toast.dismissedAt ?? 0) < REMIND_MS) return;
  }
  told?.toast?.remove();
  unstored[name] = { text, toast: text && notify(sentence(text), { stays: true }) };
}

// The number of stops that the operator can know of: a reset releases no newer one.
let seenStops = 0;

export function enableButtons(state) {
  seenStops = state.stops;
  for (const name of ["stop_warning", "storage_warning"]) warnOf(name, state[name]);
  const isViewer = document.body.dataset.role === "viewer";
  const refusals = refusalsOf(state);
  for (const button of document.querySelectorAll("[data-mission]")) {
    const { mission } = button.dataset;
    set(button, { disabled: refusals[mission] !== "", title: refusals[mission] || (TITLES[mission] ?? "") });
  }
  set(document.querySelector("[data-mission=leave]"), { hidden: refusals.leave !== "" });
  set(element("stop"), { ariaPressed: String(state.stop_latched) });
  set(element("reset"), {
    disabled: !state.stop_latched || isViewer,
    title: !state.stop_latched
      ? t("No stop is latched")
      : isViewer
        ? t("Viewers cannot reset the stop")
        : t("Release the stop; a mission stays paused"),
  });
  element("reset").classList.toggle("due", state.stop_latched && !isViewer);
}

onStale(() => {
  for (const button of document.querySelectorAll("[data-mission]"))
    set(button, { disabled: true, title: t("no connection") });
  set(element("stop"), { ariaPressed: "mixed" });
  set(element("reset"), { disabled: true, title: t("no connection") });
  element("reset").classList.remove("due");
});

for (const button of document.querySelectorAll("[data-mission]")) {
  button.onclick = () => attempt(() => post(`/mission/${button.dataset.mission}`));
}
element("reset").onclick = () => attempt(() => post(`/stop/reset?stops=${seenStops}`));
