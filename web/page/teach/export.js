// The link that exports all images: what the archive holds, or why it cannot be had.

import { get } from "../core/link/api.js";
import { element, set } from "../core/dom.js";
import { t } from "../core/text/language.js";

const ADDRESS = "/api/v1/teach/frames.zip";
let role = "";

export async function loadRole() {
  ({ role } = await get("/me"));
}

export function refreshExport(frames) {
  const link = element("frames-export");
  const refused = !frames.length ? t("No image yet") : role === "viewer" ? t("Viewers cannot export the images") : "";
  const names = [...new Set(frames.flatMap((frame) => frame.class_names))].join(", ");
  const held = names
    ? t("All images, with the classes that are marked in them: {names}", { names })
    : t("All images, with no class: nothing is marked yet");
  set(link, { title: refused || held, ariaDisabled: String(Boolean(refused)) });
  if (refused) link.removeAttribute("href");
  else link.setAttribute("href", ADDRESS);
}
