// Entries of the event log that say the same again, and how much each matters.

import { number, t } from "../core/text/language.js";

const FOLDED_WITHIN_S = 30;
const FOLDED_OVER_ROWS = 6;
// Levels of the log, the least first.
export const LEVELS = ["detail", "notice", "alert"];
const LEVEL_OF_KIND = {
  stopped: "alert",
  goal: "notice",
  mission: "notice",
  zone: "notice",
  beware: "notice",
};
// A robot that is held for want of images or decisions is reported in the status line.
const LATE = /\b(image|picture|frame|command|decision)\b.* s old/i;
const NUMBERS = /\d+(?:[.,]\d+)?/g;

export function levelOf({ kind, text }) {
  if (LATE.test(text)) return "detail";
  return LEVEL_OF_KIND[kind] ?? "detail";
}

// Entries of one start with the same kind and the same words are alike: whatever the figures, but
// for what matters, in which a figure tells one goal or zone from another.
export const keyOf = ({ kind, text, start }) =>
  `${start} ${kind} ${LEVEL_OF_KIND[kind] === "notice" ? text : text.replace(NUMBERS, "#")}`;

// The row among the nearest ones that already says what the entry says, or undefined. `rows` are
// items with `folded`: { key, first, last, count }, times in seconds, nearest first.
export function rowFor(entry, rows) {
  const key = keyOf(entry);
  return rows.slice(0, FOLDED_OVER_ROWS).find(({ folded }) => {
    const gap = Math.max(folded.first - entry.unix_s, entry.unix_s - folded.last, 0);
    return folded.key === key && gap <= FOLDED_WITHIN_S;
  });
}

export const newFold = (entry) => ({
  key: keyOf(entry),
  first: entry.unix_s,
  last: entry.unix_s,
  count: 1,
});

export function fold(folded, entry) {
  folded.count += 1;
  folded.first = Math.min(folded.first, entry.unix_s);
  folded.last = Math.max(folded.last, entry.unix_s);
}

export function countText({ count, first, last }) {
  if (count === 1) return "";
  const seconds = last - first;
  const time =
    seconds < 90 ? `${number(Math.max(seconds, 1), 0)} s` : `${number(seconds / 60, 0)} min`;
  return t("× {count} in {time}", { count, time });
}
