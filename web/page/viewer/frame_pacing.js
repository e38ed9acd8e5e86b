// Frame pacing of viser's page, loaded before its other scripts: viser alone would draw without end.
// A frame is given only while the view is visible and something may have changed: a message of the
// server, the pointer, a key, the size. Without a graphics card the processor draws, which the robot
// needs too: then every frame is followed by a rest half as long again as its drawing, except while the
// operator acts, because viser handles messages and clicks with the next frame. The first frame that
// shows the robot is told to the frame of the page, by the event "drawn": it may take many seconds.

(() => {
  const AWAKE_MS = 600;
  const REST_SHARE = 1.5;
  const MIN_REST_MS = 150;
  const ACTING_MS = 1000;
  // After the frame in which viser handles a message: one for the objects that it made, which have
  // no place yet, and one for their place and image. On a slow processor they take longer than
  // AWAKE_MS, and without them the floor would stay at the origin.
  const SETTLING_FRAMES = 2;
  const LOADING_MS = 5000;
  const host = window.frameElement;
  const browserFrame = window.requestAnimationFrame.bind(window);
  const callbacks = new Map();
  let lastId = 0;
  let isScheduled = false;
  let isTold = false;
  let hasChanged = false; // since the last frame began, however long ago that was
  let settling = 0; // frames still to be drawn for the last change
  let unshown = SETTLING_FRAMES; // frames with the robot until the whole scene is where it belongs
  let restTimer = 0;
  let actingUntil = 0;
  let awakeUntil = performance.now() + LOADING_MS;

  const isSoftware = () => host?.dataset.webgl === "software";
  const isVisible = () => !document.hidden && host?.dataset.seen !== "no";
  window.framesDrawn = 0;

  function schedule() {
    const isAwake = hasChanged || settling > 0 || performance.now() <= awakeUntil;
    if (isScheduled || callbacks.size === 0 || !isVisible() || !isAwake) return;
    isScheduled = true;
    browserFrame(run);
  }

  function run(now) {
    const draws = [...callbacks.values()];
    callbacks.clear();
    const beganMs = performance.now();
    settling = hasChanged ? SETTLING_FRAMES : settling - 1;
    hasChanged = false;
    window.framesDrawn += 1;
    window.prepareFrame();
    for (const draw of draws) {
      try {
        draw(now);
      } catch (error) {
        reportError(error);
      }
    }
    if (window.isRobotDrawn && !isTold) tellWhenShown();
    if (!isSoftware()) {
      isScheduled = false;
      schedule();
      return;
    }
    browserFrame(() =>
      browserFrame((drawnMs) => {
        const restMs =
          drawnMs < actingUntil || !isTold
            ? 0
            : Math.max(REST_SHARE * (performance.now() - beganMs), MIN_REST_MS);
        restTimer = setTimeout(endRest, restMs);
      }),
    );
  }

  function tellWhenShown() {
    settling = Math.max(settling, unshown);
    if (unshown-- > 0) return;
    isTold = true;
    // The browser gives the frame after the next one when this one is on the screen.
    browserFrame(() => browserFrame(() => host?.dispatchEvent(new Event("drawn"))));
  }

  function endRest() {
    clearTimeout(restTimer);
    restTimer = 0;
    isScheduled = false;
    schedule();
  }

  function wake() {
    hasChanged = true;
    awakeUntil = Math.max(awakeUntil, performance.now() + AWAKE_MS);
    schedule();
  }

  function act(event) {
    wake();
    if (event.type === "pointermove" && event.buttons === 0) return;
    actingUntil = performance.now() + ACTING_MS;
    if (restTimer) endRest();
  }

  window.requestAnimationFrame = (callback) => {
    lastId += 1;
    callbacks.set(lastId, callback);
    schedule();
    return lastId;
  };
  window.cancelAnimationFrame = (id) => {
    callbacks.delete(id);
  };
  window.Worker = class extends window.Worker {
    constructor(...given) {
      super(...given);
      this.addEventListener("message", wake);
    }
  };
  const kinds = ["pointerdown", "pointermove", "pointerup", "wheel", "keydown", "resize", "seen"];
  for (const kind of kinds) window.addEventListener(kind, act, { capture: true, passive: true });
  document.addEventListener("visibilitychange", wake);
})();
