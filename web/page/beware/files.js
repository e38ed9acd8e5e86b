// The beware list as a TOML file: written, and read with what is wrong in it named by line.

import { abortableFetch, refusalOf, siteHeader } from "../core/link/api.js";
import { download, element } from "../core/dom.js";
import { t } from "../core/text/language.js";
import { attempt, notify } from "../core/toasts.js";
import { propose } from "./proposal.js";

const PATH = "/api/v1/beware.toml";
let refresh = () => {};

// `onNewList` loads and shows the list again.
export function build(onNewList) {
  refresh = onNewList;
}

async function importText(text, query) {
  const headers = { "Content-Type": "application/toml", ...siteHeader() };
  const response = await abortableFetch(PATH + query, { method: "PUT", headers, body: text });
  if (!response.ok) throw await refusalOf(response);
  notify(t("The list of the file is in force."), { good: true });
  refresh();
}

element("beware-file").onchange = (event) =>
  attempt(async () => {
    const [file] = event.target.files;
    const text = await file.text();
    event.target.value = "";
    element("beware-files").hidePopover();
    const send = (query) => importText(text, query);
    propose({ question: { toml: text }, send, host: element("beware-tools") });
  });
element("beware-export").onclick = () =>
  attempt(async () => {
    const response = await abortableFetch(PATH);
    if (!response.ok) throw new Error(t("the console did not deliver the file"));
    download("beware.toml", new Blob([await response.text()], { type: "application/toml" }));
  });
