// The classes that can be marked: those of the beware list, and what is none of them.

import { get, post, setSite } from "../core/link/api.js";
import { clearSent, element, make } from "../core/dom.js";
import { t } from "../core/text/language.js";
import { attempt } from "../core/toasts.js";

export const NOTHING = "background";
const HUE_STEP = 137;
const select = element("class");
let names = [NOTHING];

export const classNames = () => names;
export const selectedName = () => select.value || NOTHING;

// The number of a class, which is appended if it is new: marks keep their meaning.
export function labelOf(name) {
  const folded = names.map((known) => known.toLowerCase());
  if (!folded.includes(name.toLowerCase())) {
    names = [...names, name];
    return names.length;
  }
  return folded.indexOf(name.toLowerCase()) + 1;
}

// The colour of a class as one 32-bit pixel (ABGR, as a canvas has it).
export function colourOf(name, index = names.indexOf(name)) {
  if (name === NOTHING) return 0xff_70_70_70;
  const channel = (shift) => {
    const k = (shift + ((index * HUE_STEP) % 360) / 30) % 12;
    return Math.round(255 * (0.5 - 0.5 * Math.max(-1, Math.min(k - 3, 9 - k, 1))));
  };
  return ((255 << 24) | (channel(4) << 16) | (channel(8) << 8) | channel(0)) >>> 0;
}

// Read the beware list; a class that was chosen stays chosen.
export async function loadClasses(chosen = select.value) {
  const [{ classes }, { site_id }] = await Promise.all([get("/beware"), get("/state")]);
  setSite(site_id);
  const listed = classes.map((entry) => entry.network_class ?? entry.name);
  listed.forEach(labelOf);
  const options = [...listed, NOTHING].map((name) =>
    make("option", { value: name }, name === NOTHING ? t("nothing to beware of") : name),
  );
  select.replaceChildren(...options);
  select.value = listed.includes(chosen) ? chosen : (listed.at(-1) ?? NOTHING);
}

export function chooseClass(index) {
  if (index < select.options.length) select.selectedIndex = index;
}

element("new-class").onsubmit = (event) => {
  event.preventDefault();
  const input = element("new-name");
  const name = input.value.trim();
  if (!name) return;
  attempt(async () => {
    try {
      await post("/beware", { name });
    } catch (error) {
      if (error.code === "other_site") await loadClasses(); // the list is that of the new site
      throw error;
    }
    clearSent(input, input.value);
    await loadClasses(name);
  });
};
