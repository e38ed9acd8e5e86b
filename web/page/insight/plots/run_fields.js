// The names of the fields of a report of a past mission.

import { t } from "../../core/text/language.js";

const NAMES = {
  id: t("run"),
  begun_unix_s: t("begun"),
  site: t("site"),
  scenario: t("scenario"),
  robot: t("robot"),
  goals: t("goals"),
  goal_count: t("number of goals"),
  unfinished: t("interrupted, or going on"),
  cancelled: t("cancelled"),
  goals_reached: t("goals reached"),
  success: t("success"),
  sim_time_s: t("time, s"),
  distance_m: t("distance, m"),
  spl: "SPL",
  min_clearance_m: t("least clearance, m"),
  min_item_clearance_m: t("least clearance from items, m"),
  collisions: t("collisions"),
  struck_while_standing: t("struck while standing"),
  contacts: t("contacts"),
  beware_intrusions: t("beware intrusions"),
  beware_intrusion_s: t("time in beware areas, s"),
  beware_intrusion_m2s: t("area and time in beware areas, m² s"),
  intruded: t("beware areas entered"),
  zone_intrusions: t("zone intrusions"),
  zone_intrusion_s: t("time in zones, s"),
  zone_intrusion_m2s: t("area and time in zones, m² s"),
  ground_intrusions: t("untraversable ground intrusions"),
  ground_intrusion_s: t("time on untraversable ground, s"),
  ground_intruded: t("untraversable ground entered"),
  fell: t("fell"),
  intrusions: t("intrusions"),
  stops: t("stops"),
};

// Reports of other versions have other fields, which keep their English names.
export const nameOf = (field) => NAMES[field] ?? field.replaceAll("_", " ");
