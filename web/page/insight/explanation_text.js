// The explanation of a path in words: what bends it, what each rule costs, what would open a path.

import { named, number, sentence, t, tn } from "../core/text/language.js";

// Costs below this are not worth a word.
export const MIN_COST_M = 0.05;

export const metres = (value) => `${number(value, 1)} m`;
// The name of a zone stays as it was given, whatever its words.
export function titleOf({ key, name }) {
  if (key === "wall") return t("obstacles");
  return key.startsWith("class:") ? named(name) : name;
}
export function nameOf(explained, key) {
  const rule = explained.rules.find((one) => one.key === key);
  return rule ? titleOf(rule) : key;
}
export const listOf = (explained, keys) =>
  keys.map((key) => `“${nameOf(explained, key)}”`).join(t(" and "));

// `trial`: the path without some rules, `{ keys, answer }`, or null.
export function describe(explained, trial) {
  if (!explained.found) return trial ? difference(explained, trial) : refusal(explained);
  const length = metres(explained.length_m);
  return trial
    ? `${t("The path is {length} long.", { length })} ${difference(explained, trial)}`
    : t("The path is {length} long; {costs}.", { length, costs: costs(explained) });
}

// One sentence: the rules that make the path longer, and by how much.
function costs(explained) {
  const { main, main_cost_m: cost, all_cost_m: all } = explained;
  const values = { rules: listOf(explained, main), length: metres(cost ?? 0) };
  if (cost > MIN_COST_M)
    return tn("{rules} makes it {length} longer", "{rules} make it {length} longer", main.length, values);
  return all === null ? t("the cost of the rules is not known") : t("no rule makes it longer");
}

function difference(explained, { keys, answer }) {
  const rules = listOf(explained, keys);
  if (!answer?.found)
    return answer?.reason
      ? t("Even without {rules} there is no path: {reason}.", {
          rules,
          reason: sentence(answer.reason),
        })
      : t("Even without {rules} there is no path.", { rules });
  const length = metres(answer.length_m);
  if (answer.difference_m === null)
    return t("Without {rules} there is a path of {length}.", { rules, length });
  const saved = -answer.difference_m;
  if (Math.abs(saved) < MIN_COST_M) return t("Without {rules} it would be as long.", { rules });
  const values = { rules, length, change: metres(Math.abs(saved)) };
  return saved > 0
    ? t("Without {rules} it would be {change} shorter: {length}.", values)
    : t("Without {rules} it would be {change} longer: {length}.", values);
}

function refusal(explained) {
  const { lift } = explained;
  const reason = sentence(explained.reason);
  const least = lift.at_least;
  if (lift.keys?.length)
    return t(
      "There is no path ({reason}). Without {rules} there is one; no smaller set of rules opens it.",
      { reason, rules: listOf(explained, lift.keys) },
    );
  if (lift.keys) return t("There is no path ({reason}), though no rule blocks it.", { reason });
  if (lift.exact)
    return t(
      "There is no path ({reason}), and removing zones and classes does not help: obstacles block every route.",
      { reason },
    );
  return t(
    "There is no path ({reason}). At least {least} rules would have to go; the search for the fewest was given up.",
    { reason, least },
  );
}
