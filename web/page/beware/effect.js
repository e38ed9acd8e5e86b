// What an edit of the beware list would do: asked of the console, told in words, shown on the map.

import { number, t, tn } from "../core/text/language.js";
import { asker, changeText, isChange } from "../zones/preview.js";

const NOTHING = { appear: [], go: [], path: [] };
const WITHOUT_MAP = 409;

// What the map shows of an edit that is not applied.
export const listDraft = { ...NOTHING };
const listeners = [];
export const onListDraft = (listener) => listeners.push(listener);

export function showOnMap({ appear, go, path } = NOTHING) {
  Object.assign(listDraft, { appear, go, path });
  for (const listener of listeners) listener();
}

// Return what asks for the effect of an edit; see `asker`.
export const effectAsker = () => asker("/beware/preview", read, readRefusal);

const isOpened = ({ path, present }) => Boolean(path?.found && !present.found);

// The effect in words. What makes the map emptier comes first, with a sign: it is less safe.
function read(answer) {
  const { appear_count: appear, go_count: go, nearer_count: nearer, cut_off: cutOff } = answer;
  const parts = [];
  if (go)
    parts.push(
      tn(
        "▲ {n} cell goes, and the robot may drive there",
        "▲ {n} cells go, and the robot may drive there",
        go,
      ),
    );
  if (nearer)
    parts.push(
      tn("▲ the robot may come nearer to {n} cell", "▲ the robot may come nearer to {n} cells", nearer),
    );
  if (appear) parts.push(tn("{n} cell appears", "{n} cells appear", appear));
  if (!parts.length) parts.push(t("no cell of the map changes"));
  if (cutOff.length) parts.push(t("{goals} would be cut off", { goals: cutOff.join(", ") }));
  else if (answer.path?.found)
    parts.push(
      t("the path would be {length} m ({change})", {
        length: number(answer.path.length_m, 1),
        change: isOpened(answer) ? t("there is none now") : changeText(answer),
      }),
    );
  return {
    text: parts.join("; "),
    bad: cutOff.length > 0,
    isNothing: !(go || nearer || appear || cutOff.length || isOpened(answer) || isChange(answer)),
    changes: answer.changes,
    path: answer.path?.path ?? [],
    appear: answer.appear,
    go: answer.go,
  };
}

// Without a map an edit can be applied, but not tried; any other refusal is one of the edit.
function readRefusal({ status, message }) {
  const isRefused = status !== WITHOUT_MAP;
  const text = isRefused
    ? message
    : t("{reason}. What the edit would change cannot be shown.", { reason: message });
  return { ...NOTHING, text, isRefused, bad: isRefused, changes: [] };
}
