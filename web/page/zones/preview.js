// What a draft would do to the path, asked of the console while it is drawn; nothing is applied.

import { post } from "../core/api.js";

const AFTER_MS = 180;
let timer = 0;
let asked = 0;

// Ask once the draft has rested for a moment; only the newest question is answered. `null` asks nothing more.
export function ask(question, answered) {
  clearTimeout(timer);
  asked += 1;
  if (question === null) return;
  const number = asked;
  timer = setTimeout(async () => {
    try {
      const answer = await post("/preview", question);
      if (number === asked) answered({ ...told(answer, question), path: answer.path, present: answer.present?.path ?? [] });
    } catch (error) {
      // Without a goal or a map there is no path to speak of; a draft that is no zone yet says why.
      if (number === asked && error.status === 422) answered({ text: error.message, bad: true, path: [], present: [] });
    }
  }, AFTER_MS);
}

export const signed = (value, digits, unit) => `${value >= 0 ? "+" : "−"}${Math.abs(value).toFixed(digits)} ${unit}`;

function told(answer, question) {
  if (!answer.found) {
    const who = answer.cut_by.map((name) => `“${name}”`).join(", ");
    return { bad: true, text: who ? `the goal would be cut off by ${who}` : `there would be no path: ${answer.reason}` };
  }
  const length = `${answer.length_m.toFixed(1)} m, about ${answer.time_s.toFixed(0)} s`;
  if (question.goal) return { bad: false, text: `${signed(answer.length_m, 1, "m")}, about ${signed(answer.time_s, 0, "s")}` };
  const change = answer.change_m === null ? "" : ` (${signed(answer.change_m, 1, "m")}, ${signed(answer.change_s, 0, "s")})`;
  return { bad: false, text: `the path would be ${length}${change}` };
}
