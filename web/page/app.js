// The wiring of the page: the robot's state arrives by websocket, the rest follows its versions.

import "./access/account.js";
import * as ownName from "./access/own_name.js";
import * as bewareList from "./beware/beware_list.js";
import { close as closeEntry } from "./beware/entry.js";
import { cancel as cancelProposal } from "./beware/proposal.js";
import { connect, get } from "./core/link/api.js";
import * as connection from "./core/link/connection.js";
import { t } from "./core/text/language.js";
import "./core/language_switch.js";
import { element, loadSetting, saveSetting } from "./core/dom.js";
import { isNarrow, selectTab } from "./core/page_tabs.js";
import { delivered, takeOver } from "./core/stop.js";
import { dropQuestions, notify } from "./core/toasts.js";
import { oneAtATime, setMoving } from "./core/link/updates.js";
import * as camera from "./insight/camera.js";
import * as drawer from "./insight/drawer.js";
import * as freshness from "./insight/freshness.js";
import { forget as forgetSeries } from "./insight/plots/plots.js";
import { showMapBy, swap } from "./insight/swap.js";
import { switchViewBy } from "./keys.js";
import { showLayers } from "./map/layers.js";
import * as map from "./map/map.js";
import * as mapUpdates from "./map/updates.js";
import { centreOn, follow as followRobot, onView, view as mapView, zoom } from "./map/view.js";
import { closeMenu } from "./map/pointer/map_menu.js";
import { cancelPress } from "./map/pointer/pointer.js";
import { lightRows } from "./map/pointer/selection.js";
import { showViewer, webgl } from "./viewer/viewer.js";
import "./viewer/layers.js";
import { look, mark, onLinkOpen } from "./viewer/link.js";
import "./viewer/pointer.js";
import { enableButtons } from "./mission/buttons.js";
import { showFigures } from "./mission/figures.js";
import { dropOffer, showGoals } from "./mission/goals.js";
import { onProposal, showPlace, withdraw } from "./localisation/place.js";
import { showPathSettings } from "./mission/path_settings.js";
import { showStatus } from "./mission/status.js";
import "./mission/teleop.js";
import * as sites from "./sites/sites.js";
import { draft, isDrawing, numberZonesBy, onDraft, setMode } from "./zones/draft.js";
import "./zones/draft_input.js";
import * as zoneFiles from "./zones/files.js";
import "./zones/from_camera.js";
import * as zoneList from "./zones/zones.js";

const VIEW_KEY = "console.view";
const ZOOM_FACTOR = 1.3;
const STATE_REST_S = 3; // ten states arrive a second, also in a hidden page
const versions = { zones: null, beware: null };
let state = null;
let zones = [];

const isOnMap = () => document.body.dataset.view === "map";

const loadZones = oneAtATime(async () => {
  const collection = await get("/zones");
  zones = collection.features;
  zoneList.show(collection);
  lightRows();
  map.update({ zones });
});

const loadBeware = oneAtATime(async () => {
  const beware = await get("/beware");
  bewareList.show(beware);
  showLayers(beware.classes);
  map.update({ classes: beware.classes });
  drawer.update({ beware });
});

function showState(next) {
  state = next;
  // What belongs to a site is loaded again, whatever its version.
  if (sites.update(state)) {
    forgetVersions();
    // What was begun on the map of another site is nowhere on this one.
    setMode("navigate");
    closeMenu();
    cancelPress();
    dropOffer();
    dropQuestions();
    withdraw();
    closeEntry();
    cancelProposal();
  }
  setMoving(state.moving);
  if (state.stop_pressed) delivered();
  showStatus(state);
  showPlace(state);
  enableButtons(state);
  showFigures(state);
  showGoals(state);
  showPathSettings(state);
  lightRows();
  follow();
  map.update({ state });
  freshness.stateArrived(state, mapUpdates.versionOf(state), isOnMap());
  drawer.update({ state });
  // Last: where one of these fails, what the page shows is not of now.
  connection.stateArrived();
}

// A console that was started again counts from zero again, and another site has values of its own.
function forgetVersions() {
  Object.assign(versions, { zones: null, beware: null });
  mapUpdates.forget();
  forgetSeries();
}

// A hidden page asks for nothing but the state.
function follow() {
  if (document.hidden) return;
  for (const [name, load] of [
    ["zones", loadZones],
    ["beware", loadBeware],
  ]) {
    const version = state[`${name}_version`];
    if (versions[name] === version) continue;
    versions[name] = version;
    load();
  }
  mapUpdates.follow(state);
  camera.follow(state);
}

