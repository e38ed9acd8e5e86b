// The path that a draft or a goal would give, asked of the console while it is drawn.

import { post } from "../core/link/api.js";
import { formatSigned } from "../core/text/format.js";
import { number, sentence, t } from "../core/text/language.js";

const DELAY_MS = 180;
const MIN_UNSEEN_M = 0.5;
const MIN_CHANGE_M = 0.05;
const MIN_CHANGE_S = 0.5;

// Return what asks a route for the effect of a draft, once the draft has not changed for a moment;
// only the newest question is answered, with what `read` makes of the answer or `readRefusal` of the
// error; null says nothing. A question of `null` cancels.
export function asker(route, read, readRefusal = readWrong) {
  let timer = 0;
  let newest = 0;
  return (question, onAnswer) => {
    clearTimeout(timer);
    newest += 1;
    if (question === null) return;
    const asked = newest;
    timer = setTimeout(async () => {
      try {
        const answer = await post(route, question);
        if (asked === newest) onAnswer(read(answer, question));
      } catch (error) {
        const answer = asked === newest ? readRefusal(error) : null;
        if (answer) onAnswer(answer);
      }
    }, DELAY_MS);
  };
}

// Without a goal or a map there is nothing to preview; a draft that is wrong says why (422).
const readWrong = ({ status, message, body }) =>
  status === 422
    ? { text: message, bad: true, path: [], present: [], crossing: body?.crossing ?? null }
    : null;

export const readPreview = (answer, question) => ({
  ...verdict(answer, question),
  path: answer.path,
  present: answer.present?.path ?? [],
});
export const askPreview = asker("/preview", readPreview);

function verdict(answer, question) {
  if (!answer.found) {
    const zones = answer.cut_by.map((name) => `“${name}”`).join(", ");
    return {
      bad: true,
      text: zones
        ? t("the goal would be cut off by {zones}", { zones })
        : t("there would be no path: {reason}", { reason: sentence(answer.reason) }),
    };
  }
  if (question.goal)
    return {
      bad: false,
      text:
        t("{length}, about {time}", {
          length: formatSigned(answer.length_m, 1, "m"),
          time: formatSigned(answer.time_s, 0, "s"),
        }) + unseen(answer),
    };
  const length = t("the path would be {length} m, about {time} s", {
    length: number(answer.length_m, 1),
    time: number(answer.time_s, 0),
  });
  const change = answer.change_m === null ? "" : ` (${changeText(answer)})`;
  return { bad: false, text: length + change + unseen(answer) };
}

const unseen = ({ unseen_m: length }) =>
  length >= MIN_UNSEEN_M
    ? `; ${t("{length} m of it not seen yet", { length: number(length, 0) })}`
    : "";

// Small differences of two smoothed paths mean nothing.
function changesOf({ change_m: metres, change_s: seconds }) {
  const parts = [
    Math.abs(metres) >= MIN_CHANGE_M ? formatSigned(metres, 1, "m") : "",
    Math.abs(seconds) >= MIN_CHANGE_S ? formatSigned(seconds, 0, "s") : "",
  ];
  return parts.filter(Boolean).join(", ");
}
export const changeText = (answer) => changesOf(answer) || t("no difference");
export const isChange = (answer) => changesOf(answer) !== "";
