// Circles flown at one rate: where vehicles are, and when they are within reach, in closed form.
//
// With z = exp(i tau) for the angle tau turned since time 0, the vector from a to b is
//
//     q = D + u z + v / z        D from centre to centre; u sums the arms that turn counter-clockwise
//                                (b's less a's), v those that turn clockwise
//
// so |q|^2 is a constant, plus twice the real part of p z + w z^2. Where w is zero, as for one sense
// and for landmarks, it is within reach over one interval about its least value. Otherwise its
// edges are the roots on the unit circle of a polynomial of degree four.

/** @typedef {{x: number, y: number, radius: number, phase: number, sense: number}} Circle */
/** @typedef {[number, number]} Complex real and imaginary part */

/** A full turn in rad. */
export const TURN = 2 * Math.PI;
const ROUNDS = 200;
const SETTLED = 1e-14;
const ON_CIRCLE = 1e-5;

/** Where a vehicle is after an angle was turned, in m; a landmark has no radius.
 * @param {Circle} circle
 * @param {number} turned rad */
export function placeAt({ x, y, radius, phase, sense }, turned) {
  const angle = phase + sense * turned;
  return { x: x + radius * Math.cos(angle), y: y + radius * Math.sin(angle) };
}

/** Half axes in m of a covariance's 1-sigma ellipse, and the direction of the longer one in rad.
 * @param {[number, number, number]} covariance xx, xy and yy in m^2 */
export function ellipseOf([xx, xy, yy]) {
  const [middle, off] = [(xx + yy) / 2, Math.hypot((xx - yy) / 2, xy)];
  // rounding may leave a narrow one with a variance below zero
  return { major: Math.sqrt(middle + off), minor: Math.sqrt(Math.max(middle - off, 0)), angle: Math.atan2(2 * xy, xx - yy) / 2 };
}

/** Whether a point lies in a polygon: a ray from it crosses an odd number of edges.
 * @param {number[][]} corners
 * @param {{x: number, y: number}} point */
export function within(corners, { x, y }) {
  const crossed = edges(corners).filter(([[ax, ay], [bx, by]]) => ay > y !== by > y && x < ax + ((y - ay) * (bx - ax)) / (by - ay));
  return crossed.length % 2 === 1;
}

/** The distance in m from a point to the nearest edge of a polygon.
 * @param {number[][]} corners
 * @param {{x: number, y: number}} point */
