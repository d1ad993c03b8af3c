// Where vehicles are and when they are within reach: the closed form beside samples of the period.

import assert from "node:assert/strict";
import test from "node:test";
import { placeAt, withinReach } from "../../api/page/geometry.js";

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
