// A point or a pose as it is typed: x, y in metres and the heading in degrees.

import { t, typedNumbers } from "./language.js";

// Return [x, y].
export function typedPoint(typed) {
  const numbers = typedNumbers(typed);
  if (numbers.length !== 2 || !numbers.every(Number.isFinite))
    throw new Error(t("“{typed}” is no point; write x, y in metres", { typed }));
  return numbers;
}

// Return { x_m, y_m, yaw_rad }; the heading is null where none is typed and none is needed.
export function typedPose(typed, { needsHeading = false } = {}) {
  const numbers = typedNumbers(typed);
  const isPose = numbers.length === 3 || (numbers.length === 2 && !needsHeading);
  if (!isPose || !numbers.every(Number.isFinite))
    throw new Error(
      needsHeading
        ? t("“{typed}” is no place; write x, y in metres and the heading in degrees", { typed })
        : t("“{typed}” is no goal; write x, y in metres and, if it matters, the heading in degrees", {
            typed,
          }),
    );
  const [x, y, degrees = null] = numbers;
  if (Math.abs(degrees) > 360)
    throw new Error(t("A heading of {degrees}° is out of range: −360° to 360°", { degrees }));
  return { x_m: x, y_m: y, yaw_rad: degrees === null ? null : (degrees * Math.PI) / 180 };
}
