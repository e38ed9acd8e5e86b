// Marking of one image: region, brush, eraser, undo; every edit is saved by itself.

import { get, post, request } from "../core/link/api.js";
import { element, setText } from "../core/dom.js";
import { t } from "../core/text/language.js";
import { attempt, notify } from "../core/toasts.js";
import { classNames, colourOf, labelOf, selectedName } from "./classes.js";
import { makeLabels, runsOf, valuesOf } from "./labels.js";

const SAVE_MS = 300;
const RETRY_MS = 2000;
const GONE = 404;
const FORBIDDEN = 403;
const marks = element("marks");
let frame = null;
let labels = null;
let version = 0; // of the stored marks that `labels` began with
const unanswered = new Set(); // runs that may be stored: their requests had no answer
let tool = "region";
let stroke = null;
let timer = null;
let edits = 0;
let saved = 0; // so many of the edits are stored
let saving = null; // the request that stores more of them
let onSaved = () => {};

export const whenSaved = (act) => {
  onSaved = act;
};

// Give up what is not saved, of an image that was deleted.
export function forget() {
  clearTimeout(timer);
  stroke = null;
  saved = edits;
}

export const shownFrame = () => frame;

// Show an image and its marks, once those of the one before are saved, also those made meanwhile.
export async function show(next) {
  do {
    endStroke();
    await flush();
  } while (stroke);
  frame = next;
  labels = null;
  const canvas = element("canvas");
  canvas.hidden = !next;
  canvas.ariaBusy = "true"; // until its marks are there nothing can be marked
  for (const id of ["previous", "next", "delete"]) element(id).disabled = !next;
  if (!next) return refresh();
  element("picture").src = `/api/v1/teach/frames/${next.id}.png`;
  const stored = await get(addressOf(next));
  if (frame !== next) return undefined; // another one was chosen meanwhile
  take(stored);
  canvas.ariaBusy = "false";
  return undefined;
}

// Show what was marked elsewhere in the image that is shown, unless it is being marked here.
export async function follow(listed) {
  const [of, before] = [labels, version];
  const isAtRest = () => of && of === labels && before === version && !isUnsaved() && !stroke;
  if (!isAtRest() || listed.version === version) return;
  const stored = await get(addressOf(frame));
  if (isAtRest() && stored.version !== version) take(stored);
}

const valuesIn = ({ class_names: names, runs, width, height }) =>
  valuesOf(runs, width * height, [0, ...names.map(labelOf)]);

function take(stored) {
  labels = makeLabels(stored.width, stored.height, valuesIn(stored));
  version = stored.version;
  unanswered.clear();
  marks.width = stored.width;
  marks.height = stored.height;
  refresh();
}

function refresh() {
  element("undo").disabled = !labels?.canUndo();
  element("redo").disabled = !labels?.canRedo();
  if (!labels) return;
  const context = marks.getContext("2d");
  const image = context.createImageData(labels.width, labels.height);
  const pixels = new Uint32Array(image.data.buffer);
  const colours = [0, ...classNames().map(colourOf)];
  for (let i = 0; i < pixels.length; i += 1) pixels[i] = colours[labels.values[i]];
  context.putImageData(image, 0, 0);
}

function edited() {
  refresh();
  setText(element("saved"), t("saving …"));
  edits += 1;
  clearTimeout(timer);
  timer = setTimeout(() => attempt(flush), SAVE_MS);
}

const LOGGED_OUT = 401;
const isRefused = (status) => status >= 400 && status < 500 && status !== LOGGED_OUT;
const isUnsaved = () => saved < edits;
const addressOf = ({ id }) => `/teach/frames/${id}/labels`;
const marked = () => ({ class_names: classNames(), runs: runsOf(labels.values) });
const ofVersion = () => ({ "If-Match": `"${version}"` });

// Save what is not saved yet; an error says that it could not be, and it is tried again.
export async function flush() {
  while (isUnsaved()) await (saving ??= save().finally(() => (saving = null)));
}

