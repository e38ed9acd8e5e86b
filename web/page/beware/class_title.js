// What the page calls a class of the beware list: the label that an operator gave it, else its name,
// which is translated if it came with the program.

import { named } from "../core/text/language.js";

export const classTitle = ({ label, name }) => label ?? named(name);
