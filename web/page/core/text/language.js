// The language of the page. A text is written in English and looked up in the catalog of the
// language in which the console sent the page; `web/README.md` says how to add a language.

const root = document.documentElement;
export const language = root.lang || "en";
const CATALOG_MS = 5000;
const ENGLISH = { texts: {}, sentences: {} };
const { texts, sentences } = language === "en" ? ENGLISH : await catalog();

// Without its catalog the page speaks English: the stop waits for no translation.
async function catalog() {
  try {
    const signal = AbortSignal.timeout(CATALOG_MS);
    return await (await fetch(`/page/languages/${language}.json`, { signal })).json();
  } catch {
    return ENGLISH;
  }
}

const CATEGORIES = ["zero", "one", "two", "few", "many", "other"]; // as gettext counts the forms
const plurals = new Intl.PluralRules(language);
const known = new Set(plurals.resolvedOptions().pluralCategories);
const categories = CATEGORIES.filter((category) => known.has(category));

const filled = (text, values) =>
  text.replace(/\{(\w+)\}/g, (whole, name) => (name in values ? values[name] : whole));

// The text in the language of the page, with `{names}` replaced by the values.
export const t = (text, values = {}) => filled(texts[text]?.[0] ?? text, values);

// The same for a text that depends on a number `n`.
export function tn(one, many, n, values = {}) {
  const forms = texts[one] ?? [one, many];
  const form = Math.min(categories.indexOf(plurals.select(n)), forms.length - 1);
  return filled(forms[form], { n, ...values });
}

const formats = [];
const formatWith = (digits) =>
  new Intl.NumberFormat(language, {
    minimumFractionDigits: digits,
    maximumFractionDigits: digits,
    useGrouping: false,
    signDisplay: "negative", // a number that rounds to zero has no sign
  });

// A number with a fixed number of decimals.
export const number = (value, digits) => (formats[digits] ??= formatWith(digits)).format(value);

const shortest = new Intl.NumberFormat(language, { maximumFractionDigits: 3, useGrouping: false });
// A number with as many decimals as it has, three at most.
export const decimal = (value) => shortest.format(value);

const decimalSign = number(0.1, 1).charAt(1);
const localNumber = (text) => text.replace(".", decimalSign);

const between = (text) => text.split(/[,\s]+/).filter(Boolean);
const POSE_NUMBERS = 3; // x, y and heading: the most that is typed in one text

// The numbers of a typed text, between blanks and commas; NaN for what is none. In a language that
// writes decimals with a comma, one between two digits is no separator, 3,5 is one number. NaN is all
// that is returned where it could be either: beside a decimal point, and beside a comma that separates
// if with every comma as a separator it is a pose, too, as is 5,3, 90.
export function typedNumbers(typed) {
  const withPoints = decimalSign === "," ? typed.replace(/(\d),(?=\d)/g, "$1.") : typed;
  const isPoseToo = withPoints.includes(",") && between(typed).length <= POSE_NUMBERS;
  if (withPoints !== typed && (typed.includes(".") || isPoseToo)) return [NaN];
  return between(withPoints).map(Number);
}

export const capitalised = (text) => text.charAt(0).toUpperCase() + text.slice(1);

// The robot's sentences carry figures and names: a template that fits is translated, and so are the
// sentences in it. Templates with many words come first.
const NAMES = new Set(["name", "title", "class_name"]); // mostly given by people
const FIELD = /\{(\w+)(?::([^}]*))?\}/g;
const FIGURE = "([-+]?(?:[\\d.]+(?:e[-+]?\\d+)?|inf|nan)%?)";
const escaped = (text) => text.replace(/[.*+?^${}()|[\]\\]/g, "\\$&");
const templates = Object.entries(sentences)
  .filter(([source]) => source.search(FIELD) >= 0)
  .sort(([a], [b]) => b.replace(FIELD, "").length - a.replace(FIELD, "").length)
  .map(([source, target]) => ({ target, ...matcher(source) }));

function matcher(source) {
  const names = [];
  let pattern = "";
  let end = 0;
  for (const { 0: whole, 1: name, 2: format, index } of source.matchAll(FIELD)) {
    names.push(name);
    pattern += escaped(source.slice(end, index)) + (format ? FIGURE : "(.*?)");
    end = index + whole.length;
  }
  return { names, pattern: new RegExp(`^${pattern}${escaped(source.slice(end))}$`, "s") };
}

const MAX_KEPT = 500;
const said = new Map();

// A sentence of the robot's program in the language of the page; as it is where no template fits.
export function sentence(text) {
  if (!text || language === "en") return text;
  if (!said.has(text)) {
    if (said.size >= MAX_KEPT) said.clear();
    said.set(text, translated(text));
  }
  return said.get(text);
}

// A name as people gave it, or translated if it came with the program, as the classes of the beware
// list do.
export const named = (name) => (Object.hasOwn(sentences, name) ? sentences[name] : name);

function translated(text) {
  if (Object.hasOwn(sentences, text)) return sentences[text];
  if (Object.hasOwn(texts, text)) return texts[text][0];
  for (const { target, names, pattern } of templates) {
    const found = pattern.exec(text);
    if (!found) continue;
    const values = Object.fromEntries(names.map((name, i) => [name, found[i + 1]]));
    return target.replace(FIELD, (_, name, format) => {
      if (format) return localNumber(values[name]);
      return NAMES.has(name)
        ? values[name].replace(/[^“”]+/, named) // it may be quoted
        : sentence(values[name]);
    });
  }
  if (text.endsWith(".")) return `${sentence(text.slice(0, -1))}.`;
  const small = text.charAt(0).toLowerCase() + text.slice(1);
  return small === text || sentence(small) === small ? text : capitalised(sentence(small));
}

const COOKIE = "bewarenav-language";
const YEAR_S = 365 * 24 * 3600;

export const languages = (root.dataset.languages ?? "en").split(" ");
export const nameOfLanguage = (code) => new Intl.DisplayNames([code], { type: "language" }).of(code);

// Keep the language for this browser: for its log-in, and for a console without users.
export function keepLanguage(code) {
  document.cookie = `${COOKIE}=${code}; path=/; max-age=${YEAR_S}; samesite=strict`;
}