async function save() {
  clearTimeout(timer);
  const [of, upTo, body] = [frame, edits, marked()];
  try {
    const stored = await request("PUT", addressOf(of), body, ofVersion());
    if (of === frame) [saved, version] = [upTo, stored.version];
    unanswered.clear();
    setText(element("saved"), t("saved"));
    onSaved(stored);
  } catch (error) {
    if (error.status === GONE) return forget();
    if (error.code === "outdated" && of === frame) return meet(error.body.stored);
    if (!isRefused(error.status)) unanswered.add(String(body.runs));
    setText(element("saved"), t("not saved"));
    // A viewer can save nothing; what else is refused is kept until it is changed or saved.
    if (error.status === FORBIDDEN) forget();
    else if (!isRefused(error.status)) timer = setTimeout(() => flush().catch(() => {}), RETRY_MS);
    throw error;
  }
}

// Other marks are stored than those that were edited: by this page, whose request had no answer and
// which saves again, or by another one.
function meet(stored) {
  if (unanswered.has(String(runsOf(valuesIn(stored))))) {
    version = stored.version;
    return;
  }
  forget();
  take(stored);
  setText(element("saved"), "");
  notify(t("This image was marked elsewhere meanwhile. Those marks are shown now; your last edit was not saved."));
}

// A page that is left waits for no answer, nor for the version of what it is saving.
window.addEventListener("pagehide", () => {
  endStroke();
  if (!isUnsaved()) return;
  const isKnown = !saving && !unanswered.size;
  const headers = { "Content-Type": "application/json", ...(isKnown ? ofVersion() : {}) };
  const body = JSON.stringify(marked());
  const nothing = () => {}; // browsers refuse a large body that is to outlive the page
  fetch(`/api/v1${addressOf(frame)}`, { method: "PUT", keepalive: true, headers, body }).catch(nothing);
});

function pixelAt(event) {
  const box = marks.getBoundingClientRect();
  const at = (value, from, size, count) => Math.min(count - 1, Math.max(0, Math.floor(((value - from) / size) * count)));
  return {
    row: at(event.clientY, box.top, box.height, labels.height),
    col: at(event.clientX, box.left, box.width, labels.width),
  };
}

async function markRegion(at) {
  const of = frame;
  const label = labelOf(selectedName()); // of the click: another class may be chosen meanwhile
  const body = { ...at, tolerance: Number(element("tolerance").value) };
  const region = await post(`/teach/frames/${frame.id}/region`, body);
  if (of !== frame || !labels) return; // another image is shown meanwhile
  labels.remember();
  labels.fill(region.runs, label);
  edited();
}

function paintTo(at) {
  const label = tool === "eraser" ? 0 : labelOf(selectedName());
  labels.paint(stroke, at, Number(element("size").value), label);
  stroke = at;
  refresh();
}

marks.onpointerdown = (event) => {
  if (!labels || event.button) return;
  event.preventDefault();
  const at = pixelAt(event);
  if (tool === "region") {
    attempt(() => markRegion(at));
    return;
  }
  marks.setPointerCapture(event.pointerId);
  labels.remember();
  stroke = at;
  paintTo(at);
};
marks.onpointermove = (event) => {
  if (stroke) paintTo(pixelAt(event));
};
function endStroke() {
  if (!stroke) return;
  stroke = null;
  edited();
}
marks.onpointerup = marks.onpointercancel = endStroke;

export function chooseTool(name) {
  tool = name;
  for (const button of element("tools").children)
    button.setAttribute("aria-checked", String(button.dataset.tool === name));
}
for (const button of element("tools").children) button.onclick = () => chooseTool(button.dataset.tool);

export function undo() {
  if (!labels?.canUndo() || stroke) return;
  labels.undo();
  edited();
}

export function redo() {
  if (!labels?.canRedo() || stroke) return;
  labels.redo();
  edited();
}
element("undo").onclick = undo;
element("redo").onclick = redo;
