// The robot's state in words and numbers: badge, reasons, buttons of the mission, figures.

import { post } from "../core/api.js";
import { element, formatNumber, make, set, setText } from "../core/dom.js";
import { attempt } from "../core/toasts.js";

const FIGURES_MS = 500;
const BADGES = {
  stopped: "■ STOPPED",
  held: "▲ HELD",
  idle: "● IDLE",
  paused: "❚❚ PAUSED",
  driving: "▶ DRIVING",
  hand: "◉ BY HAND",
};
let figuresShownMs = 0;

export function showStatus(state) {
  const kind = kindOf(state);
  set(element("badge").dataset, { kind });
  setText(element("badge"), BADGES[kind] ?? kind);
  setText(element("summary"), state.summary);
  set(element("summary"), { title: state.summary });
  setText(element("world"), `${state.scenario} · ${state.robot}`);
  setText(element("phase"), state.phase);
  set(element("nothing-enabled"), { hidden: state.beware_enabled > 0 });
  setText(
    element("segmenter"),
    state.segmenter_warning ? `▲ ${state.segmenter_warning}` : state.segmenter,
  );
  element("segmenter").classList.toggle("lost", state.segmenter_warning !== null);
  showReasons(state);
  enableButtons(state);
  showFigures(state);
}

function kindOf(state) {
  if (state.stop_latched) return "stopped";
  if (state.by_hand && state.moving) return "hand";
  if (state.phase === "paused") return "paused";
  return state.reasons.length ? "held" : state.phase;
}

function showReasons(state) {
  set(element("reasons").dataset, {
    kind: state.stop_latched ? "stopped" : state.reasons.length ? "held" : "clear",
  });
  // The stop is latched before the command thread names it as a reason.
  const texts =
    state.reasons.length || !state.stop_latched
      ? state.reasons.map((reason) => reason.text)
      : ["emergency stop"];
  setText(element("reasons-head"), texts.length ? "Why it is not moving:" : "✓ Free to move.");
  const list = element("reasons-list");
  if ([...list.children].map((child) => child.textContent).join("\n") === texts.join("\n")) return;
  list.replaceChildren(...texts.map((text) => make("li", {}, text)));
}

function enableButtons(state) {
  const isEnabled = {
    start: state.phase === "idle" && state.queue.length > 0,
    pause: ["driving", "leaving"].includes(state.phase),
    resume: state.phase === "paused",
    cancel: state.queue.length > 0 || state.phase !== "idle",
    leave: state.in_zone && !state.stop_latched,
  };
  for (const button of document.querySelectorAll("[data-mission]"))
    set(button, { disabled: !isEnabled[button.dataset.mission] });
  set(document.querySelector("[data-mission=leave]"), { hidden: !isEnabled.leave });
  set(element("stop"), { ariaPressed: String(state.stop_latched) });
  set(element("reset"), { disabled: !state.stop_latched });
  element("reset").classList.toggle("due", state.stop_latched);
}

function showFigures(state) {
  const now = performance.now();
  if (now - figuresShownMs < FIGURES_MS) return;
  figuresShownMs = now;
  const { pose, twist } = state;
  const rows = [
    [
      "position",
      pose.x_m === null ? "unknown" : `${pose.x_m.toFixed(2)}, ${pose.y_m.toFixed(2)} m`,
    ],
    ["speed", formatNumber(twist.v_mps, 2, "m/s")],
    ["to goal", formatNumber(state.distance_to_goal_m, 1, "m")],
    ["driven", formatNumber(state.travelled_m, 1, "m")],
    ["seen", formatNumber(state.explored_m2, 0, "m²")],
    ["plans", String(state.replans)],
    ["tick", formatNumber(state.tick_ms, 0, "ms")],
  ];
  const list = element("figures");
  if (!list.children.length)
    list.append(...rows.map(([name]) => make("div", {}, make("dt", {}, name), make("dd"))));
  rows.forEach(([, value], i) => setText(list.children[i].lastChild, value));
}

for (const button of document.querySelectorAll("[data-mission]")) {
  button.onclick = () => attempt(() => post(`/mission/${button.dataset.mission}`));
}
element("reset").onclick = () => attempt(() => post("/stop/reset"));
