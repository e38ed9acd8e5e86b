// What was refused, in words, until it is read.

const box = document.getElementById("toasts");

// `action`: what the operator can do about it with one click, `{label, act}`.
export function say(text, { good = false, action = null } = {}) {
  for (const old of box.children) if (old.dataset.text === text) old.remove();
  const toast = document.createElement("div");
  toast.className = good ? "toast done" : "toast";
  toast.dataset.text = text;
  const mark = document.createElement("b");
  mark.textContent = good ? "✓" : "!";
  const words = document.createElement("span");
  words.textContent = text;
  const close = document.createElement("button");
  close.textContent = "✕";
  close.setAttribute("aria-label", "Dismiss");
  close.onclick = () => toast.remove();
  toast.append(mark, words, ...(action ? [remedy(action, toast)] : []), close);
  box.append(toast);
  while (box.children.length > 4) box.firstChild.remove();
  setTimeout(() => toast.remove(), good ? 2500 : 9000);
}

function remedy({ label, act }, toast) {
  const button = document.createElement("button");
  button.textContent = label;
  button.dataset.testid = "remedy";
  button.onclick = () => { toast.remove(); act(); };
  return button;
}

// Run an action of the operator; a refusal is shown, never swallowed.
export async function attempt(action) {
  try {
    return await action();
  } catch (error) {
    say(error.message);
    return undefined;
  }
}
