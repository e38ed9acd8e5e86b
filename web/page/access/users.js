// The list of users for admins: roles, passwords and tokens, a form for a new user.

import { get, post, request } from "../core/api.js";
import { suggestNames } from "./audit.js";
import { clearSent, make, reconcile, setText } from "../core/dom.js";
import { attempt, notify } from "../core/toasts.js";

const ROLES = {
  viewer: "viewer: watches, and may stop the robot",
  operator: "operator: also drives and edits",
  admin: "admin: also manages users",
};
const CONFIRM_MS = 4000;
const PASSWORD = {
  type: "password",
  minlength: 10,
  maxlength: 200,
  required: "",
  placeholder: "10 characters or more",
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
      "A user whose role or password changes, or who is removed, is logged out at once.";
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
  const role = roleChoice(`Role of ${user.name}`);
  role.onchange = () => change(() => request("PUT", `${path}/role`, { role: role.value }));
  const name = user.name === ownName ? `${user.name} (you)` : user.name;
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
    "aria-label": `New password of ${user.name}`,
    "data-testid": "user-password",
  });
  const save = make("button", { class: "primary", "data-testid": "user-password-save" }, "Save");
  const passwordForm = make("form", { class: "row", hidden: "" }, field, save);
  passwordForm.onsubmit = (event) => {
    event.preventDefault();
    change(async () => {
      await request("PUT", `${path}/password`, { password: field.value });
      passwordForm.reset();
      passwordForm.hidden = true;
      notify(`${user.name} has a new password.`, { good: true });
    });
  };
  const toggle = () => {
    passwordForm.hidden = !passwordForm.hidden;
    if (!passwordForm.hidden) field.focus();
  };
  return {
    open: make("button", { "data-testid": "user-password-open", onclick: toggle }, "Password …"),
    passwordForm,
  };
}

function tokenParts(path) {
  const shown = make("output", { class: "token", hidden: "", "data-testid": "user-token" });
  const renew = () =>
    change(async () => {
      const { token } = await post(`${path}/token`);
      shown.replaceChildren("Shown only once: ", make("code", {}, token));
      shown.hidden = false;
    });
  const title = "A new token for programs of this user; it replaces the previous one";
  return {
    button: make("button", { title, "data-testid": "user-token-make", onclick: renew }, "Token …"),
    shown,
  };
}

function removeButton(user, path) {
  const button = make(
    "button",
    { "aria-label": `Remove ${user.name}`, "data-testid": "user-remove" },
    "Remove",
  );
  button.onclick = () => {
    if (button.classList.contains("confirm")) {
      change(() => request("DELETE", path));
      document.querySelector("[data-admin=users]").focus();
      return;
    }
    button.classList.add("confirm");
    button.textContent = "Really remove?";
    setTimeout(() => {
      button.classList.remove("confirm");
      button.textContent = "Remove";
    }, CONFIRM_MS);
  };
  return button;
}

function fill(item, user) {
  item.querySelector("select").value = user.role;
  setText(item.querySelector("small"), user.has_token ? "has a token for programs" : "");
}

function roleChoice(label) {
  const options = Object.keys(ROLES).map((name) =>
    make("option", { value: name, title: ROLES[name] }, name),
  );
  return make("select", { "aria-label": label, "data-testid": "user-role" }, ...options);
}

export function build(pane) {
  const name = make("input", {
    required: "",
    maxlength: 40,
    pattern: "[A-Za-z0-9][A-Za-z0-9_.@\\-]*",
    title: "letters, digits, dots, dashes, @ or _",
    autocomplete: "off",
    "data-testid": "new-user-name",
  });
  const password = make("input", { ...PASSWORD, "data-testid": "new-user-password" });
  const role = roleChoice("Role");
  role.value = "operator";
  role.dataset.testid = "new-user-role";
  form.append(
    make("label", { class: "field" }, "Name", name),
    make("label", { class: "field" }, "Password", password),
    make("label", { class: "field" }, "Role", role),
    make("button", { class: "primary", "data-testid": "new-user-add" }, "Add user"),
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
