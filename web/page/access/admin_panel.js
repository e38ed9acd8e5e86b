// The admins' panel, with a tab for the users and one for the audit log. It lies below the header,
// so that the stop stays within reach while it is open.

import * as audit from "./audit.js";
import * as users from "./users.js";
import { element } from "../core/dom.js";

const panel = element("admin");
const button = element("admin-button");
const panes = { users: element("admin-users"), audit: element("admin-audit") };
let visitor = null;

// Called whenever the page hears who its visitor is.
export function showVisitor(you) {
  visitor = you;
  button.hidden = you.role !== "admin";
  if (button.hidden) panel.close();
}

export function togglePanel() {
  if (closePanel() || button.hidden) return;
  panel.show();
  selectPane(visitor.logged_in ? "users" : "audit");
}

// Returns whether it was open.
function closePanel() {
  if (!panel.open) return false;
  panel.close();
  button.focus();
  return true;
}

function selectPane(name) {
  for (const [key, pane] of Object.entries(panes)) {
    const tab = panel.querySelector(`[data-admin=${key}]`);
    tab.setAttribute("aria-selected", String(key === name));
    pane.hidden = key !== name;
    if (key === name) tab.focus();
  }
  if (name === "users") users.refresh(visitor.name);
  else audit.refresh();
}

users.build(panes.users);
audit.build(panes.audit);
button.onclick = togglePanel;
element("admin-close").onclick = closePanel;
for (const tab of panel.querySelectorAll("[data-admin]"))
  tab.onclick = () => selectPane(tab.dataset.admin);
