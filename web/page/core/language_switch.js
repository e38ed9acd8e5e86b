// The switch between the languages, each under its own name.

import { element, make } from "./dom.js";
import { chooseLanguage, language, languages, nameOfLanguage } from "./language.js";

element("language").textContent = language.toUpperCase();
element("languages").append(
  ...languages.map((code) =>
    make(
      "button",
      {
        lang: code,
        "aria-pressed": String(code === language),
        "data-testid": `language-${code}`,
        onclick: () => chooseLanguage(code),
      },
      nameOfLanguage(code),
    ),
  ),
);
