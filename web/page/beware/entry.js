// The inspector of a class of the beware list: a draft, whose effect is shown on the map before it
// applies.

import { post, request } from "../core/link/api.js";
import { element, set, setText } from "../core/dom.js";
import { sentence, t } from "../core/text/language.js";
import { isNarrow } from "../core/page_tabs.js";
import { attempt } from "../core/toasts.js";
import { isDrawing, onDraft, setMode } from "../zones/draft.js";
import { classTitle } from "./class_title.js";
import { kindOf, onRule, ruleOf, showRule } from "./colour_picker.js";
import { effectAsker, showOnMap } from "./effect.js";
import { exampleOf, onExample, point, showExample } from "./example.js";
import { cancel as cancelProposal, onProposal, propose } from "./proposal.js";

const form = element("entry");
const field = (name) => element(`entry-${name}`);
const NUMBERS = {
  margin: ["margin_m", 1],
  confidence: ["min_confidence", 100],
  lowest: ["min_height_m", 1],
  highest: ["max_height_m", 1],
  smallest: ["min_size_m", 1],
  largest: ["max_size_m", 1],
};
const REQUIRED = ["margin", "confidence"];

let stored = null;
let version = null;
let refresh = () => {};
const ask = effectAsker();

export function build(onNewList) {
  refresh = onNewList;
}

export const isOpen = () => !form.hidden;

// Edit an entry, or a new one for null.
export function open(entry, listVersion, limits) {
  if (isDrawing()) setMode("navigate");
  cancelProposal();
  stored = entry;
  version = listVersion;
  form.hidden = false;
  setText(element("entry-title"), entry ? classTitle(entry) : t("New class"));
  field("name").value = entry?.name ?? "";
  field("network").value = entry?.network_class ?? "";
  for (const [name, [key, factor]] of Object.entries(NUMBERS)) {
    const value = entry ? entry[key] : { margin_m: 0, min_confidence: 0.5 }[key];
    const { low, high } = limits[key];
    set(field(name), {
      min: String(factor * low),
      max: String(factor * high),
      value: value === null || value === undefined ? "" : String(Math.round(1000 * factor * value) / 1000),
    });
  }
  element("entry-remove").hidden = !entry;
  showRule(entry?.colour ?? null);
  showExample(entry?.prototype ?? null);
  if (isForeign()) point();
  describe();
  // On a phone it opens above the list, which is scrolled to the class.
  if (isNarrow()) form.scrollIntoView({ block: "start" });
  if (!entry) field("name").focus();
}

export function close() {
  if (form.hidden) return;
  form.hidden = true;
  stored = null;
  showRule(null, false);
  showExample(null);
  ask(null);
  showOnMap();
}

// Fields of the entry that differ from the stored one; null for a value that is none.
function changes() {
  const drafted = {
    name: field("name").value.trim(),
    network_class: field("network").value.trim() || null,
    colour: ruleOf(),
    prototype: exampleOf(),
  };
  for (const [name, [key, factor]] of Object.entries(NUMBERS)) {
    const { value } = field(name);
    drafted[key] = value === "" ? null : Number(value) / factor;
  }
  const same = (key) => JSON.stringify(drafted[key]) === JSON.stringify(stored?.[key] ?? null);
  return Object.fromEntries(Object.entries(drafted).filter(([key]) => !same(key)));
}

const missing = () => {
  if (!field("name").value.trim()) return t("Give it a name.");
  const empty = REQUIRED.find((name) => field(name).value === "");
  const wrong = empty ?? Object.keys(NUMBERS).find((name) => !field(name).validity.valid);
  if (!wrong) return "";
  const { min, max } = field(wrong);
  return `${field(wrong).title}: ${t("{low} to {high}", { low: min, high: max })}`;
};

const isKnown = () => Boolean(stored?.found_by.startsWith("network"));

// An example that was made with another network is kept, but nothing can be compared with it.
const isForeign = () =>
  Boolean(exampleOf()) && stored?.prototype === exampleOf() && stored.found_by === "nothing";

function withNetwork(rule) {
  if (!rule) return sentence("network");
  if (rule.fallback) return t("network; its colour rule counts only without one");
  return sentence(rule.alone ? "network and colour rule" : "network, weighed with colour rule");
}

// What the draft would be detected by; what runs now is only known for the stored entry.
function eyes() {
  // The network goes on to know a class that is renamed.
  if (isKnown()) return withNetwork(ruleOf());
  if (!ruleOf()) return !isForeign() && exampleOf() && t("example");
  return kindOf(ruleOf());
}

function describe() {
  const by = eyes();
  const note = element("entry-eyes");
  element("entry-alone").parentElement.hidden = !isKnown();
  setText(
    note,
    by
      ? t("Detected by: {by}", { by })
      : isForeign()
        ? t("▲ It was shown to another network. Click the thing again.")
        : t("▲ Nothing can see it yet: the network does not know it, and it has no colour rule and no example."),
  );
  note.classList.toggle("lost", note.textContent.startsWith("▲"));
  const lacking = missing();
  const changed = changes();
  const isChanged = Object.keys(changed).length > 0;
  set(element("entry-apply"), { disabled: lacking !== "" || !isChanged, title: lacking });
  say(lacking, false);
  if (lacking || !isChanged) {
    ask(null);
    showOnMap();
    return;
  }
  ask(stored ? { changes: { [stored.name]: changed } } : { add: given(changed) }, (answer) => {
    say(answer.text, answer.bad);
    showOnMap(answer);
  });
}

const given = (values) =>
  Object.fromEntries(Object.entries(values).filter(([, value]) => value !== null));

function say(text, bad) {
  const note = element("entry-note");
  setText(note, text);
  note.classList.toggle("bad", Boolean(bad));
}

async function store() {
  try {
    await request("PATCH", address(), changes(), { "If-Match": `"${version}"` });
  } catch (error) {
    if (error.code === "outdated") {
      version = error.body.stored_version;
      say(
        t("Another user has changed the list meanwhile. Apply again to change that version, Cancel to keep it."),
        true,
      );
    }
    throw error;
  }
  close();
  refresh();
}

const address = () => `/beware/${encodeURIComponent(stored.name)}`;
form.onsubmit = (event) => {
  event.preventDefault();
  if (element("entry-apply").disabled) return;
  attempt(async () => {
    if (stored) await store();
    else {
      await post("/beware", given(changes()));
      close();
      refresh();
    }
  });
};
element("entry-remove").onclick = () => {
  const [path, { name }, headers] = [address(), stored, { "If-Match": `"${version}"` }];
  close();
  propose({
    question: { changes: { [name]: null } },
    send: async (query) => {
      await request("DELETE", path + query, undefined, headers);
      refresh();
    },
    host: [...element("beware").children].find((row) => row.dataset.name === name),
  });
};
element("entry-cancel").onclick = close;
form.addEventListener("input", describe);
onRule(describe);
onExample(describe);
onDraft(() => isDrawing() && close());
onProposal(close);
