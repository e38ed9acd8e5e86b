// What keeps the status line calm: a hold is shown once it has lasted, and stays long enough to be
// read; the line changes at most once a second.

const SHOWN_AFTER_MS = 1000;
const KEPT_MS = 2000;
const LONGEST_STEP_MS = 500;

// Return a function of (isHeld, nowMs) that says whether a hold is to be shown. Time held counts up
// and free time counts down, so that a hold with short gaps is shown as one.
export function holdFilter() {
  let heldMs = 0;
  let lastMs = null;
  let shownSinceMs = null;
  return (isHeld, nowMs) => {
    const stepMs = lastMs === null ? 0 : Math.min(nowMs - lastMs, LONGEST_STEP_MS);
    lastMs = nowMs;
    heldMs = Math.min(Math.max(heldMs + (isHeld ? stepMs : -stepMs), 0), SHOWN_AFTER_MS);
    if (shownSinceMs === null && heldMs >= SHOWN_AFTER_MS) shownSinceMs = nowMs;
    if (shownSinceMs !== null && heldMs === 0 && nowMs - shownSinceMs >= KEPT_MS)
      shownSinceMs = null;
    return shownSinceMs !== null;
  };
}

const RATE_WINDOW_MS = 10_000;
const FEWEST_MS = 5000;
// A decision is continued for as long as its image is at most a second old: with fewer images,
// each of which is some time old before it is decided on, the gate holds the robot.
export const NEEDED_HZ = 3;

// Return a function of (images, nowMs), the number that the robot has handled so far, that says how
// many it handles a second, or null before it can tell.
export function rateMeter() {
  let samples = [];
  return (images, nowMs) => {
    const last = samples.at(-1);
    // A gap in the states says nothing about the robot.
    if (!last || images < last.images || nowMs - last.nowMs > 1000) samples = [];
    samples.push({ images, nowMs });
    samples = samples.filter((sample) => nowMs - sample.nowMs <= RATE_WINDOW_MS);
    const lastedMs = nowMs - samples[0].nowMs;
    return lastedMs < FEWEST_MS ? null : (1000 * (images - samples[0].images)) / lastedMs;
  };
}
