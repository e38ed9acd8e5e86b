// The stop until the modules of the page run, which come late over a slow link, and never where one of
// them fails: a script without imports, before everything else in the page.

{
  const TIMEOUT_MS = 1500;
  const RETRY_MS = 500;
  const LOADING_MS = 10_000;
  const LOGGED_OUT = 401;
  // As in `keys.js`: fields in which a blank means something.
  const BLANK_FIELDS =
    "input:is(:not([type]), [type=text], [type=search], [type=password], [type=url], [type=email]), textarea";
  // What was pressed for the stop that has not been answered, as `{ source }`.
  let undelivered = null;
  let socket = null;

  function show(name, isShown = true) {
    const note = document.querySelector(`[data-early="${name}"]`);
    if (note) note.hidden = !isShown;
  }

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

  // The modules take up the few connections that a browser opens to one host, and a request waits
  // until they are there; a websocket has a connection of its own. The console answers the stop on it.
  function sendBySocket(pressed) {
    if (socket?.readyState <= WebSocket.OPEN) return;
    socket = new WebSocket(`${location.origin.replace("http", "ws")}/api/v1/control/live`);
    socket.onopen = () => socket.send(JSON.stringify({ type: "stop", by: pressed.source }));
    socket.onmessage = ({ data }) => {
      if (JSON.parse(data).type === "stopped" && undelivered === pressed) end("stopped");
    };
  }

  function forget() {
    undelivered = null;
    socket?.close();
  }

  function end(answer) {
    forget();
    show("lost", false);
    show(answer);
  }

  async function stop(source) {
    if (undelivered) return; // its loop goes on
    const pressed = { source };
    undelivered = pressed;
    for (const name of ["stopped", "refused"]) show(name, false);
    while (undelivered === pressed) {
      sendBySocket(pressed);
      const status = await send(source);
      if (undelivered !== pressed) return;
      if (status >= 200 && status < 300) end("stopped");
      else if (status === LOGGED_OUT) end("refused");
      else {
        show("lost");
        await new Promise((resolve) => setTimeout(resolve, RETRY_MS));
      }
    }
  }

  // Handlers that the modules have set already are not called.
  function take(event) {
    event.preventDefault();
    event.stopImmediatePropagation();
  }

  const isSpace = (event) => event.code === "Space" && !event.target.matches?.(BLANK_FIELDS);
  const handlers = {
    click: (event) => {
      if (!event.target.closest("#stop")) return;
      take(event);
      stop("console button");
    },
    keydown: (event) => {
      if (!isSpace(event)) return;
      take(event);
      if (!event.repeat) stop("console key");
    },
    // A focused button is pressed when the key is released.
    keyup: (event) => isSpace(event) && take(event),
    // Of a script that cannot be loaded, or that raises an error.
    error: (event) => {
      if (event.target === window || event.target.matches?.("script")) show("failed");
    },
  };
  for (const [name, handle] of Object.entries(handlers)) window.addEventListener(name, handle, true);
  const timer = setTimeout(() => show("failed"), LOADING_MS);

  // The modules stop from now on. Returns what was pressed for a stop that has not been answered, or
  // null, and whether the robot was stopped. `stop.js` removes what is told of a stop that did not reach
  // the robot, or was refused.
  window.takeOverStop = () => {
    clearTimeout(timer);
    for (const [name, handle] of Object.entries(handlers)) window.removeEventListener(name, handle, true);
    const isStopped = document.querySelector("[data-early=stopped]:not([hidden])") !== null;
    for (const name of ["failed", "stopped"]) show(name, false);
    const source = undelivered?.source ?? null;
    forget();
    return { source, isStopped };
  };
}
