// The switch between the languages, each under its own name.

import { get, request } from "./link/api.js";
import { element, make } from "./dom.js";
import { keepLanguage, language, languages, nameOfLanguage } from "./text/language.js";
import { attempt } from "./toasts.js";

const choose = (code) =>
  attempt(async () => {
    const you = await get("/me");
    if (you.logged_in) await request("PUT", "/me/language", { language: code });
    keepLanguage(code);
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
