// Short messages: refusals, and changes that took effect.

import { post } from "./link/api.js";
import { element, make } from "./dom.js";
import { capitalised, sentence, t } from "./text/language.js";

const box = element("toasts");
const MAX_SHOWN = 4;
const GOOD_MS = 2500;
const BAD_MS = 9000;

// `actions` are what the operator can do about it with one click: `{ label, run }`. A message that
// `stays` is removed by the caller, to whom it is returned, or by the operator; a question that stays,
// by `dropQuestions`, too.
export function notify(
  text,
  { good = false, action = null, actions = action ? [action] : [], stays = false } = {},
) {
  for (const old of box.children) if (old.dataset.text === text) old.remove();
  const dismiss = () => {
    toast.dismissedAt = Date.now();
    toast.remove();
  };
  const close = make("button", { "aria-label": t("Dismiss"), onclick: dismiss }, "✕");
  const toast = make(
    "div",
    { class: good ? "toast done" : "toast", "data-text": text },
    make("b", {}, good ? "✓" : "!"),
    make("span", {}, capitalised(text)),
    close,
  );
  if (actions.length)
    close.before(make("div", {}, ...actions.map((one) => actionButton(one, toast))));
  box.append(toast);
  toast.stays = stays;
  const passing = [...box.children].filter((old) => old !== toast && !old.stays);
  for (const old of passing.slice(0, Math.max(box.children.length - MAX_SHOWN, 0))) old.remove();
  if (!stays) setTimeout(() => toast.remove(), good && !actions.length ? GOOD_MS : BAD_MS);
  return toast;
}

// A question to the operator about the map of the present site.
export function ask(text, actions) {
  notify(text, { actions, stays: true }).asks = true;
}

// The robot is at another site: what was asked would be done on the map of that one.
export function dropQuestions() {
  const asked = [...box.children].filter((toast) => toast.asks);
  for (const toast of asked) toast.remove();
  if (asked.length) notify(sentence("the robot is at another site now; nothing was changed"));
}

function actionButton({ label, run }, toast) {
  const onclick = () => {
    toast.remove();
    run();
  };
  return make("button", { "data-testid": "toast-action", onclick }, label);
}

// Show why the console has refused something; where another operator drives, with the way out.
export function showRefusal(error) {
  const take = { label: t("Take over"), run: () => attempt(() => post("/control/take")) };
  notify(error.message, { action: error.code === "not_in_control" ? take : null });
}

// Run an action of the operator with the query of its request: what is asked for again before it is
// done is done with force once the operator says so.
export const attemptTwice = (label, action) =>
  attempt(async () => {
    try {
      await action("");
    } catch (error) {
      if (error.code !== "needs_force") throw error;
      ask(error.message, [{ label, run: () => attempt(() => action("?force=true")) }]);
    }
  });

// Run an action of the operator; a refusal is shown.
export async function attempt(action) {
  try {
    return await action();
  } catch (error) {
    showRefusal(error);
    return undefined;
  }
}
