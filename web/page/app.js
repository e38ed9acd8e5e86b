// The page's wiring: the robot's state comes in by websocket, everything else follows its version numbers.

import { connect, get, post } from "./core/api.js";
import "./access/account.js";
import "./mission/teleop.js";
import { clicked, draft, dragged, drawing, nameZonesBy, onDraft, ring, setMode } from "./zones/draft.js";
import "./zones/draft_keys.js";
import { showGoals } from "./mission/goals.js";
import { onKey, pressStop, swallowSpace, switchViewBy } from "./keys.js";
import { onLayers, showLayers, strength } from "./map/layers.js";
import { showBeware, showLegend } from "./beware/beware_list.js";
import * as map from "./map/map.js";
import { isNarrow } from "./core/page_tabs.js";
import "./zones/from_camera.js";
import { attempt, say } from "./core/toasts.js";
import { during } from "./core/progress.js";
import * as ages from "./insight/freshness.js";
import { element, set, setText } from "./core/dom.js";
import * as tiles from "./map/tiles.js";
import * as understand from "./insight/drawer.js";
import { address as viewerAddress, hurryViewer, showViewer, tellViewer, webgl } from "./map/viewer.js";
import { centreOn, follow as followRobot, onView, view as mapView, zoom } from "./map/view.js";
import { showZones } from "./zones/zones.js";

const STALE_MS = 1000;
const CAMERA_MS = 250;
const MAP_MS = 400;
const CANDIDATES_MS = 250;
const PATH_MS = 300;
const FIGURES_MS = 500;
const seen = { zones: null, beware: null, map: null, picture: null };
let arrivedAt = performance.now();
let figuresAt = 0;
let mapSize = "";
let state = null;
let zones = [];

// ------------------------------------------------------------------------------------------------------ the robot's state

const text = (id, value) => setText(element(id), value);

function showState(next) {
  state = next;
  arrivedAt = performance.now();
  const kind = state.stop_latched ? "stopped" : state.by_hand && state.moving ? "hand" : state.reasons.length ? "held" : state.phase;
  const words = { stopped: "■ STOPPED", held: "▲ HELD", idle: "● IDLE", paused: "❚❚ PAUSED", driving: "▶ DRIVING", hand: "◉ BY HAND" };
  set(element("badge").dataset, { kind });
  text("badge", words[kind] ?? kind);
  text("summary", state.summary);
  set(element("summary"), { title: state.summary });
  text("world", `${state.scenario} · ${state.robot}`);
  text("phase", state.phase);
  element("bewares-of-nothing").hidden = state.beware_enabled > 0;
  text("segmenter", state.segmenter_warning ? `▲ ${state.segmenter_warning}` : state.segmenter);
  element("segmenter").classList.toggle("lost", state.segmenter_warning !== null);
  showReasons();
  showButtons();
  if (arrivedAt - figuresAt >= FIGURES_MS) { figuresAt = arrivedAt; showFigures(); }
  showGoals(state);
  follow();
  map.update({ state });
  ages.heard(state, `${state.grid_version}-${state.beware_version}`, document.body.dataset.view === "map");
  understand.update({ state });
}

function showReasons() {
  const box = element("reasons");
  set(box.dataset, { kind: state.stop_latched ? "stopped" : state.reasons.length ? "held" : "clear" });
  // The stop is latched before the command thread has said so in its reasons.
  const wanted = state.reasons.length || !state.stop_latched ? state.reasons.map((reason) => reason.text) : ["emergency stop"];
  text("reasons-head", wanted.length ? "Why it stands:" : "✓ Nothing holds the robot.");
  const list = element("reasons-list");
  if ([...list.children].map((child) => child.textContent).join("\n") === wanted.join("\n")) return;
  list.replaceChildren(...wanted.map((words) => Object.assign(document.createElement("li"), { textContent: words })));
}

function showButtons() {
  const allowed = { start: state.phase === "idle" && state.queue.length > 0, pause: ["driving", "leaving"].includes(state.phase), resume: state.phase === "paused", cancel: state.queue.length > 0 || state.phase !== "idle", leave: state.in_zone && !state.stop_latched };
  for (const button of document.querySelectorAll("[data-mission]")) set(button, { disabled: !allowed[button.dataset.mission] });
  set(document.querySelector("[data-mission=leave]"), { hidden: !allowed.leave });
  set(element("stop"), { ariaPressed: String(state.stop_latched) });
  set(element("reset"), { disabled: !state.stop_latched });
  element("reset").classList.toggle("due", state.stop_latched);
}

