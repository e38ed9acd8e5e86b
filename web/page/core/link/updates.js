// Values that are fetched when the robot's state says that they have changed.

import { isStopWaiting } from "../stop.js";

const STANDING_FACTOR = 2;
const RETRY_MS = 500;
let isMoving = false;

// Around a standing robot little changes: its values are fetched half as often.
export const setMoving = (moving) => {
  isMoving = moving;
};
export const pause = (ms) =>
  new Promise((resolve) => setTimeout(resolve, isMoving ? ms : STANDING_FACTOR * ms));

// One request at a time, and one more if the value changed meanwhile: a slow link is never flooded.
// One that was lost, or aborted for a stop, is made again once the stop is there: the value may not
// change for hours.
export function oneAtATime(load) {
  let isBusy = false;
  let isDue = false;
  return async function run() {
    isDue = true;
    if (isBusy) return;
    isBusy = true;
    while (isDue) {
      isDue = false;
      try {
        await load();
      } catch (error) {
        isDue ||= !error.status || error.status >= 500; // a lost connection has its own banner
        do await new Promise((resolve) => setTimeout(resolve, RETRY_MS));
        while (document.hidden || isStopWaiting());
      }
    }
    isBusy = false;
  };
}
