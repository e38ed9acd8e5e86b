// The explanation of a path in words: what bends it, what each rule costs, what would open a path.

// Costs below this are not worth a word.
export const MIN_COST_M = 0.05;

export const metres = (value) => `${value.toFixed(1)} m`;
export const nameOf = (explained, key) =>
  explained.rules.find((rule) => rule.key === key)?.name ?? key;
export const listOf = (explained, keys) =>
  keys.map((key) => `“${nameOf(explained, key)}”`).join(" and ");

// `trial`: the path without some rules, `{ keys, answer }`, or null.
export function describe(explained, trial) {
  if (!explained.found) return trial ? difference(explained, trial) : refusal(explained);
  const length = `The path is ${metres(explained.length_m)} long`;
  return trial ? `${length}. ${difference(explained, trial)}` : `${length}; ${costs(explained)}.`;
}

// One sentence: the rules that make the path longer, and by how much.
function costs(explained) {
  const { main, main_cost_m: cost, all_cost_m: all } = explained;
  if (cost > MIN_COST_M)
    return `${listOf(explained, main)} ${main.length > 1 ? "make" : "makes"} it ${metres(cost)} longer`;
  return all === null ? "the cost of the rules is not known" : "no rule makes it longer";
}

function difference(explained, { keys, answer }) {
  const rules = listOf(explained, keys);
  if (!answer?.found) {
    const reason = answer?.reason ? `: ${answer.reason}` : "";
    return `Even without ${rules} there is no path${reason}.`;
  }
  const length = metres(answer.length_m);
  if (answer.difference_m === null) return `Without ${rules} there is a path of ${length}.`;
  const saved = -answer.difference_m;
  if (Math.abs(saved) < MIN_COST_M) return `Without ${rules} it would be as long.`;
  const change = `${metres(Math.abs(saved))} ${saved > 0 ? "shorter" : "longer"}`;
  return `Without ${rules} it would be ${change}: ${length}.`;
}

function refusal(explained) {
  const { lift, reason } = explained;
  const none = `There is no path (${reason})`;
  if (lift.keys?.length) {
    return `${none}. Without ${listOf(explained, lift.keys)} there is one; no smaller set of rules opens it.`;
  }
  if (lift.keys) return `${none}, though no rule blocks it.`;
  if (lift.exact)
    return `${none}, and removing zones and classes does not help: obstacles block every route.`;
  return `${none}. At least ${lift.at_least} rules would have to go; the search for the fewest was given up.`;
}