function showFigures() {
  const number = (value, digits, unit) => (value === null ? "–" : `${value.toFixed(digits)} ${unit}`);
  const rows = [
    ["position", state.pose.x_m === null ? "unknown" : `${state.pose.x_m.toFixed(2)}, ${state.pose.y_m.toFixed(2)} m`],
    ["speed", number(state.twist.v_mps, 2, "m/s")], ["to goal", number(state.distance_to_goal_m, 1, "m")],
    ["driven", number(state.travelled_m, 1, "m")], ["seen", number(state.explored_m2, 0, "m²")],
    ["paths", String(state.replans)], ["tick", number(state.tick_ms, 0, "ms")],
  ];
  const list = element("figures");
  if (!list.children.length) list.append(...rows.map(([name]) => { const row = document.createElement("div"); row.append(Object.assign(document.createElement("dt"), { textContent: name }), document.createElement("dd")); return row; }));
  rows.forEach(([, value], i) => { const cell = list.children[i].lastChild; if (cell.textContent !== value) cell.textContent = value; });
}

// ------------------------------------------------------------------------------------------------------- the large values

// One request at a time per thing, and one more if it changed meanwhile: a slow link is never flooded.
function fetcher(load) {
  let busy = false;
  let again = false;
  return async function run() {
    if (busy) { again = true; return; }
    busy = true;
    try { await load(); } catch { /* the next change tries again; a lost connection has its own banner */ }
    busy = false;
    if (again) { again = false; run(); }
  };
}

const loadZones = fetcher(async () => { const collection = await get("/zones"); zones = collection.features; showZones(collection, loadZones); map.update({ zones }); });
const loadBeware = fetcher(async () => {
  const beware = await get("/beware");
  showBeware(beware, loadBeware);
  showLegend(beware);
  showLayers(beware.classes);
  map.update({ classes: beware.classes });
  understand.update({ beware });
});
const loadPath = fetcher(async () => {
  const asked = performance.now();
  const { serial, ...ways } = await get("/path");
  map.update(ways);
  ages.loaded("path", serial, asked, ways.path.length > 0);
  await pause(PATH_MS);
});
// Only for whoever wants to see them: the robot works them out when it is asked.
const loadCandidates = fetcher(async () => {
  if (strength("candidates") === 0) { map.update({ candidates: { arcs: [], chosen: null } }); return; }
  map.update({ candidates: await get("/candidates") });
  await pause(CANDIDATES_MS);
});
const loadMap = fetcher(async () => {
  const [version, asked] = [seen.map, performance.now()];
  const { canvas, rows, cols } = await during(tiles.newest(), "the map");
  // Where it lies is asked only of another map.
  if (mapSize !== `${rows} ${cols}`) { map.update({ map: await get("/map") }); mapSize = `${rows} ${cols}`; }
  map.update({ picture: canvas });
  ages.loaded("map", version, asked);
  await pause(MAP_MS);
});
const loadCamera = fetcher(async () => {
  const image = await loadImage(`/api/v1/camera.jpg?overlay=${element("overlay").checked ? "segmentation" : "none"}&v=${seen.picture}`);
  element("camera").src = image.src;
  await pause(CAMERA_MS);
});

// Around a robot that stands little changes.
const pause = (ms) => new Promise((resolve) => setTimeout(resolve, state?.moving ? ms : 2 * ms));

function loadImage(source) {
  return new Promise((resolve, reject) => {
    const image = new Image();
    image.onload = () => resolve(image);
    image.onerror = () => reject(new Error("no picture"));
    image.src = source;
  });
}

// A page that nobody sees asks for nothing but the state.
function follow() {
  if (document.hidden) return;
  if (seen.zones !== state.zones_version) { seen.zones = state.zones_version; loadZones(); }
  if (seen.beware !== state.beware_version) { seen.beware = state.beware_version; loadBeware(); }
  if (state.picture_serial === null) return;
  const onMap = document.body.dataset.view === "map";
  const version = `${state.grid_version}-${state.beware_version}`;
  if (onMap && seen.map !== version) { seen.map = version; loadMap(); }
  if (seen.picture !== state.picture_serial) { seen.picture = state.picture_serial; if (element("camera").offsetParent) loadCamera(); if (onMap) { loadPath(); loadCandidates(); } }
}

