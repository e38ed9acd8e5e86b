// What lies below a pixel of the map: a goal, a person, a sighting or a zone; and a point in words.

import { classTitle } from "../../beware/class_title.js";
import { isInside } from "../../core/geometry.js";
import { decimal, number, t } from "../../core/text/language.js";
import { cellAt } from "../ground/tiles.js";
import { toPage, toWorld } from "../view.js";
import { world } from "../world.js";

const GRAB_PX = 11;
const FLAG_PX = { left: -4, right: 26, top: -33, bottom: 8 };
const SIGHTING_M = 0.3;
const SEEN = 1;
const OBSTACLE = 2;
const BLOCKED = 4;
const PRIOR = 16;

const ringOf = (zone) => zone.geometry.coordinates[0];

function areaOf(ring) {
  return Math.abs(
    ring.reduce((sum, [x, y], i) => {
      const [nextX, nextY] = ring[(i + 1) % ring.length];
      return sum + (x * nextY - nextX * y) / 2;
    }, 0),
  );
}

function isOnFlag(goal, [px, py]) {
  const [x, y] = toPage([goal.x_m, goal.y_m]);
  const { left, right, top, bottom } = FLAG_PX;
  return px >= x + left && px <= x + right && py >= y + top && py <= y + bottom;
}

function firstNear(items, placeOf, radiusOf, [px, py]) {
  const at = toWorld(px, py);
  return items.find((item) => {
    const [x, y] = placeOf(item);
    const [pageX, pageY] = toPage([x, y]);
    return (
      Math.hypot(x - at[0], y - at[1]) < radiusOf(item) ||
      Math.hypot(pageX - px, pageY - py) < GRAB_PX
    );
  });
}

// A site is hit at its boundary only: all that the robot does is inside it.
function isHit(zone, at, pixel) {
  const ring = ringOf(zone);
  if (zone.properties.kind !== "stay-inside") return isInside(at, ring);
  return ring.slice(1).some((end, i) => pixelsToSide(pixel, toPage(ring[i]), toPage(end)) < GRAB_PX);
}

function pixelsToSide([x, y], [ax, ay], [bx, by]) {
  const [dx, dy] = [bx - ax, by - ay];
  const along = ((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy || 1);
  const share = Math.min(Math.max(along, 0), 1);
  return Math.hypot(x - ax - share * dx, y - ay - share * dy);
}

// The smallest thing at a pixel of the canvas as { kind, id, item }, or null.
export function targetAt(pixel) {
  const made = (kind, item) => (item ? { kind, id: item.id, item } : null);
  const goals = [...(world.state?.queue ?? [])].reverse();
  const at = toWorld(...pixel);
  const zones = world.zones
    .filter((zone) => isHit(zone, at, pixel))
    .sort((one, other) => areaOf(ringOf(one)) - areaOf(ringOf(other)));
  return (
    made("goal", goals.find((goal) => isOnFlag(goal, pixel))) ??
    made("person", firstNear(world.people, (one) => [one.x_m, one.y_m], (one) => one.radius_m, pixel)) ??
    made("sighting", firstNear(world.sightings, (one) => one.place, () => SIGHTING_M, pixel)) ??
    made("zone", zones[0])
  );
}

// What is at a point, in words.
export function describe(at, target) {
  const words = [targetText(target), cellText(at)].filter(Boolean).join(". ");
  return `${words.charAt(0).toUpperCase()}${words.slice(1)}.`;
}

function targetText(target) {
  if (!target) return "";
  const { kind, item } = target;
  if (kind === "goal") return item.name ? t("goal “{name}”", item) : t("goal");
  if (kind === "person") {
    const speed = Math.hypot(item.vx_mps, item.vy_mps);
    return speed > 0.05
      ? t("a person, walking at {speed} m/s", { speed: number(speed, 1) })
      : t("a person, standing");
  }
  if (kind === "sighting")
    return t("{name}, detected {looks} times, {percent} % sure", {
      name: item.class_name,
      looks: item.looks,
      percent: Math.round(100 * item.confidence),
    });
  const { name, enabled, kind: rule, max_speed_mps: limit } = item.properties;
  const terms =
    { "speed-limit": t("at most {limit} m/s", { limit: decimal(limit) }), "stay-inside": t("stay inside") }[rule] ?? t("keep out");
  return t("zone “{name}”: {terms}", { name, terms }) + (enabled ? "" : `, ${t("switched off")}`);
}

// The class of the beware list that the map holds at a point, or undefined.
export function classAt(at) {
  const cell = world.map && cellAt(world.map, at);
  return cell && world.classes.find(({ class_id: id }) => [cell.first, cell.second].includes(id));
}

function cellText(at) {
  const cell = world.map && cellAt(world.map, at);
  if (!cell) return t("outside the map");
  const found = classAt(at);
  if (found) return t("{name} of the beware list", { name: classTitle(found) });
  if (cell.flags & OBSTACLE) return t("an obstacle");
  if (cell.flags & PRIOR) return t("an obstacle of the prior map, not seen yet");
  if (cell.flags & BLOCKED) return t("too close to something for the robot's centre");
  return cell.flags & SEEN ? t("free floor") : t("not seen yet, taken to be free");
}
