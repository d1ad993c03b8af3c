// A new team: its shape, size, orbits, sensors and landmarks in one dialogue.

import { byId, element } from "./elements.js";
import { freeSite } from "./free_space.js";
import { choice, labelled, number, RequestForm, wide } from "./requests.js";
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
  const fields = {
    name: element("input", { id: "new-name", value: "my team", "aria-describedby": "new-name-fault" }),
    shape: choice("new-shape", { ...Object.fromEntries(Object.keys(SHAPES).map((one) => [one, one])), [BY_LINKS]: "given by its links" }),
    links: element("input", { id: "new-links", value: "v1-v2 v2-v3 v3-v4 v4-v1", "aria-describedby": "new-links-fault" }),
    count: number("new-count", 4),
    gap: number("new-gap", 30),
    radius: number("new-radius", 20),
    speed: number("new-speed", 4),
    direction: choice("new-direction", DIRECTIONS),
    sensor: choice("new-sensor", Object.fromEntries(Object.keys(SENSORS).map((one) => [one, one]))),
    range: number("new-range", 50),
    landmarks: number("new-landmarks", 2),
  };
  const hint = element("p", { class: "hint" });
  const laid = [labelled("Vehicles", fields.count), labelled("Gap between circles (m)", fields.gap)];
  const linked = wide("Links", fields.links);
  const explain = () => {
    const { value } = fields.shape;
    const byLinks = value === BY_LINKS;
    hint.textContent = byLinks ? "Vehicles with a link must meet; centres are found so that they can." : `A ${value}: ${SHAPES[value].replaceAll("`", "")}.`;
    linked.hidden = !byLinks;
    for (const row of laid) row.hidden = byLinks;
    for (const one of [fields.count, fields.gap]) one.disabled = byLinks;
  };
  fields.shape.value = "grid";
  fields.direction.value = "ccw";
  fields.shape.addEventListener("change", explain);
  explain();
  const form = new RequestForm("new", "Create", "Circles at one rate: neighbours lie a gap apart, landmarks go where there is room. All of it can be changed afterwards.", {
    fields,
    read: () => Object.fromEntries(Object.entries(fields).map(([key, input]) => [key, input.type === "number" ? input.valueAsNumber : input.value])),
    rows: [
      wide("Name", fields.name),
      wide("Shape", fields.shape),
      hint,
      ...laid,
      linked,
      labelled("Radius (m)", fields.radius),
      labelled("Speed (m/s)", fields.speed),
      wide("Direction", fields.direction),
      wide("Sensor", fields.sensor),
      labelled("Range (m)", fields.range),
      labelled("Landmarks", fields.landmarks),
    ],
    handIn: async (_form, asked) => {
      try {
        await open(scenarioOf(asked), (scenario) => withLandmarks(scenario, asked.landmarks));
        dialogue.close();
      } catch (error) {
        form.showFault(error);
      }
    },
  });
  const close = element("button", { type: "button", class: "small", "aria-label": "Close", onclick: () => dialogue.close() }, "×");
  const dialogue = element("dialog", { "aria-labelledby": "new-title" }, element("div", { class: "title-row" }, element("h2", { id: "new-title" }, "New team"), close), form.element);
  dialogue.addEventListener("close", () => dialogue.remove());
  document.body.append(dialogue);
  dialogue.showModal();
}

function scenarioOf({ name, shape, links, count, gap, radius, speed, direction, sensor, range }) {
  return {
    name,
    orbit: { radius_m: radius, speed_mps: speed, direction },
    formation: shape === BY_LINKS ? { links: links.split(/[\s,;]+/).filter(Boolean).map((one) => one.split("-")) } : { shape, count, gap_m: gap },
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
