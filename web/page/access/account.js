// The dialog in which users change their own password. Not modal: the stop stays within reach.

import { request } from "../core/link/api.js";
import { element } from "../core/dom.js";
import { attempt } from "../core/toasts.js";

const dialog = element("account");
const form = element("account-form");

element("account-button").onclick = () => {
  form.reset();
  dialog.show();
  element("account-present").focus();
};
element("account-close").onclick = () => dialog.close();
form.onsubmit = (event) => {
  event.preventDefault();
  attempt(async () => {
    await request("PUT", "/me/password", {
      present: element("account-present").value,
      password: element("account-new").value,
    });
    location.reload(); // every session of this user has ended
  });
};
