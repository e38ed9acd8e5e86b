// How old is what is shown: picture, map, path, connection. What is old fades, and says so.

import { age, make, setText } from "../core/dom.js";

const OLD_S = { picture: 1.0, map: 2.0, path: 2.0, link: 1.0 };
const TITLES = {
  picture: "Age of the newest camera picture", map: "How long ago the map that is shown was the robot's",
  path: "How long ago the path that is shown was the robot's", link: "Time since the console last heard from the robot's side",
};
// When each was last known to be the robot's own, on this page's clock; null: there is none.
const fresh = { picture: null, map: null, path: null, link: null };
const shown = { map: null, path: null };
let hasPath = false;
let chips = {};

export function build(box) {
  chips = Object.fromEntries(Object.keys(OLD_S).map((name) => [name, make("span", { class: "age", title: TITLES[name], "data-testid": `age-${name}` })]));
  box.append(...Object.values(chips));
}

// `onMap`: this page draws map and path itself; else the 3D view follows the robot by itself.
export function heard(state, mapVersion, onMap) {
  const now = performance.now();
  fresh.link = now;
  fresh.picture = state.frame_age_s === null ? null : now - 1000 * state.frame_age_s;
  if (!onMap) hasPath = state.distance_to_goal_m !== null;
  // The tick confirms map and path anew with each picture; until the page has loaded the newest, its own is getting old.
  if (!onMap || shown.map === mapVersion) fresh.map = fresh.picture;
  if (!hasPath) fresh.path = null;
  else if (!onMap || shown.path === state.picture_serial || fresh.path === null) fresh.path = fresh.picture;
}

// Asked for at `asked`, it was the robot's own by the picture that was the newest then, whatever has come since.
export function loaded(what, version, asked, filled = true) {
  shown[what] = version;
  if (fresh.picture !== null) fresh[what] = Math.max(fresh[what] ?? 0, Math.min(asked, fresh.picture));
  if (what === "path") hasPath = filled;
}

setInterval(() => {
  const now = performance.now();
  for (const [name, chip] of Object.entries(chips)) {
    const seconds = fresh[name] === null ? null : Math.max(now - fresh[name], 0) / 1000;
    const old = seconds !== null && seconds > OLD_S[name];
    // What is fresh is not counted in tenths: the page would be painted for them five times a second.
    setText(chip, `${old ? "▲ " : ""}${name} ${seconds === null ? "–" : old ? age(seconds) : `< ${OLD_S[name]} s`}`);
    if (chip.classList.contains("old") !== old) { chip.classList.toggle("old", old); document.body.classList.toggle(`old-${name}`, old); }
  }
}, 200);
