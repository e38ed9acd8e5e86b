// Dark or light: as the system has it, until the operator says otherwise.

import { element, remember, remembered } from "./dom.js";

const KEY = "console.theme";
const system = matchMedia("(prefers-color-scheme: light)");
const watchers = [];

export const onTheme = (watcher) => watchers.push(watcher);
export const isLight = () => document.documentElement.dataset.theme === "light";

function apply() {
  document.documentElement.dataset.theme = remembered(KEY, system.matches ? "light" : "dark");
  const button = element("theme");
  button.textContent = isLight() ? "☾" : "☀";
  button.setAttribute("aria-label", isLight() ? "Dark colours" : "Light colours");
  button.title = button.getAttribute("aria-label");
  for (const watcher of watchers) watcher();
}

export function switchTheme() { remember(KEY, isLight() ? "dark" : "light"); apply(); }

system.addEventListener("change", apply);
element("theme").onclick = switchTheme;
apply();
