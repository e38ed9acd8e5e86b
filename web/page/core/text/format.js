// Numbers, times and durations as text in the language of the page.

import { language, number } from "./language.js";

export const formatNumber = (value, digits, unit) =>
  value === null || value === undefined ? "–" : `${number(value, digits)} ${unit}`.trim();
export const formatTime = (unixS) =>
  new Date(1000 * unixS).toLocaleTimeString(language, { hour12: false });
// The month in letters: in figures it could be the day.
export const formatDate = (time) => time.toLocaleDateString(language, { dateStyle: "medium" });
export const formatDateTime = (time) =>
  time.toLocaleString(language, { dateStyle: "medium", timeStyle: "medium", hour12: false });
export const formatSigned = (value, digits, unit) =>
  `${value >= 0 ? "+" : "−"}${number(Math.abs(value), digits)} ${unit}`;

// About two significant digits.
export function formatAge(seconds) {
  if (seconds < 9.95) return `${number(seconds, 1)} s`;
  if (seconds < 90) return `${number(seconds, 0)} s`;
  return seconds < 5400 ? `${number(seconds / 60, 0)} min` : `${number(seconds / 3600, 1)} h`;
}
