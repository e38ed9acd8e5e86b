// The networks: what each is, how it compares with the one it came from, use and roll back.

import { abortableFetch, FILE_S, get, post, request } from "../core/link/api.js";
import { element, make, set, setText } from "../core/dom.js";
import { number, sentence, t } from "../core/text/language.js";
import { attempt, notify } from "../core/toasts.js";
import { askTwice } from "../core/twice.js";

const ORIGINS = { start: t("given at the start"), training: t("trained here"), upload: t("uploaded") };
let shown = "";
let complained = "";

export async function refreshNetworks() {
  const answer = await get("/teach/networks");
  const { used, previous, exchange, trouble, versions } = answer;
  setText(
    element("exchange"),
    exchange ? t("{name} is being prepared …", { name: exchange }) : used ? t("{name} is in use", { name: used }) : t("colour rules alone"),
  );
  set(element("rollback"), {
    disabled: Boolean(exchange) || previous === null,
    title: previous === null ? t("No other network was in use before") : t("Use {name}, which was in use before", { name: previous }),
  });
  if (trouble && trouble !== complained) notify(sentence(trouble));
  complained = trouble;
  if (shown === JSON.stringify(answer)) return;
  shown = JSON.stringify(answer);
  const start = element("start");
  const chosen = start.value;
  start.replaceChildren(...versions.map(({ name }) => make("option", { value: name }, name)));
  start.value = versions.some(({ name }) => name === chosen) ? chosen : (used ?? "start");
  element("networks").replaceChildren(...versions.toReversed().map((one) => rowOf(one, used, exchange)));
}

function rowOf(version, used, exchange) {
  const { name, origin, sha256, taught, figures, kept_share: kept, start_name: from, not_found: missed } = version;
  const path = `/teach/networks/${encodeURIComponent(name)}`;
  const way = missed.length ? `${path}/use?force=true` : `${path}/use`;
  const use = make("button", { "data-testid": `use-${name}`, onclick: () => act(() => post(way)) }, missed.length ? t("Use anyway") : t("Use"));
  use.disabled = name === used || Boolean(exchange);
  const remove = make("button", {}, t("Delete"));
  askTwice(remove, t("Really delete?"), () => act(() => request("DELETE", path)));
  remove.disabled = name === used || origin === "start";
  const facts = [ORIGINS[origin], sha256.slice(0, 12)];
  if (from) facts.push(t("from {name}", { name: from }));
  if (taught.length) facts.push(t("taught: {names}", { names: taught.join(", ") }));
  if (kept !== null) facts.push(t("{share} % elsewhere unchanged", { share: number(100 * kept, 1) }));
  const row = make("li", { "data-used": String(name === used) }, make("b", {}, name), make("span", { class: "soft" }, facts.join(" · ")), make("div", { class: "row card-tools" }, use, remove));
  if (missed.length) row.append(make("p", { class: "bad", "data-testid": `missed-${name}` }, missedText(missed)));
  const worse = figures.filter(({ change }) => change && change[1] < 0).map((one) => one.name);
  if (worse.length) row.append(make("p", { class: "bad" }, t("Finds less well than before: {names}", { names: worse.join(", ") })));
  if (figures.length) row.append(make("details", {}, make("summary", {}, t("Old and new, class by class")), tableOf(figures)));
  return row;
}

// What to do about classes that were taught and are not found.
export const missedText = (names) =>
  t("It does not find {names} yet. Mark more images, from other sides and distances, and train again.", { names: names.join(", ") });

function tableOf(figures) {
  const cell = (value) => make("td", {}, value === null ? "–" : number(value, 2));
  const between = (change) => make("td", {}, change ? change.map((value) => number(value, 2)).join(" … ") : "–");
  const head = [t("class"), t("old"), t("new"), t("change"), t("images")].map((title) => make("th", {}, title));
  const images = { captured: t("held back"), rendered: t("rendered") };
  const rows = figures
    .filter(({ pixels }) => pixels)
    .map((one) => make("tr", {}, make("td", {}, one.name), cell(one.old), cell(one.new), between(one.change), make("td", {}, images[one.images])));
  return make("table", { "data-testid": "figures" }, make("thead", {}, make("tr", {}, ...head)), make("tbody", {}, ...rows));
}

const act = (action) =>
  attempt(async () => {
    await action();
    await refreshNetworks();
  });

element("rollback").onclick = () => act(() => post("/teach/networks/rollback"));
element("network-file").onchange = ({ target }) => {
  const file = target.files[0];
  target.value = "";
  if (!file) return;
  const name = file.name.replace(/\.safetensors$/, "").replace(/[^A-Za-z0-9 _-]/g, "-").slice(0, 40);
  act(() => upload(`/teach/networks?name=${encodeURIComponent(name)}`, file));
};

// Send a file as the body of a request.
export async function upload(path, file) {
  const answer = await abortableFetch(`/api/v1${path}`, { method: "POST", body: file }, FILE_S);
  const value = await answer.json();
  if (!answer.ok) throw new Error(sentence(value.error.message));
  return value;
}
