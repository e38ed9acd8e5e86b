// Runs before anything else of viser's page, which else draws without end. A frame is given only while somebody can see it and
// something may have changed: a message of the server, the pointer, a key, the size. Without a graphics card it is drawn by the
// processor that the robot needs too: then each frame is followed by a rest as long as its drawing took, but not while the
// operator acts: viser looks at its messages and at what was clicked with the next frame.

(() => {
  const AWAKE_MS = 600;
  const REST = 1;
  const LEAST_REST_MS = 150;
  const ACTING_MS = 1000;
  const place = window.frameElement;
  const browserFrame = window.requestAnimationFrame.bind(window);
  const waiting = new Map();
  let number = 0;
  let asked = false;
  let owed = false; // something has happened since the last frame began, however long that took
  let resting = 0;
  let actingUntil = 0;
  let awakeUntil = performance.now() + 5000; // until the scene stands

  const software = () => place?.dataset.webgl === "software";
  const seen = () => !document.hidden && place?.dataset.seen !== "no";
  window.framesDrawn = 0;

  function plan() {
    if (asked || waiting.size === 0 || !seen() || (!owed && performance.now() > awakeUntil)) return;
    asked = true;
    browserFrame(run);
  }

  function run(now) {
    const draws = [...waiting.values()];
    waiting.clear();
    const began = performance.now();
    owed = false;
    window.framesDrawn += 1;
    for (const draw of draws) { try { draw(now); } catch (error) { reportError(error); } }
    if (!software()) { asked = false; plan(); return; }
    // The browser gives the frame after the next one when this one is on the screen.
    browserFrame(() => browserFrame((drawn) => {
      const rest = drawn < actingUntil ? 0 : Math.max(REST * (performance.now() - began), LEAST_REST_MS);
      resting = setTimeout(rested, rest);
    }));
  }

  function rested() { clearTimeout(resting); resting = 0; asked = false; plan(); }

  function wake() { owed = true; awakeUntil = Math.max(awakeUntil, performance.now() + AWAKE_MS); plan(); }

  function act(event) {
    wake();
    if (event.type === "pointermove" && event.buttons === 0) return;
    actingUntil = performance.now() + ACTING_MS;
    if (resting) rested();
  }

  window.requestAnimationFrame = (draw) => { number += 1; waiting.set(number, draw); plan(); return number; };
  window.cancelAnimationFrame = (which) => { waiting.delete(which); };
  window.Worker = class extends window.Worker {
    constructor(...given) { super(...given); this.addEventListener("message", wake); }
  };
  for (const kind of ["pointerdown", "pointermove", "pointerup", "wheel", "keydown", "resize", "seen"]) window.addEventListener(kind, act, { capture: true, passive: true });
  document.addEventListener("visibilitychange", wake);
})();
