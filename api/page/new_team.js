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

/** The dialogue for a new team; `open(scenario, change)` plans a scenario and opens it, changed once its centres are known. */
export function offerNewTeam(open) {
  byId("new").addEventListener("click", () => show(open));
}

function show(open) {
  const fields = {
    name: element("input", { id: "new-name", value: "my team", "aria-describedby": "new-name-fault" }),
    shape: choice("new-shape", Object.fromEntries(Object.keys(SHAPES).map((one) => [one, one]))),
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
  const explain = () => {
    hint.textContent = `A ${fields.shape.value}: ${SHAPES[fields.shape.value].replaceAll("`", "")}.`;
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
      labelled("Vehicles", fields.count),
      labelled("Gap between circles (m)", fields.gap),
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

function scenarioOf({ name, shape, count, gap, radius, speed, direction, sensor, range }) {
  return {
    name,
    orbit: { radius_m: radius, speed_mps: speed, direction },
    formation: { shape, count, gap_m: gap },
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
