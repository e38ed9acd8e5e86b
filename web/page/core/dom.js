// Small pieces that every list of the page is made of.

export const element = (id) => document.getElementById(id);

export function make(tag, attributes = {}, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) node[name] = value;
    else if (value !== undefined && value !== null) node.setAttribute(name, value);
  }
  node.append(...children);
  return node;
}

// Keep one child per key, in order; `refresh` sets what may have changed. What the operator types in stays.
export function reconcile(list, items, keyOf, create, refresh) {
  const old = new Map([...list.children].map((child) => [child.dataset.key, child]));
  let previous = null;
  for (const item of items) {
    const key = String(keyOf(item));
    let child = old.get(key);
    old.delete(key);
    if (!child) { child = create(item); child.dataset.key = key; }
    child.item = item;
    refresh(child, item);
    const next = previous ? previous.nextSibling : list.firstChild;
    if (next !== child) list.insertBefore(child, next);
    previous = child;
  }
  for (const child of old.values()) child.remove();
}

// Written only when it is another: what is written is laid out and painted again.
export function set(holder, values) { for (const [name, value] of Object.entries(values)) if (holder[name] !== value) holder[name] = value; }
export function setText(node, text) { if (node.textContent !== text) node.textContent = text; }
// What a field said has been taken; what was typed into it since then stays.
export function spent(input, taken) { if (input.value === taken) input.value = ""; }
export function setValue(input, value) { if (document.activeElement !== input && input.value !== String(value)) input.value = value; }

// A file for the operator, and one from the operator.
export function download(name, blob) {
  const link = make("a", { href: URL.createObjectURL(blob), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

export const remembered = (key, fallback) => { try { return JSON.parse(localStorage.getItem(key)) ?? fallback; } catch { return fallback; } };
export const remember = (key, value) => { try { localStorage.setItem(key, JSON.stringify(value)); } catch { /* a browser that keeps nothing */ } };
export const number = (value, digits, unit) => (value === null || value === undefined ? "–" : `${value.toFixed(digits)} ${unit}`.trim());
export const clock = (seconds) => new Date(1000 * seconds).toLocaleTimeString([], { hour12: false });

// So long that nobody wants to read more digits.
export function age(seconds) {
  if (seconds < 9.95) return `${seconds.toFixed(1)} s`;
  if (seconds < 90) return `${seconds.toFixed(0)} s`;
  return seconds < 5400 ? `${(seconds / 60).toFixed(0)} min` : `${(seconds / 3600).toFixed(1)} h`;
}
