// The switch between the languages, each under its own name.

import { get } from "./api.js";
import { element, make } from "./dom.js";
import { keepLanguage, language, languages, nameOfLanguage } from "./language.js";
import { attempt } from "./toasts.js";

const choose = (code) =>
  attempt(async () => {
    const you = await get("/me");
    keepLanguage(code, you.logged_in ? you.name : null);
    location.reload(); // control is kept
  });

element("language").textContent = language.toUpperCase();
element("languages").append(
  ...languages.map((code) =>
    make(
      "button",
      {
        lang: code,
        "aria-pressed": String(code === language),
        "data-testid": `language-${code}`,
        onclick: () => choose(code),
      },
      nameOfLanguage(code),
    ),
  ),
);
