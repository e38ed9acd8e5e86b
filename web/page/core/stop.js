// The emergency stop: sent until it is answered, also after a lost connection.

import { abortAll } from "./link/api.js";
import { t } from "./text/language.js";
import { notify } from "./toasts.js";

const ATTEMPTS = 3;
const TIMEOUT_MS = 1500;
const SECOND_CHANNEL_AFTER_MS = 300;
const RETRY_MS = 500;
const LOGGED_OUT = 401;
const channels = [];
// The stop that has not been answered: when it was pressed, and the message that says so.
let undelivered = null;
let waiting = 0;
// Whether a stop is on its way: nothing else may take a connection from it.
export const isStopWaiting = () => waiting > 0;

// Register a second, open channel for the stop, used where no answer comes soon.
export const addStopChannel = (send) => channels.push(send);

// Send the stop; returns the status of the answer, 0 without one. A browser opens few connections to
// one host: `keepalive` and the abort of all other requests let this one through.
async function send(source) {
  try {
    const response = await fetch(`/api/v1/stop?by=${encodeURIComponent(source)}`, {
      method: "POST",
      keepalive: true,
      signal: AbortSignal.timeout(TIMEOUT_MS),
    });
    return response.status;
  } catch {
    return 0;
  }
}

const isDone = (status) => status >= 200 && status < 300;

// Stop the robot; ends once the stop was answered, and returns whether the robot is stopped.
export async function stop(source) {
  waiting += 1;
  try {
    return await sendUntilAnswered(source);
  } finally {
    waiting -= 1;
  }
}

async function sendUntilAnswered(source) {
  abortAll(t("cancelled to let the stop through; check whether it took effect"));
  const pressedMs = performance.now();
  const sendBySecond = () => channels.forEach((sendTo) => sendTo(source));
  const timer = setTimeout(sendBySecond, SECOND_CHANNEL_AFTER_MS);
  for (let attempt = 0; attempt < ATTEMPTS; attempt += 1) {
    const status = await send(source);
    if (isDone(status) || status === LOGGED_OUT) {
      clearTimeout(timer);
      return isDone(status) ? delivered() : refused();
    }
  }
  if (undelivered) return undelivered.answered; // its loop goes on
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
    const status = undelivered && (await send(source));
    if (isDone(status)) delivered();
    else if (undelivered && status === LOGGED_OUT) refused();
  }
  return answered;
}

function end(isStopped) {
  for (const note of document.querySelectorAll("[data-early]")) note.remove();
  undelivered?.toast.remove();
  undelivered?.answer(isStopped);
  undelivered = null;
  return isStopped;
}

// Without a log-in the stop would be refused however often it is sent.
function refused() {
  notify(
    t("THE STOP WAS REFUSED: you are no longer logged in. Use the stop on the robot itself, or log in and stop again."),
    { stays: true, action: { label: t("Log in"), run: () => location.reload() } },
  );
  return end(false);
}

// The page as a whole runs: it stops the robot from now on, and sends what `early_stop.js` has not
// delivered. `tellStopped` is called if the robot is stopped.
export async function takeOver(tellStopped = () => {}) {
  const { source, isStopped } = window.takeOverStop?.() ?? {};
  if (source ? await stop(source) : isStopped) tellStopped();
}

// The robot is stopped: a stop that was not answered has arrived after all.
export function delivered() {
  if (undelivered) {
    const seconds = Math.max((performance.now() - undelivered.pressedMs) / 1000, 1).toFixed(0);
    notify(t("The stop was delivered {seconds} s late: the robot is stopped.", { seconds }), { good: true });
  }
  return end(true);
}
