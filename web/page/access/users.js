// The list of users for admins: roles, passwords and tokens, a form for a new user.

import { get, post, request } from "../core/link/api.js";
import { sentence, t } from "../core/text/language.js";
import { suggestNames } from "./audit.js";
import { clearSent, make, reconcile, setText } from "../core/dom.js";
import { attempt, notify } from "../core/toasts.js";
import { askTwice } from "../core/twice.js";

const ROLES = {
  viewer: t("viewer: watches, and may stop the robot"),
  operator: t("operator: also drives and edits"),
  admin: t("admin: also manages users"),
};
const PASSWORD = {
  type: "password",
  minlength: 10,
  maxlength: 200,
  required: "",
  placeholder: t("10 characters or more"),
  autocomplete: "new-password",
};
const list = make("ul", { class: "list", "data-testid": "users" });
const note = make("p", { class: "empty", role: "status", "data-testid": "users-note" });
const form = make("form", { class: "row", autocomplete: "off" });
let ownName = null;

export async function refresh(name = ownName) {
  ownName = name;
  try {
    const users = await get("/users");
    reconcile(list, users, (user) => user.name, itemOf, fill);
    suggestNames(users.map((user) => user.name));
    note.textContent =
      t("A user whose role or password changes, or who is removed, is logged out at once.");
    form.hidden = false;
  } catch (error) {
    // An admin who changes their own password, role or account loses the session.
    if (error.status === 401) location.reload();
    list.replaceChildren();
    note.textContent = error.message;
    form.hidden = true;
  }
}

// Change a user, show a refusal, and show all users as they are now.
const change = (action) => attempt(action).finally(() => refresh());

function itemOf(user) {
  const path = `/users/${encodeURIComponent(user.name)}`;
  const role = roleChoice(t("Role of {name}", user));
  role.onchange = () => change(() => request("PUT", `${path}/role`, { role: role.value }));
  const name = user.name === ownName ? t("{name} (you)", user) : user.name;
  const label = make("span", { class: "label" }, make("span", {}, name), make("small"));
  const { open, passwordForm } = passwordParts(user, path);
  const { button, shown } = tokenParts(path);
  return make(
    "li",
    { "data-testid": "user", "data-name": user.name },
    label,
    role,
    open,
    button,
    removeButton(user, path),
    passwordForm,
    shown,
  );
}

function passwordParts(user, path) {
  const field = make("input", {
    ...PASSWORD,
    "aria-label": t("New password of {name}", user),
    "data-testid": "user-password",
  });
  const save = make("button", { class: "primary", "data-testid": "user-password-save" }, t("Save"));
  const passwordForm = make("form", { class: "row", hidden: "" }, field, save);
  passwordForm.onsubmit = (event) => {
    event.preventDefault();
    change(async () => {
      await request("PUT", `${path}/password`, { password: field.value });
      passwordForm.reset();
      passwordForm.hidden = true;
      notify(t("The password of {name} is changed.", user), { good: true });
    });
  };
  const toggle = () => {
    passwordForm.hidden = !passwordForm.hidden;
    if (!passwordForm.hidden) field.focus();
  };
  return {
    open: make("button", { "data-testid": "user-password-open", onclick: toggle }, t("Password …")),
    passwordForm,
  };
}

function tokenParts(path) {
  const shown = make("output", { class: "token", hidden: "", "data-testid": "user-token" });
  const renew = () =>
    change(async () => {
      const { token } = await post(`${path}/token`);
      shown.replaceChildren(t("Shown only once: "), make("code", {}, token));
      shown.hidden = false;
    });
  const title = t("A new token for programs of this user; it replaces the previous one");
  return {
    button: make("button", { title, "data-testid": "user-token-make", onclick: renew }, t("Token …")),
    shown,
  };
}

function removeButton(user, path) {
  const button = make(
    "button",
    { "aria-label": t("Remove {name}", user), "data-testid": "user-remove" },
    t("Remove"),
  );
  askTwice(button, t("Really remove?"), () => {
    change(() => request("DELETE", path));
    document.querySelector("[data-admin=users]").focus();
  });
  return button;
}

function fill(item, user) {
  item.querySelector("select").value = user.role;
  setText(item.querySelector("small"), user.has_token ? t("has a token for programs") : "");
}

function roleChoice(label) {
  const options = Object.keys(ROLES).map((name) =>
    make("option", { value: name, title: ROLES[name] }, sentence(name)),
  );
  return make("select", { "aria-label": label, "data-testid": "user-role" }, ...options);
}

export function build(pane) {
  const name = make("input", {
    required: "",
    maxlength: 40,
    pattern: "[A-Za-z0-9][A-Za-z0-9_.@\\-]*",
    title: t("letters, digits, dots, dashes, @ or _"),
    autocomplete: "off",
    "data-testid": "new-user-name",
  });
  const password = make("input", { ...PASSWORD, "data-testid": "new-user-password" });
  const role = roleChoice(t("Role"));
  role.value = "operator";
  role.dataset.testid = "new-user-role";
  form.append(
    make("label", { class: "field" }, t("Name"), name),
    make("label", { class: "field" }, t("Password"), password),
    make("label", { class: "field" }, t("Role"), role),
    make("button", { class: "primary", "data-testid": "new-user-add" }, t("Add user")),
  );
  form.onsubmit = (event) => {
    event.preventDefault();
    const user = { name: name.value, password: password.value, role: role.value };
    change(async () => {
      await post("/users", user);
      clearSent(name, user.name);
      clearSent(password, user.password);
      role.value = "operator";
      name.focus();
    });
  };
  const roles = make(
    "ul",
    { class: "roles" },
    ...Object.values(ROLES).map((words) => make("li", {}, words)),
  );
  pane.append(list, note, form, roles);
}
