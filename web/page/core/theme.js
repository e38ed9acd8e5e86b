// Dark or light colours: those of the system, until the operator chooses.

import { element, loadSetting, saveSetting } from "./dom.js";
import { t } from "./text/language.js";

const KEY = "console.theme";
const system = matchMedia("(prefers-color-scheme: light)");
const listeners = [];

export const onTheme = (listener) => listeners.push(listener);
export const isLight = () => document.documentElement.dataset.theme === "light";

function apply() {
  document.documentElement.dataset.theme = loadSetting(KEY, system.matches ? "light" : "dark");
  const button = element("theme");
  button.textContent = isLight() ? "☾" : "☀";
  button.title = isLight() ? t("Dark colours (D)") : t("Light colours (D)");
  button.setAttribute("aria-label", isLight() ? t("Dark colours") : t("Light colours"));
  for (const listener of listeners) listener();
}

export function switchTheme() {
  saveSetting(KEY, isLight() ? "dark" : "light");
  apply();
}

system.addEventListener("change", apply);
element("theme").onclick = switchTheme;
apply();
