// Elements of the page, values written into them, and settings of this browser.

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

// Keep one child per key, in order; `refresh` sets what may have changed. Input in progress stays.
export function reconcile(list, items, keyOf, create, refresh) {
  const old = new Map([...list.children].map((child) => [child.dataset.key, child]));
  let previous = null;
  for (const item of items) {
    const key = String(keyOf(item));
    let child = old.get(key);
    old.delete(key);
    if (!child) {
      child = create(item);
      child.dataset.key = key;
    }
    child.item = item;
    refresh(child, item);
    const next = previous ? previous.nextSibling : list.firstChild;
    if (next !== child) list.insertBefore(child, next);
    previous = child;
  }
  for (const child of old.values()) child.remove();
}

// Values are written only where they differ: every write costs a layout and a paint.
export function set(target, values) {
  for (const [name, value] of Object.entries(values))
    if (target[name] !== value) target[name] = value;
}

export function setText(node, text) {
  if (node.textContent !== text) node.textContent = text;
}

export function setValue(input, value) {
  if (document.activeElement !== input && input.value !== String(value)) input.value = value;
}

// Clear a field whose value was sent, unless it has been edited since.
export function clearSent(input, sent) {
  if (input.value === sent) input.value = "";
}

export function download(name, blob) {
  const link = make("a", { href: URL.createObjectURL(blob), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

// Settings that this browser remembers.
export function loadSetting(key, fallback) {
  try {
    return JSON.parse(localStorage.getItem(key)) ?? fallback;
  } catch {
    return fallback;
  }
}

export function saveSetting(key, value) {
  try {
    localStorage.setItem(key, JSON.stringify(value));
  } catch {
    // this browser stores nothing
  }
}
