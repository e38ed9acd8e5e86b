// When a canvas is drawn: after a change, at most ten times a second, and never while hidden.

const PERIOD_MS = 100;
// Number of drawings of each canvas since the page was opened, for tests and measurements.
window.paints = {};

// Return a function to call on every change; `draw` follows once, however many changes there were.
export function drawScheduler(name, canvas, draw) {
  window.paints[name] = 0;
  let isScheduled = false;
  let earliestMs = 0;
  const isVisible = () => !document.hidden && canvas.clientWidth > 0;
  const run = () => {
    isScheduled = false;
    if (!isVisible()) return;
    window.paints[name] += 1;
    draw();
  };
  const schedule = () => {
    if (isScheduled || !isVisible()) return;
    isScheduled = true;
    const now = performance.now();
    if (now >= earliestMs) requestAnimationFrame(run);
    else setTimeout(() => requestAnimationFrame(run), earliestMs - now);
    earliestMs = Math.max(earliestMs, now) + PERIOD_MS;
  };
  document.addEventListener("visibilitychange", () => {
    isScheduled = false;
    schedule();
  });
  return schedule;
}
