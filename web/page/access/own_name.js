// The name of this page for the other operators, on a console without users: that of browser and
// device, until the operator gives another. A cookie keeps it, so that every connection has it.

import { get } from "../core/link/api.js";
import { element, make } from "../core/dom.js";
import { t } from "../core/text/language.js";

const COOKIE = "bewarenav-name";
const MAX_NAME = 40;
const YEAR_S = 365 * 24 * 3600;
const BROWSERS = { Firefox: /Firefox/, Edge: /Edg/, Opera: /OPR/, Chrome: /Chrom/, Safari: /Safari/ };

function deviceName() {
  const { userAgent: agent, maxTouchPoints } = navigator;
  const browser = Object.keys(BROWSERS).find((name) => BROWSERS[name].test(agent)) ?? "Browser";
  const isTablet = /iPad|Tablet/.test(agent) || (maxTouchPoints > 1 && /Macintosh/.test(agent));
  const isPhone = !isTablet && /Mobile|iPhone/.test(agent);
  if (isPhone) return t("{browser} on phone", { browser });
  return isTablet || /Android/.test(agent)
    ? t("{browser} on tablet", { browser })
    : t("{browser} on computer", { browser });
}

function keep(name) {
  document.cookie = `${COOKIE}=${encodeURIComponent(name)}; path=/; max-age=${YEAR_S}; samesite=strict`;
}

// Before the first connection of the page.
if (!document.cookie.includes(`${COOKIE}=`)) keep(deviceName());

const input = make("input", {
  maxlength: MAX_NAME,
  required: "",
  "aria-label": t("Your name for the other operators"),
  "data-testid": "own-name-input",
});
const form = make("form", { class: "row", autocomplete: "off" }, input, make("button", {}, t("Save")));
const dialog = make("dialog", { class: "sheet", "aria-label": t("Your name") }, form);

form.onsubmit = (event) => {
  event.preventDefault();
  keep(input.value.trim() || deviceName());
  location.reload(); // every connection is made again, under the new name; control is kept
};

export async function start() {
  const you = await get("/me");
  if (you.logged_in) return;
  document.body.append(dialog);
  const open = () => {
    input.value = you.name;
    dialog.show();
    input.focus();
  };
  const title = t("Your name for the other operators");
  element("control-text").after(
    make(
      "button",
      { title, "aria-label": title, "data-testid": "own-name", onclick: open },
      "✎",
      make("span", {}, ` ${t("Name")}`), // hidden on a phone
    ),
  );
}
