// Positions as people read and type them: in metres of the plane, or in degrees where a scenario has a place on the earth.

import { groundPointOf, placeOf, placeWords } from "./earth.js";
import { byId, notice } from "./elements.js";
import { placesIn, round } from "./scenario.js";
import { keepDegrees, keptDegrees } from "./session.js";

/** decimals of degrees that are shown: a millimetre */
const DIGITS = 8;
/** step of the arrow keys in degrees: a metre */
const STEP_DEG = 1e-5;
const NO_ORIGIN = "State the latitude and longitude of the origin first, in the part Preflight.";

/**
 * @typedef {object} Coordinates
 * `of(point)` returns the two numbers that a point [x, y] in m is shown as, `shown(number)` rounds one of them, and
 * `taken(pair)` returns the point of two that were typed; it throws RangeError where there is no such point
 * @property {{key: string, label: string, at: number}[]} axes with the place of each in a point
 * @property {any} field what fields of positions have in common
 * @property {(point: number[]) => number[]} of
 * @property {(value: number) => number} shown
 * @property {(pair: number[]) => number[]} taken
 * @property {(place: {x: number, y: number}) => string} words
 */

/** How positions of a store's scenario are shown and typed. @returns {Coordinates} */
export function coordinatesOf({ scenario, degrees }) {
  const { geo_origin: origin } = scenario;
  if (!degrees || !origin) {
    return {
      axes: [{ key: "x", label: "east", at: 0 }, { key: "y", label: "north", at: 1 }],
      field: { unit: "m", help: "“190, 70”, pasted, sets east and north in metres. A pair is taken as latitude and longitude where Degrees is switched on." },
      of: (point) => point,
      shown: (value) => value,
      taken: (pair) => pair,
      words: placesIn(scenario),
    };
  }
  return {
    axes: [{ key: "lat", label: "latitude", at: 1 }, { key: "lon", label: "longitude", at: 0 }],
    field: { unit: "°", whole: true, steady: true, step: STEP_DEG, help: "“47.3977, 8.5456”, pasted, sets latitude and longitude. A pair is taken as metres where Degrees is switched off." },
    of: (point) => placeOf(origin, point),
    shown: (value) => Number(value.toFixed(DIGITS)),
    taken: (pair) => groundPointOf(origin, pair).map(round),
    words: ({ x, y }) => placeWords(placeOf(origin, [x, y])),
  };
}

/** Return the pairs of numbers that a text lists, in brackets or without; the last may lack one, and NaN is what is none. */
export function pairsIn(text) {
  const numbers = text.split(/[\s,;[\]]+/).filter(Boolean).map(Number);
  return numbers.flatMap((_, k) => (k % 2 ? [] : [numbers.slice(k, k + 2)]));
}

/** Return two numbers that a text holds, as maps copy places; null for any other text. */
export function pairIn(text) {
  const [pair = [], ...others] = pairsIn(text);
  return pair.length === 2 && pair.every(Number.isFinite) && !others.length ? pair : null;
}

/** Return the corners that a text lists, as "0, 0; 100, 0; 100, 50"; throws RangeError for any other text. */
export function cornersIn(text) {
  const corners = text.split(";").filter((part) => part.trim()).map(pairIn);
  if (corners.length < 3 || corners.includes(null)) throw new RangeError("write three corners or more, such as 0, 0; 100, 0; 100, 50");
  return corners;
}

/** Return lists and objects of pairs of numbers, such as polygons, with each pair converted; all else stays. */
export function eachPlace(value, convert) {
  if (value === null || typeof value !== "object") return value;
  if (!Array.isArray(value)) return Object.fromEntries(Object.entries(value).map(([name, inner]) => [name, eachPlace(inner, convert)]));
  if (value.length === 2 && value.every((number) => typeof number === "number")) return convert(value);
  return value.map((inner) => eachPlace(inner, convert));
}

/** A field of polygons, read and changed in the coordinates of the moment; corners that are not typed anew stay. */
export function placedField(store, { read, change }) {
  const cornersIn = (value, { of, shown }) => eachPlace(value, (point) => of(point).map(shown));
  return {
    unitOf: () => coordinatesOf(store).field.unit,
    read: (scenario) => cornersIn(read(scenario), coordinatesOf({ scenario, degrees: store.degrees })),
    change: (before, value) => {
      const coordinates = coordinatesOf({ scenario: before, degrees: store.degrees });
      const known = new Map();
      eachPlace(read(before), (point) => known.set(`${cornersIn(point, coordinates)}`, point));
      return change(before, eachPlace(value, (pair) => known.get(`${pair}`) ?? coordinates.taken(pair)));
    },
  };
}

/** The switch between metres and degrees, as it was left at the last visit. */
export function offerDegrees(store) {
  const pressed = byId("degrees");
  const usual = pressed.title;
  const show = () => {
    const may = Boolean(store.scenario?.geo_origin);
    pressed.setAttribute("aria-disabled", !may);
    pressed.setAttribute("aria-pressed", may && store.degrees);
    pressed.title = may ? usual : NO_ORIGIN;
  };
  pressed.addEventListener("click", () => {
    if (!store.scenario?.geo_origin) {
      notice(NO_ORIGIN);
      return;
    }
    store.showDegrees(!store.degrees);
    keepDegrees(store.degrees);
  });
  store.on(["opened", "scenario", "degrees"], show);
  store.showDegrees(keptDegrees());
}
