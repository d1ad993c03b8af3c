// Where points of the plane lie on the earth: the plane touches the ellipsoid WGS 84 at the origin.

import { decade } from "./scenario.js";

export const MAJOR_M = 6378137;
const FLATTENING = 1 / 298.257223563;
const MINOR_M = MAJOR_M * (1 - FLATTENING);
/** squares of the first and second eccentricity */
const FIRST = FLATTENING * (2 - FLATTENING);
const SECOND = FIRST / (1 - FIRST);
export const DEGREE = Math.PI / 180;
const STEPS = [1, 2, 5, 10];
/** beyond this, the plane is no ground any more */
export const WIDEST_M = 1e6;
/** decimals of an origin that is not given */
const ORIGIN_DIGITS = 7;
/** points of a line of the graticule: it is curved, if little */
const POINTS = 9;

/** @typedef {{lat_deg: number, lon_deg: number}} Origin */

/** [latitude, longitude] in degrees of a point [x, y] in m: Bowring's closed form, good to a millimetre.
 * @param {Origin} origin @param {number[]} point */
export function placeOf(origin, point) {
  const [x, y] = point;
  const { lat, lon, from } = frameOf(origin);
  const out = -y * Math.sin(lat);
  const [px, py, pz] = [from[0] + out * Math.cos(lon) - x * Math.sin(lon), from[1] + out * Math.sin(lon) + x * Math.cos(lon), from[2] + y * Math.cos(lat)];
  const axis = Math.hypot(px, py);
  const angle = Math.atan2(pz * MAJOR_M, axis * MINOR_M);
  const north = Math.atan2(pz + SECOND * MINOR_M * Math.sin(angle) ** 3, axis - FIRST * MAJOR_M * Math.cos(angle) ** 3);
  return [north / DEGREE, Math.atan2(py, px) / DEGREE];
}

/** The point [x, y] in m where the normal of the ellipsoid at a place in degrees meets the plane: what placeOf leads
 * back from. NaN on the other half of the earth.
 * @param {Origin} origin @param {number[]} place */
export function pointOf(origin, place) {
  const [latitude, longitude] = place.map((value) => value * DEGREE);
  const { lat, lon, from } = frameOf(origin);
  /** @param {number[]} vector */
  const turned = ([x, y, z]) => {
    const out = x * Math.cos(lon) + y * Math.sin(lon);
    return [y * Math.cos(lon) - x * Math.sin(lon), z * Math.cos(lat) - out * Math.sin(lat), z * Math.sin(lat) + out * Math.cos(lat)];
  };
  const [x, y, up] = turned(onEllipsoid(latitude, longitude).map((value, k) => value - from[k]));
  const [east, north, rise] = turned([Math.cos(latitude) * Math.cos(longitude), Math.cos(latitude) * Math.sin(longitude), Math.sin(latitude)]);
  const share = rise > 0 ? -up / rise : Number.NaN;
  return [x + share * east, y + share * north];
}

/** The point [x, y] in m of a place in degrees, where the plane is ground; throws RangeError elsewhere.
 * @param {Origin} origin @param {number[]} place */
export function groundPointOf(origin, place) {
  const point = pointOf(origin, place);
  if (Math.abs(place[0]) <= 90 && Math.hypot(...point) <= WIDEST_M) return point;
  throw new RangeError(`${place.join(", ")} is no place within ${WIDEST_M / 1000} km of the scenario's origin, ${placeWords([origin.lat_deg, origin.lon_deg])}`);
}

/** The middle of places in degrees, that of their extent in the plane. @param {number[][]} places @returns {Origin} */
export function middleOf(places) {
  const sums = places.map(([lat, lon]) => onEllipsoid(lat * DEGREE, lon * DEGREE)).reduce((sum, vector) => sum.map((value, k) => value + vector[k]));
  const about = { lat_deg: Math.atan2(sums[2], Math.hypot(sums[0], sums[1])) / DEGREE, lon_deg: Math.atan2(sums[1], sums[0]) / DEGREE };
  const points = places.map((place) => groundPointOf(about, place));
  const middle = [0, 1].map((k) => spread(points.map((point) => point[k]))).map(([least, most]) => (least + most) / 2);
  const [lat_deg, lon_deg] = placeOf(about, middle).map((value) => Number(value.toFixed(ORIGIN_DIGITS)));
  return { lat_deg, lon_deg };
}

function frameOf({ lat_deg, lon_deg }) {
  const [lat, lon] = [lat_deg * DEGREE, lon_deg * DEGREE];
  return { lat, lon, from: onEllipsoid(lat, lon) };
}

function onEllipsoid(lat, lon) {
  const normal = MAJOR_M / Math.sqrt(1 - FIRST * Math.sin(lat) ** 2);
  return [normal * Math.cos(lat) * Math.cos(lon), normal * Math.cos(lat) * Math.sin(lon), normal * (1 - FIRST) * Math.sin(lat)];
}

/** Lines of latitude and longitude across a part [west, south, east, north] in m of the plane, so many m apart
 * or somewhat more: each with its points, from the edge where its coordinate is written.
 * @param {Origin} origin @param {number[]} extent @param {number} apart
 * @returns {{along: "parallel" | "meridian", path: number[][], name: string}[]} */
export function graticuleOf(origin, [west, south, east, north], apart) {
  const corners = [[west, south], [east, south], [east, north], [west, north], [(west + east) / 2, south], [(west + east) / 2, north]].map((one) => placeOf(origin, one));
  const [lats, lons] = [0, 1].map((k) => spread(corners.map((one) => one[k])));
  const degree = DEGREE * MAJOR_M;
  const parallels = linesAt(lats, apart / degree).map(([lat, digits]) => ({
    along: /** @type {const} */ ("parallel"),
    path: sampled(lons).reverse().map((lon) => pointOf(origin, [lat, lon])),
    name: words(lat, "N", "S", digits),
  }));
  const meridians = linesAt(lons, apart / (degree * Math.cos(origin.lat_deg * DEGREE))).map(([lon, digits]) => ({
    along: /** @type {const} */ ("meridian"),
    path: sampled(lats).map((lat) => pointOf(origin, [lat, lon])),
    name: words(lon, "E", "W", digits),
  }));
  return [...parallels, ...meridians];
}

/** A latitude or longitude in words. */
function words(degrees, positive, negative, digits) {
  return `${Math.abs(degrees).toFixed(digits)}° ${degrees < 0 ? negative : positive}`;
}

/** A place in words, to a tenth of a metre or so. @param {number[]} place */
export function placeWords(place) {
  const [lat, lon] = place;
  return `${words(lat, "N", "S", 6)}, ${words(lon, "E", "W", 6)}`;
}

/** Round values between two, and the digits that they need: at least `least` apart, by 1, 2 or 5. */
export function linesAt([from, to], least) {
  const unit = decade(least);
  const step = unit * (STEPS.find((one) => one * unit >= least) ?? 10);
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  const first = Math.ceil(from / step);
  return Array.from({ length: Math.max(0, Math.floor(to / step) - first + 1) }, (_, k) => [(first + k) * step, digits]);
}

/** The least and the largest of some values. @returns {[number, number]} */
function spread(values) {
  return [Math.min(...values), Math.max(...values)];
}

function sampled([from, to]) {
  return Array.from({ length: POINTS }, (_, k) => from + ((to - from) * k) / (POINTS - 1));
}
