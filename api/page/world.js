// Fields of the world as it is: folded away where a scenario has none of their keys.

import { valueAt } from "./scenario.js";

/**
 * @typedef {{ path: string, label: string, unit?: string, kind?: string, min?: number, max?: number, choices?: (value: any) => any }} Field
 * a key of the scenario that may be left out
 */

/** Groups of fields by their title. @type {Record<string, Field[]>} */
export const WORLD = {
  "Sightings: interval, distance, compass": [
    { path: "sensor.interval_s", label: "Sighting interval", unit: "s", min: 0 },
    { path: "sensor.detection_probability", label: "Detection probability", min: 0, max: 1 },
    { path: "sensor.range_sigma_m", label: "Distance sigma", unit: "m", min: 0 },
    { path: "sensor.bearing_bias_sigma_rad", label: "Bearing bias sigma", unit: "rad", min: 0 },
    { path: "sensor.bearing_walk", label: "Bearing walk", kind: "json" },
    { path: "heading_sigma_rad", label: "Compass sigma", unit: "rad", min: 0 },
    { path: "heading_interval_s", label: "Compass interval", unit: "s", min: 0 },
  ],
  "Errors of motion readings": [
    { path: "motion.position_random_walk_m_sqrt_s", label: "Position random walk", unit: "m/√s", min: 0 },
    { path: "motion.angle_random_walk_rad_sqrt_s", label: "Angle random walk", unit: "rad/√s", min: 0 },
    { path: "motion.speed_scale_sigma", label: "Speed scale sigma", min: 0 },
    { path: "motion.turn_rate_bias_sigma_rad_s", label: "Turn-rate bias sigma", unit: "rad/s", min: 0 },
    { path: "motion.clock_offset_sigma_s", label: "Clock offset sigma", unit: "s", min: 0 },
  ],
  "Wind or current": [
    { path: "wind.sigma_mps", label: "Wind sigma", unit: "m/s", min: 0 },
    { path: "wind.gust_sigma_mps", label: "Gust sigma", unit: "m/s", min: 0 },
    { path: "wind.gust_time_s", label: "Gust time", unit: "s", min: 0 },
  ],
  "Obstacles and keep-out areas": [
    { path: "obstacles_m", label: "Polygons that block sight", unit: "m", kind: "json" },
    { path: "keep_out_m", label: "Polygons that block paths", unit: "m", kind: "json" },
  ],
  "A simulated world that differs": [{ path: "truth", label: "Keys that are true instead", kind: "json" }],
  "Errors that the filter estimates": [{ path: "filter.estimate", label: "Estimated errors", kind: "choice", choices: estimatesOf }],
};

const ESTIMATES = { auto: "all with a sigma", none: "none" };

/** Return whether a scenario has a key of a group; of sensors, any of them. */
export function isUsed(scenario, fields) {
  const given = (path) => {
    const [section, key] = path.split(".");
    const places = section === "sensor" ? [scenario.sensor].flat().map((one) => one[key]) : [valueAt(scenario, path)];
    return places.some((value) => value !== undefined && value !== null);
  };
  return fields.some(({ path }) => given(path));
}

/** Return the choices of what the filter estimates, and the one taken: a list stays as it is. */
function estimatesOf(value = "auto") {
  if (Array.isArray(value)) return [{ ...ESTIMATES, "": value.join(", ") || "none listed" }, ""];
  return [ESTIMATES, value === "none" ? "none" : "auto"];
}
