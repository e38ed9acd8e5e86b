// The keys of the page, and the list of them. Space means stop and nothing else, whatever the focus.

import { togglePanel } from "./access/admin_panel.js";
import { close as closeEntry } from "./beware/entry.js";
import { cancel as cancelProposal } from "./beware/proposal.js";
import { element, make } from "./core/dom.js";
import { t } from "./core/text/language.js";
import { closeOverlay } from "./core/menus.js";
import { stop } from "./core/stop.js";
import { switchTheme } from "./core/theme.js";
import { stepEdits } from "./core/undo.js";
import { swap } from "./insight/swap.js";
import { fit } from "./map/map.js";
import { cancelPress } from "./map/pointer/pointer.js";
import { select } from "./map/pointer/selection.js";
import { zoom } from "./map/view.js";
import { dropOffer } from "./mission/goals.js";
import { driveByKey, togglePad } from "./mission/teleop.js";
import {
  canRedo,
  canUndo,
  draft,
  isDrawing,
  moveAll,
  redo,
  removeCorner,
  setMode,
  setTool,
  snapshot,
  undo,
} from "./zones/draft.js";
import { finish, pendingStore } from "./zones/store_draft.js";

const MOVE_M = 0.05;
const SHIFT_FACTOR = 5;
const ZOOM_FACTOR = 1.3;
const LISTED = [
  [t("Space"), t("stop, anywhere but in a text field")],
  ["G", t("pick goals; drag for a heading")],
  ["Z", t("draw a zone: polygon")],
  ["O", t("draw a circle")],
  ["L", t("draw a corridor along a line")],
  ["H", t("draw freehand")],
  ["N", t("look around")],
  ["Enter", t("finish the zone, press the focused control")],
  ["Esc", t("leave a mode, cancel a draft")],
  ["Backspace", t("undo the last corner")],
  ["Delete", t("remove the selected corner")],
  ["← ↑ → ↓", t("move the whole draft by 5 cm (Shift: 25 cm)")],
  ["Ctrl Z", t("undo: in the draft, else the last edit of zones, beware list or map")],
  ["Ctrl Shift Z", t("redo")],
  ["M", t("map or 3D view")],
  ["C", t("camera image and map change places")],
  ["B", t("drive by hand: the pad, and the arrow keys while it is open")],
  ["F", t("follow the robot")],
  ["W", t("fit what is known; again for the whole map")],
  ["+ −", t("zoom the map")],
  ["Shift F10", t("menu of what is selected on the map, as by right click")],
  ["D", t("dark or light")],
  ["U", t("for admins: users and audit log")],
  ["?", t("this list")],
];
const TEXT_FIELDS =
  "input:not([type=checkbox]):not([type=range]):not([type=color]), select, textarea";
// Fields in which a blank means something. In a number, a date or a list it does not: there the key
// stops.
const BLANK_FIELDS =
  "input:is(:not([type]), [type=text], [type=search], [type=password], [type=url], [type=email]), textarea";
const matches = (node, selector) => node?.matches?.(selector) ?? false;
const isStop = (event) => event.code === "Space" && !matches(event.target, BLANK_FIELDS);
// A letter is a shortcut while the map, the page or the 3D view has the focus: typed on a button it
// was meant for a field.
const takesLetters = (node) => !matches(node, "button, summary, a, input") || matches(node, "[data-drive]");
const isControl = (event) => matches(event.target, "button, summary, a, input");
// What the arrow keys move or scroll itself: there they neither drive nor move a draft.
const takesArrows = (node) =>
  Boolean(node?.closest?.("input[type=range], [role=separator], .handle, [popover], dialog"));
let switchView = () => {};

// Set the function that switches between map and 3D view.
export const switchViewBy = (act) => {
  switchView = act;
};

function undoAny() {
  if (!isDrawing()) stepEdits("undo");
  else if (canUndo()) undo();
}

function redoAny() {
  if (!isDrawing()) stepEdits("redo");
  else if (canRedo()) redo();
}

function moveBy(dx, dy, event) {
  if (isControl(event) || takesArrows(event.target)) return;
  const step = MOVE_M * (event.shiftKey ? SHIFT_FACTOR : 1);
  snapshot();
  moveAll(dx * step, dy * step);
}

const ALWAYS = {
  Escape: () => {
    cancelPress();
    dropOffer();
    if (draft.mode === "navigate") select(null);
    closeEntry();
    cancelProposal();
    setMode("navigate");
  },
  m: () => switchView(),
  c: () => swap(),
  f: () =>
    document
      .querySelector(document.body.dataset.view === "3d" ? "[data-look=follow]" : "[data-zoom=follow]")
      .click(),
  w: () => fit(),
  "+": () => zoom(ZOOM_FACTOR),
  "-": () => zoom(1 / ZOOM_FACTOR),
  d: () => switchTheme(),
  b: () => togglePad(),
  u: () => togglePanel(),
  "?": () => element("help").togglePopover(),
};
const WHILE_DRAWING = {
  Backspace: () => draft.mode === "draw" && undo(),
  Delete: () => removeCorner(),
  Enter: (event) => !matches(event.target, "button, summary, a") && finish(),
  ArrowLeft: (event) => moveBy(-1, 0, event),
  ArrowRight: (event) => moveBy(1, 0, event),
  ArrowUp: (event) => moveBy(0, 1, event),
  ArrowDown: (event) => moveBy(0, -1, event),
};
const ELSEWHERE = {
  n: () => setMode("navigate"),
  g: () => setMode("goal"),
  z: () => setTool("polygon"),
  o: () => setTool("circle"),
  l: () => setTool("corridor"),
  h: () => setTool("free"),
};

export function onKeyDown(event) {
  if (isStop(event)) {
    event.preventDefault();
    event.stopPropagation();
    if (!event.repeat) stop("console key");
    return;
  }
  if (event.key === "Escape" && closeOverlay()) {
    event.preventDefault();
    return;
  }
  if (matches(event.target, TEXT_FIELDS)) {
    if (event.key === "Escape") event.target.blur();
    return;
  }
  const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
  if ((event.ctrlKey || event.metaKey) && (key === "z" || key === "y")) {
    event.preventDefault();
    if (key === "y" || event.shiftKey) redoAny();
    else undoAny();
    return;
  }
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  if (!takesArrows(event.target) && driveByKey(event, true)) {
    event.preventDefault();
    return;
  }
  if (event.key === "Enter" && matches(event.target, "input[type=checkbox]")) {
    event.preventDefault();
    event.target.click();
    return;
  }
  if (event.key.length === 1 && event.key !== "?" && !takesLetters(event.target)) return;
  const act = () => ((isDrawing() ? WHILE_DRAWING[key] : ELSEWHERE[key]) ?? ALWAYS[key])?.(event);
  if (pendingStore()) pendingStore().then(act);
  else act();
}

// The browser presses a focused button when the space key goes up; here that key only stops.
export function onKeyUp(event) {
  driveByKey(event, false);
  if (!isStop(event)) return;
  event.preventDefault();
  event.stopPropagation();
}

element("help-keys").append(
  ...LISTED.flatMap(([keys, words]) => [
    make("dt", {}, ...keys.split(" ").map((key) => make("kbd", {}, key))),
    make("dd", {}, words),
  ]),
);
element("stop").onclick = () => stop("console button");
window.addEventListener("keydown", onKeyDown, true);
window.addEventListener("keyup", onKeyUp, true);
