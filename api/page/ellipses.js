// Error ellipses on the map at the moment played, from the covariances that the service predicts.

import { byId, element } from "./elements.js";
import { ellipseOf, TURN } from "./geometry.js";
import { orbitsOf, roundBelow } from "./scenario.js";
import { askJson } from "./service.js";

const SHARE = 95;
/** Sigmas within which this share of normal errors in the plane lies. */
const SIGMAS = Math.sqrt(-2 * Math.log(1 - SHARE / 100));
/** Mean radii that the longest half axis may have, magnified. */
const MOST_RADII = 0.5;
const UNIT = Array.from({ length: 49 }, (_, k) => [Math.cos((TURN * k) / 48), Math.sin((TURN * k) / 48)]);

/** @typedef {{time_s: number[], vehicles: Record<string, [number, number, number][]>}} Covariances of (x, y), in m^2 */

let on = false;
let listening = false;
/** of what is asked for now @type {object | null} */
let asked = null;

/** Show the ellipses of a store's plan on a map, or no longer; plans that follow are asked about while they show. */
export function toggled(store, map) {
  on = !on;
  byId("ellipses").setAttribute("aria-pressed", on);
  const show = () => refresh(store, map);
  if (listening) return show();
  listening = true;
  store.on(["opened", "scenario"], () => clear(map));
  store.on(["off"], () => byId("magnified").hidden || remark(store));
  // the plan on show is heard at once
  store.on(["plan"], ({ quick, flown, current }) => !quick && !flown && current && show());
}

function clear(map) {
  asked = null;
  byId("magnified").hidden = true;
  byId("ellipses-text").textContent = "";
  map.surround(() => null);
}

async function refresh(store, map) {
  clear(map);
  const { plan, planId, scenario } = store;
  if (!on || !plan) return;
  const mine = {};
  asked = mine;
  const said = byId("ellipses-text");
  said.textContent = "Error ellipses follow …";
  try {
    const found = planId
      ? await askJson("GET", `v1/plans/${planId}/covariances`)
      : (await askJson("POST", "v1/previews?quick=true&covariances=true", { body: JSON.stringify({ scenario, vehicles: orbitsOf(plan) }) })).covariances;
    if (asked !== mine) return;
    remark(store);
    show(map, found, plan);
  } catch (error) {
    if (asked === mine) said.textContent = store.deleted(error) || error.message;
  }
}

/** Say what the ellipses on show do not. */
function remark({ plan, off }) {
  const grown = plan.observability.observable ? "" : "Not every position can be known: they keep growing after this run. ";
  byId("ellipses-text").textContent = `${grown}${off.length ? "With all switched on." : ""}`;
}

/** @param {Covariances} found */
function show(map, found, plan) {
  const factor = magnificationOf(found, plan.vehicles);
  const size = byId("magnified");
  const options = factor > 1 ? [factor, 1] : [1];
  size.replaceChildren(...options.map((one) => element("option", { value: one }, `${SHARE} %, ${one > 1 ? `× ${one}` : "true size"}`)));
  size.hidden = false;
  const draw = () =>
    map.surround((name, place, time) => {
      const covariance = covarianceAt(found, name, time, plan.period_s);
      return covariance && ringAround(place, covariance, SIGMAS * Number(size.value));
    });
  size.onchange = draw;
  draw();
}

/** The round factor by which the ellipses are magnified to be seen; never less than 1.
 * @param {Covariances} found */
export function magnificationOf({ vehicles: covariances }, vehicles) {
  const longest = SIGMAS * Math.max(...Object.values(covariances).flat().map((one) => ellipseOf(one).major));
  const room = (MOST_RADII * vehicles.reduce((sum, one) => sum + one.radius_m, 0)) / vehicles.length;
  return longest > 0 && room > longest ? roundBelow(room / longest) : 1;
}

/** A vehicle's covariance so many s into the period, as in the last period of the run; null where a run ends before.
 * @param {Covariances} found
 * @returns {[number, number, number] | null} */
export function covarianceAt({ time_s: times, vehicles }, name, time, period) {
  const at = time + period * Math.floor(((times.at(-1) ?? 0) - time) / period);
  const after = times.findIndex((one) => one >= at);
  if (at < 0 || after < 0 || !vehicles[name]) return null;
  const before = Math.max(after - 1, 0);
  const share = after === before ? 0 : (at - times[before]) / (times[after] - times[before]);
  const other = vehicles[name][after];
  const [xx, xy, yy] = vehicles[name][before].map((one, k) => one + share * (other[k] - one));
  return [xx, xy, yy];
}

/** Points [x, y] of an ellipse of so many sigmas around a place, closed. */
function ringAround({ x, y }, covariance, sigmas) {
  const { major, minor, angle } = ellipseOf(covariance);
  const [east, north] = [sigmas * Math.cos(angle), sigmas * Math.sin(angle)];
  return UNIT.map(([along, across]) => [x + major * along * east - minor * across * north, y + major * along * north + minor * across * east]);
}