// ------------------------------------------------------------------------------------------------------------- connection

setInterval(() => {
  const age = performance.now() - arrivedAt;
  const stale = age > STALE_MS;
  set(document.body.dataset, { connection: stale ? "stale" : state ? "live" : "waiting" });
  setText(element("connection").lastElementChild, stale ? "no connection" : state ? "live" : "connecting");
  set(element("stale"), { hidden: !stale });
  if (stale) text("stale", `NO CONNECTION for ${(age / 1000).toFixed(0)} s: everything below is old. STOP is still tried; the robot stops by itself when its own link is gone.`);
}, 200);

// Who comes back may find another world.
connect("/events", { onMessage: showState, onClose: () => { mapSize = ""; seen.map = null; } });

// ---------------------------------------------------------------------------------------------------------------- 3D view

const link = connect(viewerAddress, {
  onOpen: () => { tellDraft(); understand.remark(); },
  onMessage: (message) => {
    if (message.type === "click") clicked(message.x_m, message.y_m, message.on_map);
    else if (message.type === "drag") dragged(message.index, message.on_map);
    else if (message.type === "viewer") tellViewer(message.connected);
  },
});

function tellDraft() { link.send({ type: "draft", mode: draft.mode, corners: draft.corners, outline: drawing() ? ring() : [], path: draft.preview.slice(0, 4000) }); }
onDraft(() => { tellDraft(); hurryViewer(); });

function show(view) {
  document.body.dataset.view = view;
  for (const tab of document.querySelectorAll("[data-view][role=tab]")) tab.setAttribute("aria-selected", String(tab.dataset.view === view));
  element("panel-3d").hidden = view !== "3d";
  element("panel-map").hidden = view !== "map";
  showViewer(view === "3d");
  history.replaceState(null, "", `#${view}`);
  if (view === "map" && state) { follow(); loadPath(); map.update({}); }
}

function tellShow() {
  const hidden = [...document.querySelectorAll("[data-layer]")].filter((box) => !box.checked).map((box) => box.dataset.layer);
  const faded = [...document.querySelectorAll("[data-strength]")].filter((range) => Number(range.value) < 100);
  const strength = Object.fromEntries(faded.map((range) => [range.dataset.strength, Number(range.value) / 100]));
  link.send({ type: "show", cloud_colour: element("cloud-colour").value, hidden, strength });
}

// --------------------------------------------------------------------------------------------------------- what is pressed

element("stop").onclick = () => pressStop("console button");
element("reset").onclick = () => attempt(() => post("/stop/reset"));
for (const button of document.querySelectorAll("[data-mission]")) button.onclick = () => attempt(() => post(`/mission/${button.dataset.mission}`));
for (const button of document.querySelectorAll("[data-mode]")) button.onclick = () => setMode(button.dataset.mode);
for (const button of document.querySelectorAll("[data-look]")) button.onclick = () => { link.send({ type: "look", at: button.dataset.look }); hurryViewer(); };
for (const tab of document.querySelectorAll("[data-view][role=tab]")) tab.onclick = () => show(tab.dataset.view);
const zooms = { fit: map.fit, in: () => zoom(1.3), out: () => zoom(1 / 1.3), follow: () => followRobot(!mapView.follows) };
for (const button of document.querySelectorAll("[data-zoom]")) button.onclick = () => zooms[button.dataset.zoom]();
onView(() => document.querySelector("[data-zoom=follow]").setAttribute("aria-pressed", String(mapView.follows)));
for (const box of document.querySelectorAll("[data-layer], [data-strength], #cloud-colour")) box.onchange = tellShow;
element("overlay").onchange = () => loadCamera();
window.addEventListener("unhandledrejection", (event) => say(`The page failed: ${event.reason?.message ?? event.reason}`));
understand.start({
  look: (place) => { centreOn(place); link.send({ type: "look", at: "place", place }); },
  mark: (lines, place) => link.send({ type: "mark", lines, place }),
});
nameZonesBy(() => zones.length + 1);
switchViewBy(() => show(document.body.dataset.view === "map" ? "3d" : "map"));
onLayers(() => { if (document.body.dataset.view === "map") loadCandidates(); });
setMode("navigate");
// Where the processor would have to draw the 3D view, it waits until it is asked for.
const view = { "#map": "map", "#3d": "3d" }[location.hash];
show(view ?? (webgl === "hardware" && !isNarrow() ? "3d" : "map"));
