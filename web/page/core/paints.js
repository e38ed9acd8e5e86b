// When a canvas is drawn: at most ten times a second, only when something that it shows has changed, and never unseen.

const PERIOD_MS = 100;
// How often each canvas was drawn since the page was opened: for tests and measurements.
window.paints = {};

// Gives a function to call on every change: `draw` follows once, in the next turn, however many changes there were.
export function painter(name, canvas, draw) {
  window.paints[name] = 0;
  let asked = false;
  let due = 0;
  const seen = () => !document.hidden && canvas.clientWidth > 0;
  const run = () => {
    asked = false;
    if (!seen()) return;
    window.paints[name] += 1;
    draw();
  };
  const changed = () => {
    if (asked || !seen()) return;
    asked = true;
    const now = performance.now();
    if (now >= due) requestAnimationFrame(run);
    else setTimeout(() => requestAnimationFrame(run), due - now);
    due = Math.max(due, now) + PERIOD_MS;
  };
  document.addEventListener("visibilitychange", () => { asked = false; changed(); });
  return changed;
}
