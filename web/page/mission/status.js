// The status line: the one place that says what the robot does, or what holds it.

import { post } from "../core/link/api.js";
import { onStale } from "../core/link/connection.js";
import { element, set, setText } from "../core/dom.js";
import { formatAge } from "../core/text/format.js";
import { capitalised, number, sentence, t } from "../core/text/language.js";
import { attempt } from "../core/toasts.js";
import { holdFilter, NEEDED_HZ, rateMeter } from "./calm.js";

const SLOWEST_CHANGE_MS = 1000;
const OFFLINE_S = 3; // a shorter loss moves nothing on the page
const CONSOLE = t("Operator console");
const BADGES = {
  unknown: t("? UNKNOWN"),
  stopped: t("■ STOPPED"),
  held: t("▲ HELD"),
  idle: t("● IDLE"),
  paused: t("❚❚ PAUSED"),
  driving: t("▶ DRIVING"),
  leaving: t("▶ LEAVING"),
  hand: t("◉ BY HAND"),
  searching: t("▶ LOOKING ROUND"),
};
// Changes to and from these are shown at once.
const URGENT = new Set(["stopped", "unknown"]);
const isHoldShown = holdFilter();
const imagesPerSecond = rateMeter();
let line = { kind: "unknown", text: "" };
let changedMs = -SLOWEST_CHANGE_MS;
let freeText = "";
let isSlowDismissed = false;

export function showStatus(state) {
  const nowMs = performance.now();
  set(element("offline"), { hidden: true });
  const isStopping = state.stop_latched || kindOf(state) === "paused";
  const isHeld = isHoldShown(state.reasons.length > 0 && !isStopping, nowMs);
  if (!state.reasons.length) freeText = sentence(state.summary);
  showLine(lineOf(state, isHeld), nowMs);
  showRate(state, nowMs);
  set(element("back-off"), { hidden: !state.reasons.some((reason) => reason.offer === "back-off") });
  const title = `${state.scenario} · ${state.robot}`;
  set(document, { title: `${title} · ${CONSOLE}` });
  set(element("mark"), { ariaLabel: `${CONSOLE} · ${title}` });
  set(element("nothing-enabled"), { hidden: state.beware_enabled > 0 });
}

// A robot that looks for its place turns, though its mission is paused or there is none.
const kindOf = (state) => (state.place.searching ? "searching" : state.phase);

function lineOf(state, isHeld) {
  const reasons = state.reasons.map((reason) => sentence(reason.text)).join(" · ");
  // The stop is latched before the command thread names it as a reason.
  if (state.stop_latched) return { kind: "stopped", text: reasons || t("emergency stop") };
  if (state.by_hand && state.moving) return { kind: "hand", text: sentence(state.summary) };
  if (kindOf(state) === "paused") return { kind: "paused", text: sentence(state.summary) };
  if (isHeld) return { kind: "held", text: reasons || line.text };
  return { kind: kindOf(state), text: state.reasons.length ? freeText : sentence(state.summary) };
}

function showLine(given, nowMs) {
  const next = { kind: given.kind, text: capitalised(given.text) };
  if (next.kind === line.kind && next.text === line.text) return;
  const isUrgent = next.kind !== line.kind && (URGENT.has(next.kind) || URGENT.has(line.kind));
  if (!isUrgent && nowMs - changedMs < SLOWEST_CHANGE_MS) return;
  [line, changedMs] = [next, nowMs];
  set(element("status").dataset, { kind: next.kind });
  setText(element("badge"), BADGES[next.kind] ?? next.kind.toUpperCase());
  setText(element("summary"), next.text);
  set(element("summary"), { title: next.text });
}

// Said once, in figures: a robot that is held for want of images says it many times a second.
function showRate({ images }, nowMs) {
  const rate = images === 0 ? null : imagesPerSecond(images, nowMs);
  // Without any image there is another reason, which the line names.
  const isSlow = rate > 0 && rate < NEEDED_HZ && !isSlowDismissed;
  const box = element("too-slow");
  if (isSlow && box.hidden)
    setText(
      box.firstElementChild,
      t(
        "▲ This computer is too slow for the robot: {rate} images a second, at least {needed} " +
          "are needed. Close other programs, or choose a faster network (bewarenav doctor).",
        { rate: number(rate, 1), needed: NEEDED_HZ },
      ),
    );
  if (rate === null || isSlow || rate > 1.5 * NEEDED_HZ || isSlowDismissed)
    set(box, { hidden: !isSlow });
}

element("back-off").onclick = () => attempt(() => post("/mission/back-off"));
element("too-slow-close").onclick = () => {
  isSlowDismissed = true;
  set(element("too-slow"), { hidden: true });
};

onStale((seconds) => {
  for (const id of ["back-off", "nothing-enabled", "too-slow"]) set(element(id), { hidden: true });
  set(element("offline"), { hidden: seconds < OFFLINE_S });
  const age = seconds < 60 ? `${Math.floor(seconds)} s` : formatAge(seconds);
  showLine(
    {
      kind: "unknown",
      text: t(
        "NO CONNECTION for {age}: what is below is out of date. STOP is still sent.",
        { age },
      ),
    },
    performance.now(),
  );
});