function showView(name) {
  if (name === "3d") swap(false);
  document.body.dataset.view = name;
  for (const tab of viewTabs) tab.setAttribute("aria-selected", String(tab.dataset.view === name));
  element("panel-3d").hidden = name !== "3d";
  element("panel-map").hidden = name !== "map";
  showViewer(name === "3d");
  mapUpdates.setShown(name === "map", state);
  history.replaceState(null, "", `#${name}`);
  saveSetting(VIEW_KEY, name); // the login forgets the address
}

// After a click on a tool by mouse or finger the keys belong to the map again.
document.querySelector(".tools").addEventListener("click", (event) => {
  if (event.detail > 0 && isOnMap() && event.target.closest("button:not([popovertarget])"))
    element("map-canvas").focus({ preventScroll: true });
});

const viewTabs = document.querySelectorAll("[data-view][role=tab]");
for (const tab of viewTabs) tab.onclick = () => showView(tab.dataset.view);
showMapBy(() => showView("map"));
switchViewBy(() => showView(isOnMap() ? "3d" : "map"));
// Freehand is a stroke, which in the 3D view turns the camera.
onDraft(() => {
  if (draft.mode === "draw" && draft.tool === "free" && !isOnMap()) showView("map");
});

for (const button of document.querySelectorAll("[data-mode]"))
  button.onclick = () => setMode(button.dataset.mode);
const zooms = {
  fit: map.fit,
  in: () => zoom(ZOOM_FACTOR),
  out: () => zoom(1 / ZOOM_FACTOR),
  follow: () => followRobot(!mapView.follows),
};
for (const button of document.querySelectorAll("[data-zoom]"))
  button.onclick = () => zooms[button.dataset.zoom]();
onProposal(map.redraw);
onView(() =>
  document
    .querySelector("[data-zoom=follow]")
    .setAttribute("aria-pressed", String(mapView.follows)),
);

bewareList.build(loadBeware);
zoneList.build(loadZones);
zoneFiles.build(loadZones);
numberZonesBy(() => {
  const names = new Set(zones.map((zone) => zone.properties.name));
  let number = zones.length + 1;
  while (names.has(t("Zone {number}", { number }))) number += 1;
  return number;
});
drawer.start({
  look: (place) => {
    centreOn(place);
    look("place", place);
  },
  mark,
  showSightings: (sightings) => map.update({ sightings }),
});
onLinkOpen(drawer.resendMarks);

// On a narrow window a zone is drawn on the map's tab, wherever its drawing was begun.
let wasDrawing = false;
onDraft(() => {
  if (isDrawing() && !wasDrawing) selectTab("map");
  wasDrawing = isDrawing();
});

// Each error is shown once, and few at a time: one in the handling of a state comes back with every
// state. After it was dismissed it is told again, but leaves time to work. A request without an answer,
// as one that the stop has aborted, is no error of the page.
const MAX_ERRORS = 3;
const TOLD_AGAIN_MS = 60_000;
const told = new Map();
function tellError(error) {
  if (error?.status === 0) return;
  const message = String(error?.message ?? error);
  const nowMs = performance.now();
  const { toast, toldMs } = told.get(message) ?? {};
  const shown = [...told.values()].filter((one) => one.toast.isConnected).length;
  if (toast?.isConnected || shown >= MAX_ERRORS || nowMs - toldMs < TOLD_AGAIN_MS) return;
  const text = t("Error in this page: {message}", { message });
  told.set(message, { toast: notify(text, { stays: true }), toldMs: nowMs });
}
// Where the browser itself reports, as of sizes that are measured late, there is no error.
window.addEventListener("error", ({ error }) => error && tellError(error));
window.addEventListener("unhandledrejection", ({ reason }) => tellError(reason));
connect("/events", { onMessage: showState, onClose: forgetVersions, restS: STATE_REST_S });
setMode("navigate");
// A processor would be slow at drawing the 3D view: there it waits until it is asked for.
const asked = { "#map": "map", "#3d": "3d" }[location.hash];
showView(asked ?? loadSetting(VIEW_KEY, null) ?? (webgl === "hardware" && !isNarrow() ? "3d" : "map"));
ownName.start().catch(() => {}); // a lost connection has its own banner
takeOver();
