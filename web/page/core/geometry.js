// Geometry of drafts, in metres of the map. A draft is a few handles; its outline is what would bind the robot.

export const distance = ([ax, ay], [bx, by]) => Math.hypot(ax - bx, ay - by);
export const rounded = (value) => Math.round(value * 1000) / 1000;
export const place = ([x, y]) => [rounded(x), rounded(y)];

// What is drawn of a draft before the console has answered; the console's own outline is the one that counts.
export function outline(tool, corners, width) {
  if (tool === "circle") return corners.length < 2 ? [] : circle(corners[0], distance(corners[0], corners[1]));
  if (tool === "corridor") return corners.length < 2 ? [] : strip(corners, width / 2);
  return corners;
}

function circle([x, y], radius) {
  return Array.from({ length: 48 }, (_, i) => [x + radius * Math.cos((i * Math.PI) / 24), y + radius * Math.sin((i * Math.PI) / 24)]);
}

function strip(line, half) {
  const side = (points) => points.map((point, i) => {
    const [before, after] = [points[Math.max(i - 1, 0)], points[Math.min(i + 1, points.length - 1)]];
    const [dx, dy] = [after[0] - before[0], after[1] - before[1]];
    const length = Math.hypot(dx, dy) || 1;
    return [point[0] - (dy / length) * half, point[1] + (dx / length) * half];
  });
  return [...side(line), ...side([...line].reverse())];
}

export function geometry(tool, corners, width) {
  if (tool === "circle") return { type: "Point", coordinates: corners[0], radius_m: rounded(distance(corners[0], corners[1] ?? corners[0])) };
  if (tool === "corridor") return { type: "LineString", coordinates: corners, width_m: width };
  return { type: "Polygon", coordinates: [corners] };
}

// Handles and tool of a stored zone, so that a circle is edited as a circle.
export function handles(zone) {
  const drawn = zone.properties.drawn;
  if (drawn?.type === "Point") {
    const [x, y] = drawn.coordinates;
    return { tool: "circle", corners: [[x, y], [x + drawn.radius_m, y]], width: 0.6 };
  }
  if (drawn?.type === "LineString") return { tool: "corridor", corners: drawn.coordinates.map((point) => [...point]), width: drawn.width_m };
  return { tool: "polygon", corners: zone.geometry.coordinates[0].slice(0, -1).map((point) => [...point]), width: 0.6 };
}

export function inside([x, y], ring) {
  let within = false;
  for (let i = 0, j = ring.length - 1; i < ring.length; j = i, i += 1) {
    const [[ax, ay], [bx, by]] = [ring[i], ring[j]];
    if (ay > y !== by > y && x < ((bx - ax) * (y - ay)) / (by - ay) + ax) within = !within;
  }
  return within;
}

// Where a corner could be put in: the middle of every side, and after which corner it would come.
export function middles(tool, corners) {
  if (tool === "circle" || corners.length < 2) return [];
  const sides = tool === "corridor" ? corners.length - 1 : corners.length;
  return Array.from({ length: sides }, (_, i) => {
    const [a, b] = [corners[i], corners[(i + 1) % corners.length]];
    return { after: i, at: [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2] };
  });
}

// A line drawn by hand with only the points that matter (Ramer, Douglas, Peucker).
export function simplified(points, tolerance) {
  if (points.length < 3) return points;
  const [first, last] = [points[0], points[points.length - 1]];
  let [worst, at] = [0, 0];
  for (let i = 1; i < points.length - 1; i += 1) {
    const off = offLine(points[i], first, last);
    if (off > worst) [worst, at] = [off, i];
  }
  if (worst <= tolerance) return [first, last];
  return [...simplified(points.slice(0, at + 1), tolerance).slice(0, -1), ...simplified(points.slice(at), tolerance)];
}

function offLine(point, a, b) {
  const length = distance(a, b);
  if (length < 1e-9) return distance(point, a);
  return Math.abs((b[0] - a[0]) * (a[1] - point[1]) - (a[0] - point[0]) * (b[1] - a[1])) / length;
}
