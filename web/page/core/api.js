// Requests to the same routes that programs use. A refusal becomes an Error whose text is the system's own sentence.

import { during } from "./progress.js";

export class Refusal extends Error {
  constructor(status, body) {
    super(body?.error?.message ?? `the console answered ${status}`);
    this.status = status;
    this.body = body;
  }
}

const PATIENCE_MS = 60_000;
const open = new Set();
const alarms = [];

// Everything the page fetches but the stop. A browser has few connections to one host, and the stop must not wait for one: it
// ends all of these first, and none waits for ever.
export async function fetched(address, options = {}) {
  const giveUp = new AbortController();
  const tooLong = setTimeout(() => giveUp.abort(), PATIENCE_MS);
  open.add(giveUp);
  try {
    const answer = await fetch(address, { ...options, signal: giveUp.signal });
    const body = await answer.blob(); // until it is read it keeps the connection
    return new Response(body.size ? body : null, { status: answer.status, headers: answer.headers });
  } finally { clearTimeout(tooLong); open.delete(giveUp); }
}

export async function request(method, path, body, headers = {}) {
  const options = { method, headers: { Accept: "application/json", ...headers } };
  if (body !== undefined) {
    options.headers["Content-Type"] = "application/json";
    options.body = JSON.stringify(body);
  }
  let response;
  try {
    response = await during(fetched(`/api/v1${path}`, options), `${method} ${path}`);
  } catch (error) {
    if (error instanceof Refusal) throw error;
    throw new Refusal(0, { error: { message: "the console does not answer; nothing was changed as far as this page knows" } });
  }
  const text = await response.text();
  let value = null;
  try { value = text ? JSON.parse(text) : null; } catch { /* an answer that is no JSON has no more to say */ }
  if (!response.ok) throw new Refusal(response.status, value);
  return value;
}

export const get = (path) => request("GET", path);
export const post = (path, body) => request("POST", path, body);

const SOON_MS = 300;
// Another way to say stop, that is open already: told of it where no answer comes soon.
export const alsoStopsBy = (tell) => alarms.push(tell);

// The stop is sent again until an answer comes: it may be the one request that a bad link swallows.
export async function stop(by) {
  const first = { error: { message: "given up, to let the stop through; look whether it was done" } };
  for (const waiting of open) waiting.abort(new Refusal(0, first));
  const unheard = setTimeout(() => alarms.forEach((tell) => tell(by)), SOON_MS);
  for (let attempt = 0; attempt < 3; attempt += 1) {
    try {
      const response = await fetch(`/api/v1/stop?by=${encodeURIComponent(by)}`, { method: "POST", keepalive: true, signal: AbortSignal.timeout(1500) });
      if (response.ok) { clearTimeout(unheard); return; }
    } catch { /* try again */ }
  }
  throw new Error("THE STOP DID NOT REACH THE ROBOT. Use the stop on the robot itself.");
}

// One connection that comes back by itself; `onMessage` gets parsed messages, `onOpen` a function to send with.
export function connect(path, { onMessage, onOpen = () => {}, onClose = () => {} }) {
  const scheme = location.protocol === "https:" ? "wss" : "ws";
  let socket;
  const open = () => {
    socket = new WebSocket(`${scheme}://${location.host}/api/v1${path}`);
    socket.onopen = () => onOpen();
    socket.onmessage = (event) => onMessage(JSON.parse(event.data));
    socket.onclose = () => { onClose(); setTimeout(open, 500); };
  };
  open();
  return { send: (message) => { if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message)); } };
}
