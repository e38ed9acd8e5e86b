// A button for what cannot be taken back: it asks once more, until another key is pressed or the
// focus goes elsewhere. There is no time limit: one person reads slower than another.

import { setText } from "./dom.js";

export function askTwice(button, question, act) {
  const [label, name] = [button.textContent, button.ariaLabel];
  const ask = (asks) => {
    button.classList.toggle("confirm", asks);
    setText(button, asks ? question : label);
    if (name) button.ariaLabel = asks ? question : name;
  };
  button.onclick = () => {
    const sure = button.classList.contains("confirm");
    ask(!sure);
    if (sure) act();
    else button.focus(); // which a click does not do in every browser
  };
  button.onblur = () => ask(false);
  button.onkeydown = ({ key }) => {
    if (key !== "Enter") ask(false);
  };
}
