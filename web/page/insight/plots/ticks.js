// Round numbers and times for the axes of charts.

import { decimal, number } from "../../core/text/language.js";

const MAX_STEPS = 4;

// Ticks that cover [low, high]: multiples of 1, 2 or 5 times a power of ten.
export function ticksOf(low, high) {
  const power = 10 ** Math.floor(Math.log10((high - low) / MAX_STEPS));
  const step = [1, 2, 5, 10].map((one) => one * power).find((one) => (high - low) / one <= MAX_STEPS);
  const first = Math.floor(low / step + 1e-9);
  const last = Math.ceil(high / step - 1e-9);
  return Array.from({ length: last - first + 1 }, (_, i) => (first + i) * step);
}

export const tickText = (value) =>
  Math.abs(value) >= 1000
    ? `${decimal(Number((value / 1000).toPrecision(3)))}k`
    : decimal(Number(value.toPrecision(3)));

export function durationText(seconds) {
  return seconds < 120 ? `${number(seconds, 0)} s` : `${number(seconds / 60, 1)} min`;
}