export function toEdges(corners, { x, y }) {
  return Math.min(
    ...edges(corners).map(([[ax, ay], [bx, by]]) => {
      const [dx, dy] = [bx - ax, by - ay];
      const along = ((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy || 1);
      const share = Math.min(Math.max(along, 0), 1);
      return Math.hypot(x - ax - share * dx, y - ay - share * dy);
    }),
  );
}

/** The edges of a polygon, from corner to corner.
 * @param {number[][]} corners */
export function edges(corners) {
  return corners.map((corner, k) => [corner, corners[(k + 1) % corners.length]]);
}

/** Intervals [from, to] of angles turned, from in [0, 2 pi), at which two are within reach of each other.
 * @param {Circle} a
 * @param {Circle} b
 * @param {number} reach m
 * @returns {[number, number][]} */
export function withinReach(a, b, reach) {
  const { constant, p, w } = squaredDistance(a, b);
  const above = constant - reach ** 2;
  const value = (/** @type {number} */ tau) => above + 2 * (real(p, tau) + real(w, 2 * tau));
  const edges = length(w) > 0 ? quarticEdges(above, p, w) : cosineEdges(above, p);
  const turns = edges.map((tau) => ((tau % TURN) + TURN) % TURN).sort((one, other) => one - other);
  if (!turns.length) return value(0) <= 0 ? [[0, TURN]] : [];
  return turns
    .map((from, k) => /** @type {[number, number]} */ ([from, k + 1 < turns.length ? turns[k + 1] : turns[0] + TURN]))
    .filter(([from, to]) => to > from && value((from + to) / 2) <= 0);
}

/** @param {Circle} a
 * @param {Circle} b */
function squaredDistance(a, b) {
  /** @type {Complex} */
  const D = [b.x - a.x, b.y - a.y];
  const u = arms(a, b, 1);
  const v = arms(a, b, -1);
  const [du, dv, uv] = [times(conjugate(D), u), times(D, conjugate(v)), times(u, conjugate(v))];
  return {
    constant: D[0] ** 2 + D[1] ** 2 + length(u) ** 2 + length(v) ** 2,
    p: /** @type {Complex} */ ([du[0] + dv[0], du[1] + dv[1]]),
    w: uv,
  };
}

/** @param {Circle} a
 * @param {Circle} b
 * @param {number} sense
 * @returns {Complex} */
function arms(a, b, sense) {
  const [ours, theirs] = [a, b].map((one) => (one.sense === sense ? one.radius : 0));
  return [
    theirs * Math.cos(b.phase) - ours * Math.cos(a.phase),
    theirs * Math.sin(b.phase) - ours * Math.sin(a.phase),
  ];
}

/** Angles at which above + 2 Re(p z) is zero.
 * @param {number} above
 * @param {Complex} p */
function cosineEdges(above, p) {
  const cosine = -above / (2 * length(p));
  if (!(Math.abs(cosine) < 1)) return [];
  const middle = -Math.atan2(p[1], p[0]);
  const half = Math.acos(cosine);
  return [middle - half, middle + half];
}

/** Angles at which above + 2 Re(p z + w z^2) is zero: roots by Durand and Kerner's simultaneous iteration.
 * @param {number} above
 * @param {Complex} p
 * @param {Complex} w */
function quarticEdges(above, p, w) {
  const size = length(w);
  /** @type {Complex} */
  const unit = [w[0] / size ** 2, -w[1] / size ** 2];
  const [b, c, d, e] = [p, /** @type {Complex} */ ([above, 0]), conjugate(p), conjugate(w)].map((one) => times(one, unit));
  const start = 1 + Math.max(...[b, c, d].map(length)) ** 0.25;
  /** @type {Complex[]} */
  const roots = [0, 1, 2, 3].map((k) => [start * Math.cos(0.4 + (k * TURN) / 4), start * Math.sin(0.4 + (k * TURN) / 4)]);
  for (let round = 0; round < ROUNDS; round++) {
    let moved = 0;
    for (let k = 0; k < 4; k++) {
      const z = roots[k];
      const value = [b, c, d, e].reduce((sum, one) => plus(times(sum, z), one), /** @type {Complex} */ ([1, 0]));
      const others = roots.reduce((product, one, j) => (j === k ? product : times(product, [z[0] - one[0], z[1] - one[1]])), /** @type {Complex} */ ([1, 0]));
      const by = over(value, others);
      roots[k] = [z[0] - by[0], z[1] - by[1]];
      moved = Math.max(moved, length(by) / Math.max(length(z), 1));
    }
    if (moved < SETTLED) break;
  }
  return roots.filter((one) => Math.abs(length(one) - 1) < ON_CIRCLE).map(([x, y]) => Math.atan2(y, x));
}

/** Real part of a number times exp(i angle).
 * @param {Complex} number
 * @param {number} angle */
function real([x, y], angle) {
  return x * Math.cos(angle) - y * Math.sin(angle);
}

/** @param {Complex} number */
function length([x, y]) {
  return Math.hypot(x, y);
}

/** @param {Complex} number
 * @returns {Complex} */
function conjugate([x, y]) {
  return [x, -y];
}

/** @param {Complex} one
 * @param {Complex} other
 * @returns {Complex} */
function plus(one, other) {
  return [one[0] + other[0], one[1] + other[1]];
}

/** @param {Complex} one
 * @param {Complex} other
 * @returns {Complex} */
function times([a, b], [c, d]) {
  return [a * c - b * d, a * d + b * c];
}

/** @param {Complex} one
 * @param {Complex} other
 * @returns {Complex} */
function over([a, b], [c, d]) {
  const size = c * c + d * d || Number.MIN_VALUE;
  return [(a * c + b * d) / size, (b * c - a * d) / size];
}
