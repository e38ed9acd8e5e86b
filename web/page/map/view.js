// Which part of the world the map shows: the whole, what is around the robot, or where the operator has moved it.

export const canvas = document.getElementById("map");
export const view = { scale: 40, x: 0, y: 0, fitted: false, follows: false };
const watchers = [];
export const onView = (watcher) => watchers.push(watcher);
const tell = () => { for (const watcher of watchers) watcher(); };

// Where the world is on the page, in words: what is drawn for one place is drawn anew for another.
export const placed = () => `${canvas.clientWidth} ${canvas.clientHeight} ${window.devicePixelRatio || 1} ${view.scale} ${view.x} ${view.y}`;

export const toWorld = (px, py) => [view.x + (px - canvas.clientWidth / 2) / view.scale, view.y - (py - canvas.clientHeight / 2) / view.scale];
export const toPage = ([x, y]) => [canvas.clientWidth / 2 + (x - view.x) * view.scale, canvas.clientHeight / 2 - (y - view.y) * view.scale];

export function fit(map) {
  const box = canvas.getBoundingClientRect();
  if (!map || box.width === 0) return;
  const { cols, rows, resolution_m: r, origin_x_m: x, origin_y_m: y } = map;
  Object.assign(view, { scale: Math.min(box.width / (cols * r), box.height / (rows * r)) * 0.97, x: x + (cols * r) / 2, y: y + (rows * r) / 2, fitted: true });
  follow(false);
}

export function follow(on) {
  view.follows = on;
  if (on && view.scale < 60) view.scale = 60;
  tell();
}

export function centreOn([x, y]) {
  Object.assign(view, { x, y, scale: Math.max(view.scale, 60), fitted: true, follows: false });
  tell();
}

export function centre(pose) {
  if (view.follows && pose && pose.x_m !== null) Object.assign(view, { x: pose.x_m, y: pose.y_m });
}

export function zoom(factor, px = canvas.clientWidth / 2, py = canvas.clientHeight / 2) {
  const [x, y] = toWorld(px, py);
  view.scale = Math.min(Math.max(view.scale * factor, 2), 800);
  const [nx, ny] = toWorld(px, py);
  view.x += x - nx;
  view.y += y - ny;
  tell();
}

export function pan(from, dx, dy) {
  Object.assign(view, { x: from.x - dx / view.scale, y: from.y + dy / view.scale, follows: false });
  tell();
}

// The nearest point of the map, a hair inside its border.
export function onMap([x, y], { cols, rows, resolution_m: r, origin_x_m: left, origin_y_m: low }) {
  const hair = r * 0.05;
  return [Math.min(Math.max(x, left + hair), left + cols * r - hair), Math.min(Math.max(y, low + hair), low + rows * r - hair)];
}
