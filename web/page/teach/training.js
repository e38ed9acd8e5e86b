// The training: start, cancel, resume; its progress, curves and validation images.

import { get, post } from "../core/link/api.js";
import { element, make, reconcile, set, setText } from "../core/dom.js";
import { number, sentence, t } from "../core/text/language.js";
import { attempt, notify } from "../core/toasts.js";
import { NOTHING } from "./classes.js";
import { flush } from "./drawing.js";
import { missedText } from "./networks.js";

const PHASES = {
  waiting: t("starting"),
  rendering: t("rendering known objects"),
  encoding: t("reading the images"),
  training: t("training"),
  comparing: t("comparing"),
  done: t("done"),
  cancelled: t("cancelled"),
  failed: t("failed"),
};
const ENDED = ["done", "cancelled", "failed"];
let last = null;

// Whether a class is marked in any image: without one there is nothing to learn.
let isMarked = false;

export function followFrames(frames) {
  isMarked = frames.some((frame) => frame.class_names.some((name) => name !== NOTHING));
}

export async function refreshTraining() {
  const { run } = await get("/teach/training");
  const running = run?.running ?? false;
  set(element("train"), {
    disabled: running || !isMarked,
    title: isMarked ? "" : t("Mark an object in the images first"),
  });
  element("cancel").hidden = !running;
  element("resume").hidden = !run || running || run.phase === "done";
  element("progress").hidden = !run;
  if (!run) return;
  const count = run.of && !ENDED.includes(run.phase) ? ` ${run.done}/${run.of}` : "";
  setText(element("training-phase"), `${run.name}: ${PHASES[run.phase]}${count}`);
  set(element("progress"), { value: run.phase === "done" ? 1 : run.of ? run.done / run.of : 0 });
  const said = run.not_found.length ? missedText(run.not_found) : run.message && sentence(run.message);
  setText(element("training-message"), said);
  if (last !== JSON.stringify([run.name, run.losses, run.looks])) {
    last = JSON.stringify([run.name, run.losses, run.looks]);
    showCurves(run);
    showLooks(run);
  }
}

function showCurves({ losses, mious }) {
  const curves = [];
  for (const [name, points, digits] of [
    [t("Loss"), losses, 3],
    [t("Mean IoU of images held back"), mious, 2],
  ])
    if (points.length)
      curves.push(make("p", {}, `${name} ${number(points.at(-1).value, digits)}`), curve(points, name));
  element("curves").replaceChildren(...curves);
}

function curve(points, name) {
  const [width, height] = [100, 40];
  const largest = Math.max(...points.map((point) => point.value), 1e-6);
  const steps = points.at(-1).step;
  const corners = points.map(
    (point) => `${((point.step / steps) * width).toFixed(1)},${(height * (1 - point.value / largest)).toFixed(1)}`,
  );
  const space = "http://www.w3.org/2000/svg";
  const svg = document.createElementNS(space, "svg");
  svg.setAttribute("viewBox", `0 -2 ${width} ${height + 4}`);
  svg.setAttribute("preserveAspectRatio", "none");
  svg.setAttribute("role", "img");
  svg.setAttribute("aria-label", name);
  const line = document.createElementNS(space, "polyline");
  line.setAttribute("points", corners.join(" "));
  svg.append(line);
  return svg;
}

function showLooks({ looks, losses }) {
  const version = losses.at(-1)?.step ?? 0;
  reconcile(
    element("looks"),
    [...Array(looks).keys()],
    (index) => index,
    (index) => make("img", { alt: t("Image {n} that was held back, with what is found in it", { n: index + 1 }) }),
    (image, index) => set(image, { src: `/api/v1/teach/training/looks/${index}.png?step=${version}` }),
  );
}

async function act(path, body) {
  await post(path, body);
  await refreshTraining();
}

element("train").onclick = () =>
  attempt(async () => {
    await flush();
    await act("/teach/training", {
      start: element("start").value || null,
      rehearsal: Number(element("rehearsal").value),
    });
    notify(t("Training begins"), { good: true });
  });
element("cancel").onclick = () => attempt(() => act("/teach/training/cancel"));
element("resume").onclick = () => attempt(() => act("/teach/training/resume"));
