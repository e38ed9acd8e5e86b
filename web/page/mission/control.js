// Who is in control of the robot, and the page's sign of life: the console asks twice a second, and
// a page that is closed, frozen or cut off does not answer.

import { showVisitor } from "../access/admin_panel.js";
import { connect, get, post } from "../core/link/api.js";
import { onStale } from "../core/link/connection.js";
import { element, set, setText } from "../core/dom.js";
import { sentence, t } from "../core/text/language.js";
import { addStopChannel, delivered } from "../core/stop.js";
import { attempt, notify, showRefusal } from "../core/toasts.js";

// Controls that a viewer may not use. The lists themselves can be scrolled by viewers, too.
const EDITORS =
  ".left .row, .left details, .left .list > li, [aria-label='Mode'], #beware > li, #beware-tools";
const REST_S = 3; // the console asks twice a second, also a hidden page
const ACTIONS = ["take", "ask", "give"];
let previous = null;
let told = null; // the newest message about control, which takes the place of the one before
let releaseKeys = () => {};

// Called when this page can no longer drive.
export const onControlLost = (act) => {
  releaseKeys = act;
};

const link = connect("/control/live", {
  onMessage: (message) => {
    if (message.type === "refused") {
      releaseKeys();
      showRefusal({ message: sentence(message.message), code: message.code });
      return;
    }
    if (message.type === "stopped") {
      delivered();
      return;
    }
    link.send({ type: "here" });
    show(message);
  },
  onClose: checkSession,
  restS: REST_S,
});

addStopChannel((source) => link.send({ type: "stop", by: source }));

// While the device sleeps the steady clock of many browsers stands still: to the console all that is
// sent afterwards would be late by it. On another connection delays count from the first velocity
// again; the drive ends with this one. The wall clock tells of a sleep, and may also have been set.
const SLEPT_MS = 250;
const CHECKED_MS = 1000;
const wallLeadMs = () => Date.now() - performance.now();
let leadMs = wallLeadMs();

function hasSlept() {
  const beforeMs = leadMs;
  leadMs = wallLeadMs();
  const isJump = Math.abs(leadMs - beforeMs) > SLEPT_MS;
  if (isJump) link.reconnect();
  return isJump;
}
setInterval(hasSlept, CHECKED_MS);

export function sendVelocity(vMps, wRadps) {
  if (hasSlept()) return;
  link.send({ type: "drive", v_mps: vMps, w_radps: wRadps, t_ms: performance.now() });
}

// Show the login page when the session has ended: this page could do nothing more.
async function checkSession() {
  releaseKeys();
  try {
    await get("/me");
  } catch (error) {
    if (error.status === 401) location.reload();
  }
}

onStale(() => {
  set(element("control").dataset, { who: "free" });
  setText(element("control-text"), t("? Control unknown"));
  for (const action of ACTIONS) set(element(`control-${action}`), { hidden: true });
});

function show(now) {
  const { you, holder, asking } = now;
  const isViewer = you.role === "viewer";
  set(document.body.dataset, { role: you.role });
  for (const part of document.querySelectorAll(EDITORS)) set(part, { inert: isViewer });
  const who = now.yours ? "you" : holder ? "other" : "free";
  set(element("control").dataset, { who });
  const words = {
    you: t("● You have control"),
    other: t("▲ {name} has control", { name: holder?.name }),
    free: t("○ Control is free"),
  }[who];
  const request =
    now.yours && asking ? ` · ${t("{name} asks", asking)}` : now.asked_by_you ? ` · ${t("asked")}` : "";
  setText(element("control-text"), isViewer ? `${words} · ${t("you watch")}` : words + request);
  set(element("control-text"), {
    title: now.yours && asking ? t("{name} asks for control", asking) : words,
  });
  set(element("control-take"), { hidden: isViewer || now.yours });
  set(element("control-ask"), {
    hidden: Boolean(isViewer || now.yours || !holder || now.asked_by_you),
  });
  set(element("control-give"), { hidden: !now.yours });
  element("control-give").classList.toggle("due", Boolean(now.yours && asking));
  set(element("logout"), { hidden: !you.logged_in });
  setText(element("account-button"), you.name);
  showVisitor(you);
  if (previous !== null && previous.serial !== now.serial) announce(now);
  previous = now;
}

function announce(now) {
  if (previous.yours && !now.yours) {
    releaseKeys();
    const change = now.taken
      ? t("{name} has taken over control. Take over to drive again.", now.holder)
      : t("{name} is in control now. Take over to drive again.", now.holder ?? {});
    tell(now.holder ? change : t("You are no longer in control. Take over to drive again."));
  } else if (now.yours && !previous.yours) {
    tell(t("You are in control."), { good: true });
  } else if (now.yours && now.asking && !previous.asking) {
    tell(t("{name} asks for control: press “Hand over”, or just drive on.", now.asking));
  }
}

function tell(text, options) {
  told?.remove();
  told = notify(text, options);
}

for (const action of ACTIONS) {
  element(`control-${action}`).onclick = () => attempt(() => post(`/control/${action}`));
}
