// Numbers, times and durations as text in the language of the page.

import { language, number } from "./language.js";

export const formatNumber = (value, digits, unit) =>
  value === null || value === undefined ? "–" : `${number(value, digits)} ${unit}`.trim();
const CLOCK = { hourCycle: "h23" }; // without it five past midnight is 24:05 in English
export const formatTime = (unixS) => new Date(1000 * unixS).toLocaleTimeString(language, CLOCK);
// The month in letters: in figures it could be the day.
export const formatDate = (time) => time.toLocaleDateString(language, { dateStyle: "medium" });
export const formatDateTime = (time) =>
  time.toLocaleString(language, { dateStyle: "medium", timeStyle: "medium", ...CLOCK });
const isToday = (time) => time.toDateString() === new Date().toDateString();
// With the date only where it is not today's.
export function formatMoment(unixS) {
  const time = new Date(1000 * unixS);
  return isToday(time) ? formatTime(unixS) : formatDateTime(time);
}
// The same in few letters, for what is near.
export function formatShortMoment(unixS) {
  const time = new Date(1000 * unixS);
  const day = isToday(time) ? {} : { month: "short", day: "numeric" };
  return time.toLocaleString(language, { ...day, hour: "2-digit", minute: "2-digit", ...CLOCK });
}
export const formatSigned = (value, digits, unit) =>
  `${value >= 0 ? "+" : "−"}${number(Math.abs(value), digits)} ${unit}`;

// About two significant digits.
export function formatAge(seconds) {
  if (seconds < 9.95) return `${number(seconds, 1)} s`;
  if (seconds < 90) return `${number(seconds, 0)} s`;
  return seconds < 5400 ? `${number(seconds / 60, 0)} min` : `${number(seconds / 3600, 1)} h`;
}
