// For admins: who may log in. The panel lies below the bar, so that the stop stays within reach while it is open.

import { get, post, request } from "../core/api.js";
import * as audit from "./audit.js";
import { element, make, reconcile, setText, spent } from "../core/dom.js";
import { attempt, say } from "../core/toasts.js";

const ROLES = { viewer: "viewer: looks, and stops", operator: "operator: drives and edits as well", admin: "admin: decides on users as well" };
const SURE_MS = 4000;
const panel = element("house");
const button = element("house-button");
const list = make("ul", { class: "list", "data-testid": "users" });
const note = make("p", { class: "empty", role: "status", "data-testid": "users-note" });
const form = make("form", { class: "row", autocomplete: "off" });
const tabs = { users: element("house-users"), audit: element("house-audit") };
let me = null;

// Called whenever the page hears who it is.
export function show(you) {
  me = you;
  button.hidden = you.role !== "admin";
  if (button.hidden) panel.close();
}

export function togglePanel() {
  if (closePanel() || button.hidden) return;
  panel.show();
  turnTo(me.logged_in ? "users" : "audit");
}

// Whether it was open.
function closePanel() {
  if (!panel.open) return false;
  panel.close();
  button.focus();
  return true;
}

function turnTo(name) {
  for (const [key, pane] of Object.entries(tabs)) {
    const tab = panel.querySelector(`[data-house=${key}]`);
    tab.setAttribute("aria-selected", String(key === name));
    pane.hidden = key !== name;
    if (key === name) tab.focus();
  }
  if (name === "users") refresh();
  else audit.refresh();
}

async function refresh() {
  try {
    const users = await get("/users");
    reconcile(list, users, (user) => user.name, row, fill);
    audit.name(users.map((user) => user.name));
    note.textContent = "Whoever gets another role or password, or goes, is logged out at once.";
    form.hidden = false;
  } catch (error) {
    // One's own session ends with one's own password, role or account.
    if (error.status === 401) location.reload();
    list.replaceChildren();
    note.textContent = error.message;
    form.hidden = true;
  }
}

// Does something to a user, says what came of it, and shows everybody as they are now.
const act = (action) => attempt(action).finally(refresh);

function row(user) {
  const path = `/users/${encodeURIComponent(user.name)}`;
  const role = roles(`Role of ${user.name}`);
  role.onchange = () => act(() => request("PUT", `${path}/role`, { role: role.value }));
  const secret = make("input", { type: "password", minlength: 10, maxlength: 200, required: "", placeholder: "10 characters or more", "aria-label": `New password of ${user.name}`, autocomplete: "new-password", "data-testid": "user-password" });
  const renew = make("form", { class: "row", hidden: "" }, secret, make("button", { class: "primary", "data-testid": "user-password-save" }, "Save"));
  renew.onsubmit = (event) => {
    event.preventDefault();
    act(async () => { await request("PUT", `${path}/password`, { password: secret.value }); renew.reset(); renew.hidden = true; say(`${user.name} has a new password.`, { good: true }); });
  };
  const ask = make("button", { "data-testid": "user-password-open", onclick: () => { renew.hidden = !renew.hidden; if (!renew.hidden) secret.focus(); } }, "Password …");
  const shown = make("output", { class: "token", hidden: "", "data-testid": "user-token" });
  const program = make("button", { title: "A new token for programs that act in this name; the one before it is void", "data-testid": "user-token-make" }, "Token …");
  program.onclick = () => act(async () => {
    const { token } = await post(`${path}/token`);
    shown.replaceChildren("Shown this once: ", make("code", {}, token));
    shown.hidden = false;
  });
  const who = make("span", { class: "label" }, make("span", {}, user.name === me.name ? `${user.name} (you)` : user.name), make("small"));
  const remove = make("button", { "aria-label": `Remove ${user.name}`, "data-testid": "user-remove" }, "Remove");
  remove.onclick = () => {
    if (remove.classList.contains("sure")) { act(() => request("DELETE", path)); panel.querySelector("[data-house=users]").focus(); return; }
    remove.classList.add("sure");
    remove.textContent = "Really remove?";
    setTimeout(() => { remove.classList.remove("sure"); remove.textContent = "Remove"; }, SURE_MS);
  };
  return make("li", { "data-testid": "user", "data-name": user.name }, who, role, ask, program, remove, renew, shown);
}

// What may have changed of a user.
function fill(item, user) {
  item.querySelector("select").value = user.role;
  setText(item.querySelector("small"), user.has_token ? "a program may act in this name" : "");
}

function roles(label) {
  const choice = make("select", { "aria-label": label, "data-testid": "user-role" }, ...Object.keys(ROLES).map((name) => make("option", { value: name, title: ROLES[name] }, name)));
  return choice;
}

function build() {
  const name = make("input", { required: "", maxlength: 40, pattern: "[A-Za-z0-9][A-Za-z0-9_.@\\-]*", title: "letters, digits, dots, dashes, @ or _", autocomplete: "off", "data-testid": "new-user-name" });
  const secret = make("input", { type: "password", required: "", minlength: 10, maxlength: 200, placeholder: "10 characters or more", autocomplete: "new-password", "data-testid": "new-user-password" });
  const role = roles("Role");
  role.value = "operator";
  role.dataset.testid = "new-user-role";
  form.append(
    make("label", { class: "field" }, "Name", name), make("label", { class: "field" }, "Password", secret),
    make("label", { class: "field" }, "Role", role), make("button", { class: "primary", "data-testid": "new-user-add" }, "Add user"),
  );
  form.onsubmit = (event) => {
    event.preventDefault();
    const asked = { name: name.value, password: secret.value, role: role.value };
    act(async () => { await post("/users", asked); spent(name, asked.name); spent(secret, asked.password); role.value = "operator"; name.focus(); });
  };
  const means = make("ul", { class: "means" }, ...Object.values(ROLES).map((words) => make("li", {}, words)));
  tabs.users.append(list, note, form, means);
  audit.build(tabs.audit);
}

build();
button.onclick = togglePanel;
element("house-close").onclick = closePanel;
for (const tab of panel.querySelectorAll("[data-house]")) tab.onclick = () => turnTo(tab.dataset.house);
