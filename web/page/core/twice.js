// A button for what cannot be taken back: it asks once more.

import { setText } from "./dom.js";

const CONFIRM_MS = 4000;

export function askTwice(button, question, act) {
  const label = button.textContent;
  let timer = null;
  const ask = (asks) => {
    clearTimeout(timer);
    button.classList.toggle("confirm", asks);
    setText(button, asks ? question : label);
    if (asks) timer = setTimeout(() => ask(false), CONFIRM_MS);
  };
  button.onclick = () => {
    const sure = button.classList.contains("confirm");
    ask(!sure);
    if (sure) act();
  };
}
