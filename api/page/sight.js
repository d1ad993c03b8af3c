// What the chosen vehicle's sensor covers at the moment shown: a circle, or a part of one.

import { drawn } from "./elements.js";

/** A drawing over the map's axes. */
export class Sight {
  /** the element to lay over the map */
  drawing = drawn("svg", { class: "sight", "aria-hidden": "true" });
  #path = drawn("path");

  constructor() {
    this.drawing.append(this.#path);
  }

  /** Show what `vehicle` covers `time` s after the start of `plan`; nothing where either is missing. */
  show(vehicle, plan, time, { xaxis, yaxis }) {
    const planned = plan?.vehicles.find((one) => one.name === vehicle?.name);
    this.drawing.style.display = planned ? "" : "none";
    if (!planned) return;
    Object.assign(this.drawing.style, { left: `${xaxis._offset}px`, top: `${yaxis._offset}px` });
    this.drawing.setAttribute("width", xaxis._length);
    this.drawing.setAttribute("height", yaxis._length);
    const { at, ahead } = poseOf(vehicle, planned, plan.period_s, time);
    const scale = Math.abs(xaxis.d2p(1) - xaxis.d2p(0));
    const place = { x: xaxis.d2p(at.x), y: yaxis.d2p(at.y), radius: vehicle.sensor.range_m * scale };
    this.#path.setAttribute("d", outline(place, ahead + radians(vehicle.sensor.boresight_deg), radians(vehicle.sensor.fov_deg)));
  }
}

/** Where a vehicle is and which way it heads: it flies on from its phase. */
function poseOf({ x, y, radius }, { phase_rad: phase, direction }, period, time) {
  const sense = direction === "cw" ? -1 : 1;
  const turned = phase + (sense * 2 * Math.PI * time) / period;
  return {
    at: { x: x + radius * Math.cos(turned), y: y + radius * Math.sin(turned) },
    ahead: turned + (sense * Math.PI) / 2,
  };
}

/** The path of a circle, or of what lies within half the field of view on either side of the middle. */
function outline({ x, y, radius }, middle, view) {
  // y points down on a screen
  const rim = (angle) => `${x + radius * Math.cos(angle)} ${y - radius * Math.sin(angle)}`;
  const arc = (to, large) => `A ${radius} ${radius} 0 ${large} 0 ${rim(to)}`;
  if (view >= 2 * Math.PI) return `M ${rim(0)} ${arc(Math.PI, 1)} ${arc(2 * Math.PI, 1)} Z`;
  const [from, to] = [middle - view / 2, middle + view / 2];
  return `M ${x} ${y} L ${rim(from)} ${arc(to, view > Math.PI ? 1 : 0)} Z`;
}

function radians(degrees) {
  return (degrees * Math.PI) / 180;
}
