// A new team: its shape, size, orbits, sensors and landmarks in one dialogue.

import { byId, dialogue, element } from "./elements.js";
import { freeSite } from "./free_space.js";
import { choice, labelled, listed, number, RequestForm, typed, wide } from "./requests.js";
import { addLandmark, DIRECTIONS } from "./scenario.js";
import { SHAPES } from "./tables.js";

/** Sensors to begin with, by title: their keys but the range. */
const SENSORS = {
  "Camera all round": { bearing_sigma_rad: 0.05 },
  "Camera of 120° ahead": { fov_deg: 120, bearing_sigma_rad: 0.03 },
  "Camera all round, with distances (UWB)": { bearing_sigma_rad: 0.05, range_sigma_m: 0.2 },
};

/** what stands for no shape: centres are found for links alone */
const BY_LINKS = "";

/** The dialogue for a new team; `open(scenario, change)` plans a scenario and opens it, changed once its centres are known. */
export function offerNewTeam(open) {
  byId("new").addEventListener("click", () => show(open));
}

function show(open) {
  const name = typed("new-name", "name", { value: "my team" });
  const shape = choice("new-shape", "shape", { ...Object.fromEntries(Object.keys(SHAPES).map((one) => [one, one])), [BY_LINKS]: "given by its links" });
  const direction = choice("new-direction", "direction", DIRECTIONS);
  const sensor = choice("new-sensor", "sensor", Object.fromEntries(Object.keys(SENSORS).map((one) => [one, one])));
  const [count, gap] = [number("new-count", "count", 4), number("new-gap", "gap", 30)];
  const hint = element("p", { class: "hint" });
  const laid = [labelled("Vehicles", count), labelled("Gap between circles (m)", gap)];
  const linked = wide("Links", typed("new-links", "links", { value: "v1-v2 v2-v3 v3-v4 v4-v1" }));
  const explain = () => {
    const { value } = shape;
    const byLinks = value === BY_LINKS;
    hint.textContent = byLinks ? "Vehicles with a link must meet; centres are found so that they can." : `A ${value}: ${SHAPES[value].replaceAll("`", "")}.`;
    linked.hidden = !byLinks;
    for (const row of laid) row.hidden = byLinks;
    for (const one of [count, gap]) one.disabled = byLinks;
  };
  shape.value = "grid";
  direction.value = "ccw";
  shape.addEventListener("change", explain);
  explain();
  const form = new RequestForm("new", "Create", "Circles at one rate: neighbours lie a gap apart, landmarks go where there is room. All of it can be changed afterwards.", {
    rows: [
      wide("Name", name),
      wide("Shape", shape),
      hint,
      ...laid,
      linked,
      labelled("Radius (m)", number("new-radius", "radius", 20)),
      labelled("Speed (m/s)", number("new-speed", "speed", 4)),
      wide("Direction", direction),
      wide("Sensor", sensor),
      labelled("Range (m)", number("new-range", "range", 50)),
      labelled("Landmarks", number("new-landmarks", "landmarks", 2)),
    ],
    handIn: async (_form, asked) => {
      try {
        await open(scenarioOf(asked), (scenario) => withLandmarks(scenario, asked.landmarks));
        shown.close();
      } catch (error) {
        form.showFault(error);
      }
    },
  });
  const shown = dialogue("new", "New team", {}, form.element);
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

/** Return a scenario with so many landmarks more, where there is room for them. */
function withLandmarks(scenario, count) {
  let changed = scenario;
  for (let k = 0; k < count; k++) {
    const site = freeSite(changed);
    if (site) changed = addLandmark(changed, site);
  }
  return changed;
}
