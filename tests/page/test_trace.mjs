// Numbers of the form: their steps, and the errors charted against them.

import assert from "node:assert/strict";
import test from "node:test";
import { degreesBeside, shown } from "../../api/page/elements.js";
import { stepOf } from "../../api/page/scrubbing.js";
import { around, errorAt, worstOf } from "../../api/page/trace.js";

test("the step of a number is a tenth of its decade, whatever its sign", () => {
  assert.deepEqual([50, 0.2, -360, 1000, 0.05].map((value) => stepOf(value)), [1, 0.01, 10, 100, 0.001]);
  assert.deepEqual([stepOf(0, "°"), stepOf(NaN, "m"), stepOf(0, "rad")], [10, 1, 0.1]);
});

test("the worst error is known only where that of every vehicle is", () => {
  const plan = (vehicles) => ({ predicted_rms_m: { vehicles } });
  assert.equal(worstOf(plan({ v1: 0.5, v2: 0.75 })), 0.75);
  assert.equal(worstOf(plan({ v1: 0.5, v2: null })), null);
  assert.equal(worstOf(plan({})), null);
});

test("values around one keep away from limits and from points that there are", () => {
  assert.deepEqual(around(50, new Map([[50, 1]]), {}), [45, 55, 40, 60, 35, 65]);
  assert.deepEqual(around(50, new Map([[50, 1], [35, 2], [56, 1]]), {}), [45, 40, 60, 65]);
  assert.deepEqual(around(360, new Map([[360, 1]]), { min: 0, max: 360, unit: "°" }), [324, 288, 252]);
  assert.ok(around(0.1, new Map([[0.1, 1], [0.6, 1]]), { min: 0 }).every((one) => one > 0));
});

test("an error that is not known is said to be so", () => {
  assert.equal(errorAt(50, 0.41234, "m"), "0.412 m at 50 m");
  assert.equal(errorAt(0.25, null), "no error known at 0.25");
});

test("a length under a tenth of a millimetre is a rounding error", () => {
  assert.deepEqual([shown(2.41e-5, "m"), shown(-3e-15, "m"), shown(6e-5, "m")], ["0 m", "0 m", "0.0001 m"]);
  assert.equal(shown(2.41e-5, "s"), "0.0000241 s");
});

test("numbers have three digits and all before the point, angles are said in degrees, too", () => {
  assert.deepEqual([shown(0.78641), shown(1234.56, "m"), shown(-1234.56), shown(99.96, "s"), shown(0)], ["0.786", "1235 m", "-1235", "100 s", "0"]);
  assert.deepEqual([degreesBeside(0.05, "rad"), degreesBeside(-0.2, "rad/s"), degreesBeside(0, "rad"), degreesBeside(5, "m")], [" = 2.86°", " = -11.5°/s", "", ""]);
});
