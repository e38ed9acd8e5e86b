// Fetches what the map shows, when the robot's state says that it has changed.

import { get } from "../core/link/api.js";
import { t } from "../core/text/language.js";
import { showProgress } from "../core/link/progress.js";
import { oneAtATime, pause } from "../core/link/updates.js";
import * as freshness from "../insight/freshness.js";
import { onLayers, strength } from "./layers.js";
import * as map from "./map.js";
import * as tiles from "./ground/tiles.js";

const MAP_MS = 400;
const PATH_MS = 300;
const CANDIDATES_MS = 250;
const NO_CANDIDATES = { arcs: [], chosen: null };
let mapVersion = null;
let pictureSerial = null;
let isShown = false;

export const versionOf = (state) => `${state.grid_version}-${state.beware_version}`;

const loadMap = oneAtATime(async () => {
  const [version, askedMs] = [mapVersion, performance.now()];
  const { canvas, frame } = await showProgress(tiles.loadNewest(), t("the map"));
  map.update({ map: frame, picture: canvas });
  freshness.loaded("map", version, askedMs);
  await pause(MAP_MS);
});

const loadPath = oneAtATime(async () => {
  const askedMs = performance.now();
  const { serial, ...paths } = await get("/path");
  map.update(paths);
  freshness.loaded("path", serial, askedMs, paths.path.length > 0);
  await pause(PATH_MS);
});

// Only while their layer is on: the robot computes them on request.
const loadCandidates = oneAtATime(async () => {
  if (strength("candidates") === 0) {
    map.update({ candidates: NO_CANDIDATES });
    return;
  }
  map.update({ candidates: await get("/candidates") });
  await pause(CANDIDATES_MS);
});

// Show or hide the map; while it is hidden nothing of it is fetched.
export function setShown(shown, state) {
  isShown = shown;
  if (!shown || !state) return;
  pictureSerial = null;
  follow(state);
  map.update({});
}

export function follow(state) {
  if (!isShown || state.picture_serial === null) return;
  if (mapVersion !== versionOf(state)) {
    mapVersion = versionOf(state);
    loadMap();
  }
  if (pictureSerial !== state.picture_serial) {
    pictureSerial = state.picture_serial;
    loadPath();
    loadCandidates();
  }
}

// After a lost connection the console may serve another world, and another site is one.
export function forget() {
  tiles.forget();
  mapVersion = null;
}

onLayers(() => {
  if (isShown) loadCandidates();
});
