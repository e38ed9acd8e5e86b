// Values that are fetched when the robot's state says that they have changed.

const STANDING_FACTOR = 2;
let isMoving = false;

// Around a standing robot little changes: its values are fetched half as often.
export const setMoving = (moving) => {
  isMoving = moving;
};
export const pause = (ms) =>
  new Promise((resolve) => setTimeout(resolve, isMoving ? ms : STANDING_FACTOR * ms));

// One request at a time, and one more if the value changed meanwhile: a slow link is never flooded.
export function oneAtATime(load) {
  let isBusy = false;
  let isDue = false;
  return async function run() {
    if (isBusy) {
      isDue = true;
      return;
    }
    isBusy = true;
    try {
      await load();
    } catch {
      // the next change tries again; a lost connection has its own banner
    }
    isBusy = false;
    if (isDue) {
      isDue = false;
      run();
    }
  };
}
