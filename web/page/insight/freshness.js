// The age of what is shown: camera image, map, path, connection. What is old says so, and fades while
// the robot moves or the link is lost. What counts as old depends on what this computer reaches.

import { make, setText } from "../core/dom.js";
import { formatAge } from "../core/text/format.js";
import { number, t } from "../core/text/language.js";

const UPDATE_MS = 200;
const OLD_S = { image: 1.0, map: 2.0, path: 2.0, link: 1.0 };
const LONGEST_OLD_S = 5;
const STANDING_OLD_S = 10;
const TITLES = {
  image: t("Age of the newest camera image"),
  map: t("Age of the map on this page"),
  path: t("Age of the path on this page"),
  link: t("Time since the console last heard from the robot"),
};
const NAMES = { image: t("image"), map: t("map"), path: t("path"), link: t("link") };
const USUAL_FACTOR = 4; // old: so many times the usual age of an image
const USUAL_GAIN = 0.01; // of the mean age, by every state
let usualS = 0;
let isMoving = false;
// When each value was last known to be current, on this page's clock; null where there is none.
const currentMs = { image: null, map: null, path: null, link: null };
const shownVersion = { map: null, path: null };
let hasPath = false;
let chips = {};

export function build(box) {
  const chipOf = (name) =>
    make("span", { class: "age", title: TITLES[name], "data-testid": `age-${name}` });
  chips = Object.fromEntries(Object.keys(OLD_S).map((name) => [name, chipOf(name)]));
  box.append(...Object.values(chips));
}

// `isOnMap`: this page draws map and path itself; the 3D view follows the robot without it.
export function stateArrived(state, mapVersion, isOnMap) {
  const now = performance.now();
  currentMs.link = now;
  isMoving = state.moving;
  usualS += USUAL_GAIN * ((state.map_age_s ?? usualS) - usualS);
  currentMs.image = state.map_age_s === null ? null : now - 1000 * state.map_age_s;
  if (!isOnMap) hasPath = state.distance_to_goal_m !== null;
  // Every tick confirms map and path; what this page has loaded ages until it loads the newest.
  if (!isOnMap || shownVersion.map === mapVersion) currentMs.map = currentMs.image;
  if (!hasPath) currentMs.path = null;
  else if (!isOnMap || shownVersion.path === state.picture_serial || currentMs.path === null)
    currentMs.path = currentMs.image;
}

// A value that was asked for at `askedMs` is as current as the newest image was then.
export function loaded(name, version, askedMs, isFilled = true) {
  shownVersion[name] = version;
  if (name === "path") hasPath = isFilled;
  if (!isFilled) currentMs[name] = null;
  else if (currentMs.image !== null) {
    currentMs[name] = Math.max(currentMs[name] ?? 0, Math.min(askedMs, currentMs.image));
  }
}

const oldS = (name) =>
  Math.max(OLD_S[name], name === "link" ? 0 : Math.min(USUAL_FACTOR * usualS, LONGEST_OLD_S));

function show() {
  const now = performance.now();
  for (const [name, chip] of Object.entries(chips)) {
    const seconds = currentMs[name] === null ? null : Math.max(now - currentMs[name], 0) / 1000;
    const isOld = seconds !== null && seconds > oldS(name);
    // A fresh age is not counted in tenths: that would paint the page five times a second.
    const age = seconds === null ? "–" : isOld ? formatAge(seconds) : `< ${number(OLD_S[name], 0)} s`;
    setText(chip, `${isOld ? "▲ " : ""}${NAMES[name]} ${age}`);
    chip.classList.toggle("old", isOld);
    // Around a standing robot nothing has to be newer than the link.
    const isFaded = isOld && (isMoving || name === "link" || seconds > STANDING_OLD_S);
    document.body.classList.toggle(`old-${name}`, isFaded);
  }
}

setInterval(show, UPDATE_MS);
