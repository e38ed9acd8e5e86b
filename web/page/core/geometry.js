// Geometry of drafts, in metres of the map frame. A draft is a few handles; its outline is the area
// of the zone.

export const distance = ([ax, ay], [bx, by]) => Math.hypot(ax - bx, ay - by);
export const rounded = (value) => Math.round(value * 1000) / 1000;
export const roundedPoint = ([x, y]) => [rounded(x), rounded(y)];

// The box around points, { left, right, bottom, top }, or null without one. A loop: a function takes
// too few arguments for the corners of all zones.
export function boxAround(points) {
  const box = { left: Infinity, right: -Infinity, bottom: Infinity, top: -Infinity };
  for (const [x, y] of points) {
    box.left = Math.min(box.left, x);
    box.right = Math.max(box.right, x);
    box.bottom = Math.min(box.bottom, y);
    box.top = Math.max(box.top, y);
  }
  return points.length ? box : null;
}

// The outline that is drawn until the console answers; only the console's outline counts.
export function outlineOf(tool, corners, width) {
  if (tool === "circle")
    return corners.length < 2 ? [] : circle(corners[0], distance(corners[0], corners[1]));
  if (tool === "corridor") return corners.length < 2 ? [] : corridor(corners, width / 2);
  return corners;
}

const CIRCLE_CORNERS = 48;

function circle([x, y], radius) {
  const step = (2 * Math.PI) / CIRCLE_CORNERS;
  return Array.from({ length: CIRCLE_CORNERS }, (_, i) => [
    x + radius * Math.cos(i * step),
    y + radius * Math.sin(i * step),
  ]);
}

function corridor(line, halfWidth) {
  const offset = (points) =>
    points.map((point, i) => {
      const [before, after] = [
        points[Math.max(i - 1, 0)],
        points[Math.min(i + 1, points.length - 1)],
      ];
      const [dx, dy] = [after[0] - before[0], after[1] - before[1]];
      const length = Math.hypot(dx, dy) || 1;
      return [point[0] - (dy / length) * halfWidth, point[1] + (dx / length) * halfWidth];
    });
  return [...offset(line), ...offset([...line].reverse())];
}

// GeoJSON of a draft; a circle is a Point with a radius, a corridor a LineString with a width.
export function geometryOf(tool, corners, width) {
  if (tool === "circle")
    return {
      type: "Point",
      coordinates: corners[0],
      radius_m: rounded(distance(corners[0], corners[1])),
    };
  if (tool === "corridor") return { type: "LineString", coordinates: corners, width_m: width };
  return { type: "Polygon", coordinates: [corners] };
}

// Tool and handles of a stored zone, so that a circle is edited as a circle.
export function handlesOf(zone) {
  const drawn = zone.properties.drawn;
  if (drawn?.type === "Point") {
    const [x, y] = drawn.coordinates;
    return {
      tool: "circle",
      corners: [
        [x, y],
        [x + drawn.radius_m, y],
      ],
      width: 0.6,
    };
  }
  if (drawn?.type === "LineString")
    return {
      tool: "corridor",
      corners: drawn.coordinates.map((point) => [...point]),
      width: drawn.width_m,
    };
  return {
    tool: "polygon",
    corners: zone.geometry.coordinates[0].slice(0, -1).map((point) => [...point]),
    width: 0.6,
  };
}

export function isInside([x, y], ring) {
  let inside = false;
  for (let i = 0, j = ring.length - 1; i < ring.length; j = i, i += 1) {
    const [[ax, ay], [bx, by]] = [ring[i], ring[j]];
    if (ay > y !== by > y && x < ((bx - ax) * (y - ay)) / (by - ay) + ax) inside = !inside;
  }
  return inside;
}

// The middle of every side, where a corner can be inserted, with the corner that precedes it.
export function midpoints(tool, corners) {
  if (tool === "circle" || corners.length < 2) return [];
  const sides = tool === "corridor" ? corners.length - 1 : corners.length;
  return Array.from({ length: sides }, (_, i) => {
    const [a, b] = [corners[i], corners[(i + 1) % corners.length]];
    return { after: i, at: [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2] };
  });
}

// Simplify a freehand line (Ramer, Douglas, Peucker).
export function simplify(points, tolerance) {
  if (points.length < 3) return points;
  const [first, last] = [points[0], points[points.length - 1]];
  let [worst, at] = [0, 0];
  for (let i = 1; i < points.length - 1; i += 1) {
    const offset = distanceToLine(points[i], first, last);
    if (offset > worst) [worst, at] = [offset, i];
  }
  if (worst <= tolerance) return [first, last];
  return [
    ...simplify(points.slice(0, at + 1), tolerance).slice(0, -1),
    ...simplify(points.slice(at), tolerance),
  ];
}

function distanceToLine(point, a, b) {
  const length = distance(a, b);
  if (length < 1e-9) return distance(point, a);
  return Math.abs((b[0] - a[0]) * (a[1] - point[1]) - (a[0] - point[0]) * (b[1] - a[1])) / length;
}
