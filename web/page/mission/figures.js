// Position, speed and other figures below the view, twice a second at most.

import { element, make, set, setText } from "../core/dom.js";
import { formatNumber } from "../core/format.js";

const FIGURES_MS = 500;
const PLACES = {
  located: "located",
  "dead reckoning": "by the wheels",
  ambiguous: "unsure",
  lost: "lost",
};
let shownMs = 0;

export function showFigures(state) {
  showSegmenter(state);
  const nowMs = performance.now();
  if (nowMs - shownMs < FIGURES_MS) return;
  shownMs = nowMs;
  const { pose, place, twist } = state;
  const rows = [
    ["position", pose.x_m === null ? "unknown" : `${pose.x_m.toFixed(2)}, ${pose.y_m.toFixed(2)} m`],
    ["place", `${PLACES[place.state]} ± ${place.major_m.toFixed(2)} m`],
    ["speed", formatNumber(twist.v_mps, 2, "m/s")],
    ["to goal", formatNumber(state.distance_to_goal_m, 1, "m")],
    ["not seen", formatNumber(state.unseen_m, 1, "m")],
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

function showSegmenter({ segmenter, segmenter_warning: warning }) {
  setText(element("segmenter"), warning ? `▲ ${warning}` : segmenter);
  set(element("segmenter"), { className: warning ? "segmenter lost" : "segmenter" });
}
