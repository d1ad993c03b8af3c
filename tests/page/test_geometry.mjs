// Where vehicles are and when they are within reach: the closed form beside samples of the period.

import assert from "node:assert/strict";
import test from "node:test";
import { covarianceAt, magnificationOf } from "../../api/page/ellipses.js";
import { ellipseOf, placeAt, withinReach } from "../../api/page/geometry.js";
import { settled } from "../../api/page/marks.js";
import { placesIn } from "../../api/page/scenario.js";

const TURN = 2 * Math.PI;
const SAMPLES = 400;

/** Numbers in [0, 1) from a seed, the same on any machine. */
function drawn(seed) {
  let state = seed;
  return () => {
    state = (state * 1103515245 + 12345) % 2 ** 31;
    return state / 2 ** 31;
  };
}

function circle(next, radius = 5 + 30 * next()) {
  return { x: 80 * next(), y: 80 * next(), radius, phase: TURN * next(), sense: next() < 0.5 ? 1 : -1 };
}

function distanceAt(a, b, turned) {
  const [one, other] = [placeAt(a, turned), placeAt(b, turned)];
  return Math.hypot(one.x - other.x, one.y - other.y);
}

const covers = (intervals, turned) => intervals.some(([from, to]) => (turned >= from && turned <= to) || (turned + TURN >= from && turned + TURN <= to));

test("two are within reach where a sampled period says so, circles and landmarks alike", () => {
  const next = drawn(31);
  let found = 0;
  for (let draw = 0; draw < 1000; draw++) {
    const [a, b] = [circle(next), draw % 5 ? circle(next) : circle(next, 0)];
    const reach = 10 + 60 * next();
    const intervals = withinReach(a, b, reach);
    found += intervals.length;
    for (let k = 0; k < SAMPLES; k++) {
      const turned = (TURN * (k + 0.5)) / SAMPLES;
      const distance = distanceAt(a, b, turned);
      if (Math.abs(distance - reach) > 1e-6) assert.equal(covers(intervals, turned), distance <= reach, `draw ${draw}`);
    }
  }
  assert.ok(found > 500);
});

test("at the ends of an interval two are at reach", () => {
  const next = drawn(47);
  for (let draw = 0; draw < 1000; draw++) {
    const [a, b, reach] = [circle(next), circle(next), 10 + 60 * next()];
    for (const [from, to] of withinReach(a, b, reach)) {
      if (to - from > TURN - 1e-9) continue;
      for (const end of [from, to]) assert.ok(Math.abs(distanceAt(a, b, end) - reach) < 1e-9, `draw ${draw}`);
    }
  }
});

test("circles of one sense with equal arms keep their distance, and are within reach always or never", () => {
  const a = { x: 0, y: 0, radius: 20, phase: 1, sense: 1 };
  const b = { ...a, x: 30 };
  assert.deepEqual(withinReach(a, b, 31), [[0, TURN]]);
  assert.deepEqual(withinReach(a, b, 29), []);
});

test("the half axes of an ellipse give back its covariance, and stretch along the longer one", () => {
  const next = drawn(53);
  for (let draw = 0; draw < 500; draw++) {
    const [p, q, r] = [next(), next() - 0.5, next()];
    const covariance = /** @type {[number, number, number]} */ ([p * p + q * q, q * (p + r), r * r + q * q]);
    const { major, minor, angle } = ellipseOf(covariance);
    const [c, s] = [Math.cos(angle), Math.sin(angle)];
    const again = [(major * c) ** 2 + (minor * s) ** 2, (major ** 2 - minor ** 2) * c * s, (major * s) ** 2 + (minor * c) ** 2];
    for (const [k, value] of again.entries()) assert.ok(Math.abs(value - covariance[k]) < 1e-12, `draw ${draw}`);
    assert.ok(major >= minor);
  }
  assert.deepEqual(ellipseOf([4, 0, 9]), { major: 3, minor: 2, angle: Math.PI / 2 });
  // rounded to what is no covariance any more
  assert.equal(ellipseOf([1, 1.0001, 1]).minor, 0);
});

test("a moment's covariance is that of the last period, between two moments in proportion", () => {
  // a run of 25 s in periods of 10 s: 3 s into the period is 23 s, and 7 s is 17 s
  const found = { time_s: [17, 19, 21, 23, 25], vehicles: { v1: [1, 2, 3, 4, 5].map((one) => /** @type {[number, number, number]} */ ([one, 0, 2 * one])) } };
  assert.deepEqual(covarianceAt(found, "v1", 3, 10), [4, 0, 8]);
  assert.deepEqual(covarianceAt(found, "v1", 7, 10), [1, 0, 2]);
  assert.deepEqual(covarianceAt(found, "v1", 0, 10), [2.5, 0, 5]);
  // before the first moment, that one holds
  assert.deepEqual(covarianceAt(found, "v1", 6, 10), [1, 0, 2]);
  assert.equal(covarianceAt(found, "v2", 0, 10), null);
  // a run that ends after 25 s of a period of 40 s
  assert.equal(covarianceAt(found, "v1", 26, 40), null);
});

test("ellipses are magnified by a round number up to half the mean radius, and never shrunk", () => {
  const of = (sigma) => magnificationOf({ time_s: [1], vehicles: { v1: [[sigma ** 2, 0, 0]] } }, [{ radius_m: 30 }, { radius_m: 10 }]);
  // 95 % lie within 2.4477 sigma: 10 m is 4.0855 sigma of 1 m
  assert.deepEqual([1, 0.4, 0.04, 3, 5, 0].map(of), [2, 10, 100, 1, 1, 1]);
  assert.deepEqual([4.0855 / 2.01, 4.0855 / 1.99].map(of), [2, 1]);
});

test("places are told apart far from the origin too", () => {
  const scenario = (x, y) => ({ orbit: { radius_m: 20, direction: "ccw" }, sensor: {}, formation: { centers_m: [[x, y], [x + 70, y]] } });
  const near = placesIn(scenario(0, 0));
  assert.equal(near({ x: 19.1067, y: -0.5 }), "19.11, -0.5 m");
  const far = placesIn(scenario(465000, 5249000));
  assert.equal(far({ x: 465023.44, y: 5249000 }), "465023.4, 5249000 m");
  assert.notEqual(far({ x: 465000, y: 5249000 }), far({ x: 465000.2, y: 5249000 }));
});

test("in a drag, vehicles that a phase shifts by less than a distance stay as they are drawn", () => {
  const team = (...phases) => phases.map((phase, k) => ({ name: `v${k + 1}`, x: 50 * k, y: 0, radius: 20, phase, sense: 1 }));
  const drawn = team(0, 0, 0, 0);
  // on a circle of 20 m, 0.04 rad are 0.8 m, and 0.06 rad 1.2 m; a turn more is the same place
  const phases = (circles) => circles.map(({ phase }) => phase);
  assert.deepEqual(phases(settled(team(0.04, -0.04, 0.06, 2 * Math.PI + 0.04), drawn, 1)), [0, 0, 0.06, 0]);
  // another vehicle, or one that was not drawn
  assert.deepEqual(phases(settled(team(0.04, 0.04), [{ ...drawn[0], name: "w" }], 1)), [0.04, 0.04]);
  assert.deepEqual(phases(settled(team(0.04), [], 1)), [0.04]);
});
