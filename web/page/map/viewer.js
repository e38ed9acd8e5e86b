// The 3D view: viser's page in a frame, which is made when it is first looked at, draws nothing while nobody looks, and is taken
// away when nobody has looked for a while: then the robot's side has nothing to send either.

import { make } from "../core/dom.js";
import { onKey, swallowSpace } from "../keys.js";
import { during } from "../core/progress.js";

const KEPT_MS = 20_000;
const panel = document.getElementById("panel-3d");
const pageId = [...crypto.getRandomValues(new Uint8Array(16))].map((byte) => byte.toString(16).padStart(2, "0")).join("");
export const address = `/viewer/${pageId}`;
// Whether a graphics card draws WebGL here: "hardware", "software" or "none".
export const webgl = drawnBy();
let frame = null;
let wanted = false;
let timer = 0;
let isLive = () => {};

function drawnBy() {
  const context = document.createElement("canvas").getContext("webgl2");
  if (!context) return "none";
  const info = context.getExtension("WEBGL_debug_renderer_info");
  const name = context.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : context.RENDERER);
  context.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name) ? "software" : "hardware";
}

export function showViewer(on) { wanted = on; follow(); }

// What is drawn or asked for is to be seen at once, however seldom the view is drawn else.
export function hurryViewer() { if (wanted) frame?.contentWindow?.dispatchEvent(new Event("seen")); }

// What the robot's side says: whether viser's page is connected.
export function tellViewer(connected) {
  document.body.dataset.viewer = connected ? "live" : "gone";
  isLive();
}

function follow() {
  const seen = wanted && !document.hidden;
  clearTimeout(timer);
  if (seen && !frame) open();
  if (!frame) return;
  frame.dataset.seen = seen ? "yes" : "no";
  if (seen) frame.contentWindow?.dispatchEvent(new Event("seen"));
  else timer = setTimeout(close, KEPT_MS);
}

function open() {
  // A processor draws fewer pixels.
  frame = make("iframe", { id: "viewer", title: "3D view", src: `${address}/${webgl === "hardware" ? "" : "?fixedDpr=0.7"}`, "data-webgl": webgl, "data-testid": "view-3d-frame" });
  frame.addEventListener("load", dress);
  panel.append(frame);
  during(new Promise((resolve) => { isLive = resolve; }), "the 3D view");
}

function close() {
  frame?.remove();
  frame = null;
  isLive();
}

function dress() {
  const { contentWindow: inside, contentDocument: page } = frame;
  // Keys pressed while the 3D view has the focus are the console's keys too.
  inside?.addEventListener("keydown", onKey, true);
  inside?.addEventListener("keyup", swallowSpace, true);
  // viser's own panel and notices would cover the scene; everything an operator needs is on this page.
  page?.head.append(Object.assign(page.createElement("style"), { textContent: ".mantine-Paper-root, .mantine-Notifications-root { display: none !important; }" }));
}

document.addEventListener("visibilitychange", follow);
