// The page on which the network is taught a class: images, marks, training, use.

import { get, post, request } from "../core/link/api.js";
import { element, make, reconcile, set, setText } from "../core/dom.js";
import { sentence, t, tn } from "../core/text/language.js";
import { takeOver } from "../core/stop.js";
import { isText, tellStopped } from "../core/stop_beside.js";
import "../core/theme.js";
import { attempt, notify } from "../core/toasts.js";
import { askTwice } from "../core/twice.js";
import { chooseClass, loadClasses } from "./classes.js";
import { chooseTool, follow, forget, redo, show, shownFrame, undo, whenSaved } from "./drawing.js";
import { loadRole, refreshExport } from "./export.js";
import { refreshNetworks, upload } from "./networks.js";
import { followFrames, refreshTraining } from "./training.js";

takeOver(tellStopped);
const POLL_MS = 1500;
const NUMBER = "input[type=number]";
let frames = [];

async function refreshFrames() {
  const answer = await get("/teach/frames");
  frames = answer.frames;
  const { folder } = answer;
  setText(element("frame-count"), t("{marked} of {all} marked", { marked: folder.annotated, all: folder.frames }));
  set(element("capturing"), { checked: folder.capturing });
  setText(element("note"), folder.trouble ? sentence(folder.trouble) : "");
  element("no-frames").hidden = frames.length > 0;
  refreshExport(frames);
  followFrames(frames);
  reconcile(element("frames"), frames, (frame) => frame.id, createFrame, refreshFrame);
  const shown = shownFrame();
  const listed = frames.find(({ id }) => id === shown?.id);
  if (listed) await follow(listed);
  else if (shown) {
    forget();
    await show(null);
  }
  if (!shownFrame() && frames.length) await choose(frames[0]);
}

function createFrame(frame) {
  const image = make("img", { src: `/api/v1/teach/frames/${frame.id}.png`, alt: "", loading: "lazy" });
  const button = make("button", { "data-testid": `frame-${frame.id}` }, image, make("span", {}));
  const row = make("li", {}, button);
  button.onclick = () => attempt(() => choose(row.item));
  return row;
}

function refreshFrame(row, frame) {
  const button = row.firstChild;
  const said = frame.class_names.join(", ") || t("not marked");
  setText(button.lastChild, `${Number(frame.id)} ${said}`);
  button.setAttribute("aria-current", String(frame.id === shownFrame()?.id));
}

async function choose(frame) {
  await show(frame);
  for (const row of element("frames").children) {
    refreshFrame(row, row.item);
    if (row.item.id === frame.id) row.scrollIntoView({ block: "nearest" });
  }
}

function step(by) {
  const at = frames.findIndex(({ id }) => id === shownFrame()?.id);
  const next = frames[at + by];
  if (next) attempt(() => choose(next));
}

element("capture").onclick = () =>
  attempt(async () => {
    const { frame } = await post("/teach/frames");
    await refreshFrames();
    if (frame) await choose(frame);
    else notify(t("An image like this one is there already; move the robot or the object first."));
  });
element("capturing").onchange = ({ target }) =>
  attempt(async () => {
    await request("PUT", "/teach/capturing", { on: target.checked });
    await refreshFrames();
  });
element("frames-file").onchange = ({ target }) => {
  const file = target.files[0];
  target.value = "";
  if (!file) return;
  attempt(async () => {
    const { added } = await upload("/teach/frames.zip", file);
    notify(tn("{n} image added", "{n} images added", added), { good: true });
    await refreshFrames();
  });
};
askTwice(element("delete"), t("Really delete?"), () =>
  attempt(async () => {
    const at = frames.findIndex(({ id }) => id === shownFrame().id);
    await request("DELETE", `/teach/frames/${shownFrame().id}`);
    await refreshFrames();
    if (frames.length) await choose(frames[Math.min(at, frames.length - 1)]);
  }),
);
element("previous").onclick = () => step(-1);
element("next").onclick = () => step(1);
whenSaved(() => attempt(refreshFrames));

const KEYS = {
  r: () => chooseTool("region"),
  b: () => chooseTool("brush"),
  e: () => chooseTool("eraser"),
  n: () => step(1),
  p: () => step(-1),
};
document.addEventListener(
  "keydown",
  (event) => {
    if (isText(event.target) || event.code === "Space") return;
    if (event.target.matches?.(NUMBER)) return; // its digits, its e, its undo
    if ((event.ctrlKey || event.metaKey) && event.key.toLowerCase() === "z") {
      event.preventDefault();
      (event.shiftKey ? redo : undo)();
    } else if (!event.ctrlKey && !event.altKey && !event.metaKey) {
      const act = /^[1-9]$/.test(event.key) ? () => chooseClass(Number(event.key) - 1) : KEYS[event.key.toLowerCase()];
      if (!act) return;
      event.preventDefault(); // a list with the focus would choose what begins with the letter
      act();
    }
  },
  true,
);

async function poll() {
  if (!document.hidden) {
    for (const refresh of [refreshFrames, refreshTraining, refreshNetworks]) await refresh();
  }
}

async function forever() {
  try {
    await poll();
  } catch (error) {
    setText(element("note"), error.message);
  }
  setTimeout(forever, POLL_MS);
}

await show(null);
await attempt(() => loadClasses());
await attempt(loadRole);
forever();
