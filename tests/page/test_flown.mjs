// A moment of a flown trial: vehicles, and what happens where.

import assert from "node:assert/strict";
import test from "node:test";
import { eventsAt, momentOfFlight } from "../../api/page/flown.js";

const TIMES = [0, 10, 20, 30];
const track = (name, x) => ({ name, true_x_m: x, true_y_m: [0, 1, 2, 3], estimated_x_m: x, estimated_y_m: [0, 1, 2, 3] });
const TRACK = { vehicles: [track("v1", [5, 6, null, null]), track("av1", [1, 2, 3, 4])] };
const SERIES = { times: TIMES, landmarks: [{ name: "L1", position_m: [7, 8] }] };
const LOSS = { subject: "v1", begin_s: 18, end_s: null, what: "v1 is lost at 18 s" };
const HOLD = { subject: "av1", begin_s: 10, end_s: 20, what: "av1 is held" };
const SENSOR = { subject: "sensor of av1", begin_s: 0, end_s: null, what: "the sensor of av1 is lost" };
const MARK = { subject: "L1", begin_s: 0, end_s: null, what: "L1 is lost" };

test("a hold goes on until it ends, a loss for good", () => {
  const at = (time) => eventsAt([LOSS, HOLD], time);
  assert.deepEqual([at(0), at(10), at(18), at(20), at(30)], [[], [HOLD], [LOSS, HOLD], [LOSS], [LOSS]]);
});

test("events are marked where their subjects were when they began", () => {
  const marks = momentOfFlight(TRACK, SERIES, 100, 30, [LOSS, HOLD, SENSOR, MARK]);
  const events = marks.filter(({ kind }) => kind === "event");
  assert.deepEqual(events.map(({ name, place }) => [name, place]), [
    ["v1 is lost at 18 s", [6, 1]],
    ["av1 is held", [2, 1]],
    ["the sensor of av1 is lost", [1, 0]],
    ["L1 is lost", [7, 8]],
  ]);
  assert.equal(marks.filter(({ kind }) => kind === "vehicle").length, 1);
});

test("an event of what the tracks do not have is not marked", () => {
  assert.deepEqual(momentOfFlight({ vehicles: [] }, SERIES, 100, 0, [LOSS]), []);
});
