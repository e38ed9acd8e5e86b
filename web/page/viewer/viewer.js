// The 3D view: viser's page in a frame. The frame is made when the view is first shown, draws nothing
// while hidden, and is removed after a while, so that the console has nothing to send either.

import { element, make, setText } from "../core/dom.js";
import { t } from "../core/text/language.js";
import { showProgress } from "../core/link/progress.js";
import { onTheme } from "../core/theme.js";
import { onKeyDown, onKeyUp } from "../keys.js";

const KEPT_MS = 20_000;
const SOFTWARE_DPR = 0.7; // a processor draws fewer pixels
const panel = element("panel-3d");
const pageId = [...crypto.getRandomValues(new Uint8Array(16))]
  .map((byte) => byte.toString(16).padStart(2, "0"))
  .join("");
export const address = `/viewer/${pageId}`;
// What draws WebGL here: "hardware", "software" or "none".
export const webgl = findRenderer();
let frame = null;
let ownStyle = null; // the console's style sheet in viser's page, which adds others of its own
let isShown = false;
let strengths = {};
let timer = 0;
let onDrawn = () => {};
const frameListeners = [];
// Called with the window of each new frame.
export const onFrame = (listener) => frameListeners.push(listener);

function findRenderer() {
  const context = document.createElement("canvas").getContext("webgl2");
  if (!context) return "none";
  const info = context.getExtension("WEBGL_debug_renderer_info");
  const name = context.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : context.RENDERER);
  context.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name)
    ? "software"
    : "hardware";
}

export function showViewer(shown) {
  isShown = shown;
  update();
}

// Draw now, however seldom the view is drawn otherwise.
export function drawViewerNow() {
  if (isShown) frame?.contentWindow?.dispatchEvent(new Event("seen"));
}

// Set the opacity of layers, 0 to 1 by name: `opacity.js` in viser's page draws with it.
export function fadeViewer(strength) {
  strengths = strength;
  frame?.contentWindow?.dispatchEvent(new CustomEvent("fade", { detail: strengths }));
}

// Whether viser's page is connected, as the console says.
export function setConnected(connected) {
  document.body.dataset.viewer = connected ? "live" : "gone";
}

function setDrawn() {
  document.body.dataset.drawn = "yes";
  onDrawn();
}

function update() {
  const isVisible = isShown && !document.hidden;
  clearTimeout(timer);
  if (isVisible && !frame) {
    if (webgl === "none") say(t("This browser draws no 3D view: it has no WebGL. Use the map; every control works."));
    else open();
  }
  if (!frame) return;
  frame.dataset.seen = isVisible ? "yes" : "no";
  if (isVisible) frame.contentWindow?.dispatchEvent(new Event("seen"));
  else timer = setTimeout(close, KEPT_MS);
}

// In the place of the scene.
const say = (text) => setText(element("gone"), text);

function open() {
  say(t("The 3D view is being made … Until then use the map; every control works."));
  const query = webgl === "hardware" ? "" : `?fixedDpr=${SOFTWARE_DPR}`;
  frame = make("iframe", {
    id: "viewer",
    title: t("3D view"),
    src: `${address}/${query}`,
    "data-webgl": webgl,
    "data-testid": "view-3d-frame",
  });
  frame.addEventListener("load", prepare);
  frame.addEventListener("drawn", setDrawn);
  panel.append(frame);
  showProgress(
    new Promise((resolve) => {
      onDrawn = resolve;
    }),
    t("the 3D view"),
  );
}

function close() {
  frame?.remove();
  frame = ownStyle = null;
  delete document.body.dataset.drawn;
  onDrawn();
}

function prepare() {
  const { contentWindow, contentDocument } = frame;
  if (!contentDocument?.getElementById("root")) {
    close();
    say(t("The 3D view cannot be loaded. Use the map; every control works."));
    return;
  }
  // Keys pressed while the 3D view has the focus are the console's keys too.
  contentWindow?.addEventListener("keydown", onKeyDown, true);
  contentWindow?.addEventListener("keyup", onKeyUp, true);
  for (const listener of frameListeners) listener(contentWindow);
  // viser's own panel and notices would cover the scene; the console has all that an operator needs.
  ownStyle = contentDocument.head.appendChild(contentDocument.createElement("style"));
  showTheme();
  fadeViewer(strengths);
}

// The colour behind the scene is the one behind the map.
function showTheme() {
  if (!ownStyle) return;
  const stage = getComputedStyle(document.documentElement).getPropertyValue("--stage");
  ownStyle.textContent =
    ".mantine-Paper-root, .mantine-Notifications-root { display: none !important; }" +
    `html, body, body div:has(> canvas) { background: ${stage} !important; }`;
  drawViewerNow();
}
onTheme(showTheme);

document.addEventListener("visibilitychange", update);
