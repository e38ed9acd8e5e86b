// The emergency stop: sent until it is answered, also after a lost connection.

import { abortAll } from "./link/api.js";
import { t } from "./text/language.js";
import { notify } from "./toasts.js";

const ATTEMPTS = 3;
const TIMEOUT_MS = 1500;
const SECOND_CHANNEL_AFTER_MS = 300;
const RETRY_MS = 500;
const channels = [];
// The stop that has not been answered: when it was pressed, and the message that says so.
let undelivered = null;

// Register a second, open channel for the stop, used where no answer comes soon.
export const addStopChannel = (send) => channels.push(send);

// Whether the request was answered. A browser opens few connections to one host: `keepalive` and
// the abort of all other requests let this one through.
async function send(source) {
  try {
    const response = await fetch(`/api/v1/stop?by=${encodeURIComponent(source)}`, {
      method: "POST",
      keepalive: true,
      signal: AbortSignal.timeout(TIMEOUT_MS),
    });
    return response.ok;
  } catch {
    return false;
  }
}

// Stop the robot; ends once the stop was answered.
export async function stop(source) {
  abortAll(t("cancelled to let the stop through; check whether it took effect"));
  const pressedMs = performance.now();
  const sendBySecond = () => channels.forEach((sendTo) => sendTo(source));
  const timer = setTimeout(sendBySecond, SECOND_CHANNEL_AFTER_MS);
  for (let attempt = 0; attempt < ATTEMPTS; attempt += 1) {
    if (await send(source)) {
      clearTimeout(timer);
      delivered();
      return;
    }
  }
  if (undelivered) {
    await undelivered.answered; // its loop goes on
    return;
  }
  let answer;
  const answered = new Promise((resolve) => {
    answer = resolve;
  });
  undelivered = {
    pressedMs,
    answered,
    answer,
    toast: notify(
      t("THE STOP DID NOT REACH THE ROBOT. It is sent until it does. Use the stop on the robot itself."),
      { stays: true },
    ),
  };
  while (undelivered) {
    await new Promise((resolve) => setTimeout(resolve, RETRY_MS));
    if (undelivered && (await send(source))) delivered();
  }
}

// The robot is stopped: a stop that was not answered has arrived after all.
export function delivered() {
  if (!undelivered) return;
  const seconds = Math.max((performance.now() - undelivered.pressedMs) / 1000, 1).toFixed(0);
  undelivered.toast.remove();
  undelivered.answer();
  undelivered = null;
  notify(t("The stop was delivered {seconds} s late: the robot is stopped.", { seconds }), { good: true });
}
