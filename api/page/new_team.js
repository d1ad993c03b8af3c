// A new team: its shape, size, orbits, sensors and landmarks in one dialogue.

import { byId, dialogue, options } from "./elements.js";
import { freeSite } from "./free_space.js";
import { listed, RequestForm } from "./requests.js";
import { addLandmark, DIRECTIONS, rounded, vehiclesOf } from "./scenario.js";
import { SHAPES } from "./tables.js";

/** Sensors to begin with, by title: their keys but the range. */
const SENSORS = {
  "Camera all round": { bearing_sigma_rad: 0.05 },
  "Camera of 120° ahead": { fov_deg: 120, bearing_sigma_rad: 0.03 },
  "Camera all round, with distances (UWB)": { bearing_sigma_rad: 0.05, range_sigma_m: 0.2 },
};

/** the least separation of a new team: a share of the smallest distance of centres, and never less than so many m */
const SEPARATION_SHARE = 0.1;
const LEAST_SEPARATION_M = 2;

/** what stands for no shape: centres are found for links alone */
const BY_LINKS = "";

/** The dialogue for a new team; `open(scenario, change)` plans a scenario and opens it, changed once its centres are known. */
export function offerNewTeam(open) {
  byId("new").addEventListener("click", () => show(open));
}

function show(open) {
  const made = byId("new-team").content.firstElementChild.cloneNode(true);
  const { shape, direction, sensor, count, gap, links } = made.elements;
  const hint = made.querySelector(".about-shape");
  shape.append(...options({ ...Object.fromEntries(Object.keys(SHAPES).map((one) => [one, one])), [BY_LINKS]: "given by its links" }));
  direction.append(...options(DIRECTIONS));
  sensor.append(...options(Object.fromEntries(Object.keys(SENSORS).map((one) => [one, one]))));
  const explain = () => {
    const { value } = shape;
    const byLinks = value === BY_LINKS;
    hint.textContent = byLinks ? "Vehicles with a link must meet; centres are found so that they can." : `A ${value}: ${SHAPES[value].replaceAll("`", "")}.`;
    links.closest(".field").hidden = !byLinks;
    for (const one of [count, gap]) one.closest(".field").hidden = one.disabled = byLinks;
  };
  shape.value = "grid";
  direction.value = "ccw";
  shape.addEventListener("change", explain);
  explain();
  const form = new RequestForm("new", made, {
    handIn: async (_form, asked) => {
      try {
        await open(scenarioOf(asked), (scenario) => completed(scenario, asked.landmarks));
        shown.close();
      } catch (error) {
        form.showFault(error);
      }
    },
  });
  const shown = dialogue("new", "New team", {}, made);
}

function scenarioOf({ name, shape, links, count, gap, radius, speed, direction, sensor, range }) {
  return {
    name,
    orbit: { radius_m: radius, speed_mps: speed, direction },
    formation: shape === BY_LINKS ? { links: listed(links).map((one) => one.split("-")) } : { shape, count, gap_m: gap },
    landmarks_m: [],
    sensor: { range_m: range, ...SENSORS[sensor] },
  };
}

/** Return a scenario with a least separation of vehicles, and so many landmarks more, where there is room for them. */
function completed(scenario, count) {
  const vehicles = vehiclesOf(scenario);
  const apart = vehicles.flatMap(({ x, y }, k) => vehicles.slice(k + 1).map((other) => Math.hypot(other.x - x, other.y - y)));
  const least = Math.max(SEPARATION_SHARE * Math.min(...apart), LEAST_SEPARATION_M);
  let changed = apart.length ? { ...scenario, min_separation_m: rounded(least, 2) } : scenario;
  for (let k = 0; k < count; k++) {
    const site = freeSite(changed);
    if (site) changed = addLandmark(changed, site);
  }
  return changed;
}
