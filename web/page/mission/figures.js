// Position, speed and other figures below the view, twice a second at most.

import { onStale } from "../core/link/connection.js";
import { element, make, set, setText } from "../core/dom.js";
import { formatNumber } from "../core/text/format.js";
import { number, sentence, t } from "../core/text/language.js";

const FIGURES_MS = 500;
const PLACES = {
  located: t("located"),
  "dead reckoning": t("by the wheels"),
  checking: t("checking"),
  ambiguous: t("unsure"),
  lost: t("lost"),
};
const KNOWN = new Set(["located", "dead reckoning"]);
let shownMs = 0;

// What is not known has no uncertainty: that would be of where the robot was taken to be.
function placeText({ state, on_trial: isOnTrial, major_m: majorM }) {
  if (!KNOWN.has(state)) return PLACES[state];
  return `${isOnTrial ? t("being confirmed") : PLACES[state]} ± ${number(majorM, 2)} m`;
}

export function showFigures(state) {
  showSegmenter(state);
  const nowMs = performance.now();
  if (nowMs - shownMs < FIGURES_MS) return;
  shownMs = nowMs;
  const { pose, place, twist } = state;
  const rows = [
    [t("position"), pose.x_m === null ? t("unknown") : `${pose.x_m.toFixed(2)}, ${pose.y_m.toFixed(2)} m`],
    [t("place"), placeText(place)],
    [t("speed"), formatNumber(twist.v_mps, 2, "m/s")],
    [t("to goal"), formatNumber(state.distance_to_goal_m, 1, "m")],
    [t("not seen"), formatNumber(state.unseen_m, 1, "m")],
    [t("driven"), formatNumber(state.travelled_m, 1, "m")],
    [t("seen"), formatNumber(state.explored_m2, 0, "m²")],
    [t("plans"), String(state.replans)],
    [t("tick"), formatNumber(state.tick_ms, 0, "ms")],
  ];
  const list = element("figures");
  if (!list.children.length)
    list.append(...rows.map(([name]) => make("div", {}, make("dt", {}, name), make("dd"))));
  rows.forEach(([, value], i) => setText(list.children[i].lastChild, value));
}

onStale(() => {
  for (const value of element("figures").querySelectorAll("dd")) setText(value, t("unknown"));
  setText(element("segmenter"), t("unknown"));
});

function showSegmenter({ segmenter, segmenter_warning: warning }) {
  setText(element("segmenter"), warning ? `▲ ${sentence(warning)}` : sentence(segmenter));
  set(element("segmenter"), { className: warning ? "segmenter lost" : "segmenter" });
}
