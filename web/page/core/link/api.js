// Requests to the HTTP API. A refusal becomes an Error whose text is the console's own sentence.

import { sentence, t } from "../text/language.js";
import { showProgress } from "./progress.js";

class Refusal extends Error {
  constructor(status, body) {
    super(sentence(body?.error?.message) ?? t("the console answered with status {status}", { status }));
    this.status = status;
    this.code = body?.error?.code;
    this.body = body;
  }
}

// Longest times of a request, and of one with a file: the console waits up to five minutes for its
// arrival, and then works on it.
const TIMEOUT_S = 60;
export const FILE_S = 600;
const WAITING = t("the console");
const pending = new Set();
let siteId = null;

// The site that the page shows: what it asks for is meant for the map of that one.
export const setSite = (id) => {
  siteId = id;
};
export const siteHeader = () => (siteId === null ? {} : { "Site-Id": siteId });

// Every request of the page but the stop. A browser opens few connections to one host and the stop
// must not wait for one, so the stop aborts all of these.
export async function abortableFetch(address, options = {}, limitS = TIMEOUT_S) {
  const abort = new AbortController();
  const late = () => t("the console has not answered within {seconds} s", { seconds: limitS });
  const timer = setTimeout(() => abort.abort(failure(late())), 1000 * limitS);
  pending.add(abort);
  try {
    const answer = await fetch(address, { ...options, signal: abort.signal });
    // An unread body occupies the connection; a blob would be held by the browser's main process.
    const body = await answer.arrayBuffer();
    return new Response(body.byteLength ? body : null, {
      status: answer.status,
      headers: answer.headers,
    });
  } catch {
    if (abort.signal.aborted) throw abort.signal.reason;
    throw failure(t("the console does not answer; as far as this page knows, nothing was changed"));
  } finally {
    clearTimeout(timer);
    pending.delete(abort);
  }
}

// The error of a request without an answer.
const failure = (message) => new Refusal(0, { error: { message } });

export const request = async (...given) => (await edit(...given)).value;

// A request that is an edit: the value of its answer, and the number by which it alone can be undone.
export async function edit(method, path, body, headers = {}, limitS = TIMEOUT_S) {
  const site = method === "GET" ? {} : siteHeader();
  const options = { method, headers: { Accept: "application/json", ...site, ...headers } };
  if (body !== undefined) {
    options.headers["Content-Type"] = "application/json";
    options.body = JSON.stringify(body);
  }
  const answer = await showProgress(abortableFetch(`/api/v1${path}`, options, limitS), WAITING);
  if (!answer.ok) throw await refusalOf(answer);
  const value = parsed(await answer.text());
  return { value, undoNumber: answer.headers.get("Undo-Number") };
}

// The error of an answer that refuses.
export const refusalOf = async (answer) => new Refusal(answer.status, parsed(await answer.text()));

function parsed(text) {
  try {
    return text ? JSON.parse(text) : null;
  } catch {
    return null; // an answer that is not JSON says nothing beyond its status
  }
}

export const get = (path) => request("GET", path);
export const post = (path, body, limitS) => request("POST", path, body, {}, limitS);

// Abort every request that waits, with a message for those who asked.
export function abortAll(message) {
  for (const abort of pending) abort.abort(failure(message));
}

const RECONNECT_MS = 500;
const CONNECTING_S = 10; // a browser tries one connection for a minute

// A websocket that reconnects; `onMessage` gets parsed messages. One whose other end never rests is
// given up after `restS` seconds without a message: of a lost network a browser learns late.
export function connect(path, { onMessage, onOpen = () => {}, onClose = () => {}, restS = Infinity }) {
  const scheme = location.protocol === "https:" ? "wss" : "ws";
  let socket;
  let restingS = 0;
  const open = () => {
    restingS = 0;
    socket = new WebSocket(`${scheme}://${location.host}/api/v1${path}`);
    socket.onopen = () => onOpen();
    socket.onmessage = (event) => {
      restingS = 0;
      onMessage(JSON.parse(event.data));
    };
    socket.onclose = () => {
      onClose();
      setTimeout(open, RECONNECT_MS);
    };
  };
  const giveUp = () => {
    if (socket.readyState > WebSocket.OPEN) return;
    const { onclose } = socket;
    socket.onmessage = socket.onclose = null;
    socket.close();
    onclose();
  };
  open();
  // Counted and not measured: in a hidden page, or after the computer has slept, time passes in which
  // no message could be taken.
  setInterval(() => {
    if (socket.readyState > WebSocket.OPEN) return;
    restingS += 1;
    if (restingS <= (socket.readyState === WebSocket.OPEN ? restS : CONNECTING_S)) return;
    giveUp();
  }, 1000);
  return {
    reconnect: giveUp,
    send: (message) => {
      if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message));
    },
  };
}
