// Every key of the page, and the list of them under `?`. Space means stop and nothing else, wherever the focus is.

import { stop } from "./core/api.js";
import { handKey, togglePad } from "./mission/teleop.js";
import { element, make } from "./core/dom.js";
import { canRedo, canUndo, draft, drawing, finish, redo, remove, sent, setMode, setTool, shift, snapshot, undo } from "./zones/draft.js";
import { fit, redraw } from "./map/map.js";
import { closeOverlay } from "./core/menus.js";
import { letGo } from "./map/pointer.js";
import { switchTheme } from "./core/theme.js";
import { attempt } from "./core/toasts.js";
import { togglePanel } from "./access/users.js";
import { follow, view, zoom } from "./map/view.js";
import { travel } from "./zones/zones.js";

const NUDGE_M = 0.05;
const LISTED = [
  ["Space", "stop, anywhere but in a text field"], ["G", "pick goals; drag for a heading"], ["Z", "draw a zone: polygon"], ["O", "draw a circle"],
  ["L", "draw a corridor along a line"], ["H", "draw by hand"], ["N", "look around"], ["Enter", "store the zone, press the focused control"],
  ["Esc", "leave a mode, drop a draft"], ["Backspace", "take the last corner back"], ["Delete", "take the selected corner away"],
  ["← ↑ → ↓", "move the whole draft by 5 cm (Shift: 25 cm)"], ["Ctrl Z", "take back: in the draft, else the last edit of the zones"],
  ["Ctrl Shift Z", "do again"], ["M", "map or 3D view"], ["B", "drive by hand: the pad, and the arrow keys while it is open"], ["F", "follow the robot"], ["W", "the whole map"], ["+ −", "zoom the map"],
  ["D", "dark or light"], ["U", "for admins: users, and who did what"], ["?", "this list"],
];
export const pressStop = (by) => attempt(() => stop(by));
const isText = (node) => node?.matches?.("input:not([type=checkbox]):not([type=range]):not([type=color]), select, textarea") ?? false;
// Where a blank means something. In a number, a date or a list it does not, and there too the operator wants the robot to stop.
const takesBlanks = (node) => node?.matches?.("input:is(:not([type]), [type=text], [type=search], [type=password], [type=url], [type=email]), textarea") ?? false;
let showView = () => {};
export const switchViewBy = (act) => { showView = act; };

function back() { if (drawing() && canUndo()) undo(); else if (!drawing()) travel("undo"); }
function again() { if (drawing() && canRedo()) redo(); else if (!drawing()) travel("redo"); }
function nudge(dx, dy, event) { const step = NUDGE_M * (event.shiftKey ? 5 : 1); snapshot(); shift(dx * step, dy * step); }

export function onKey(event) {
  if (event.code === "Space" && !takesBlanks(event.target)) { event.preventDefault(); event.stopPropagation(); if (!event.repeat) pressStop("console key"); return; }
  if (event.key === "Escape" && closeOverlay()) { event.preventDefault(); return; }
  if (isText(event.target)) {
    if (event.key === "Escape") event.target.blur();
    return;
  }
  const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
  if ((event.ctrlKey || event.metaKey) && (key === "z" || key === "y")) {
    event.preventDefault();
    if (key === "y" || event.shiftKey) again(); else back();
    return;
  }
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  if (handKey(event, true)) { event.preventDefault(); return; }
  if (event.key === "Enter" && event.target?.matches?.("input[type=checkbox]")) { event.preventDefault(); event.target.click(); return; }
  const act = () => ((drawing() ? WHILE_DRAWING[key] : ELSEWHERE[key]) ?? ALWAYS[key])?.(event);
  if (sent()) sent().then(act); else act();
}

const inControl = (event) => event.target?.matches?.("button, summary, a, input");
const ALWAYS = {
  Escape: () => { letGo(); setMode("navigate"); },
  m: () => showView(), f: () => { follow(!view.follows); redraw(); }, w: () => fit(), "+": () => zoom(1.3), "-": () => zoom(1 / 1.3), d: () => switchTheme(), b: () => togglePad(), u: () => togglePanel(), "?": () => element("help").togglePopover(),
};
const WHILE_DRAWING = {
  Backspace: () => draft.mode === "draw" && undo(), Delete: () => remove(),
  Enter: (event) => !event.target?.matches?.("button, summary, a") && finish(),
  ArrowLeft: (event) => !inControl(event) && nudge(-1, 0, event), ArrowRight: (event) => !inControl(event) && nudge(1, 0, event),
  ArrowUp: (event) => !inControl(event) && nudge(0, 1, event), ArrowDown: (event) => !inControl(event) && nudge(0, -1, event),
};
const ELSEWHERE = {
  n: () => setMode("navigate"), g: () => setMode("goal"), z: () => setTool("polygon"), o: () => setTool("circle"), l: () => setTool("corridor"), h: () => setTool("free"),
};

// A focused button is pressed by the space key going up; here that key means stop and nothing else.
export function swallowSpace(event) { handKey(event, false); if (event.code === "Space" && !takesBlanks(event.target)) { event.preventDefault(); event.stopPropagation(); } }

element("help-keys").append(...LISTED.flatMap(([key, words]) => [make("dt", {}, ...key.split(" ").map((part) => make("kbd", {}, part))), make("dd", {}, words)]));
window.addEventListener("keydown", onKey, true);
window.addEventListener("keyup", swallowSpace, true);
