// Numbers dragged by their labels, sideways: each pixel is a step.

import { decade, rounded } from "./scenario.js";

/** What stands for the decade of a zero, by unit; 1 for others. */
const DECADES = { "°": 100, m: 10, s: 10 };
/** Steps in a decade: of arrow keys, and pixels of a drag. */
const STEPS = 10;
const PIXELS = 100;
const LONG = 10;
/** Digits without the noise of the last ones. */
const DIGITS = 12;
const TREMOR_PX = 4;

/** Return the step of the arrow keys for a value: a tenth of its decade. */
export function stepOf(value, unit = "") {
  return rounded((value ? decade(Math.abs(value)) : (DECADES[unit] ?? 1)) / STEPS, DIGITS);
}

/** Let the number of an input be dragged by its label. The edits are one step to undo, and the last one rests. */
export function scrubbed(label, input) {
  /** @type {{x: number, value: number, step: number, moved: boolean} | null} */
  let held = null;
  let dragged = false;
  const enter = (value, how) => {
    input.value = value;
    input.dispatchEvent(new CustomEvent("input", { bubbles: true, detail: how }));
  };
  label.addEventListener("pointerdown", (event) => {
    dragged = false;
    // what differs among vehicles, or is half typed, has no value to begin with
    if (event.button !== 0 || input.placeholder || input.validity.badInput) return;
    label.setPointerCapture(event.pointerId);
    held = { x: event.clientX, value: input.valueAsNumber || 0, step: (Number(input.step) * STEPS) / PIXELS, moved: false };
  });
  label.addEventListener("pointermove", (event) => {
    if (!held) return;
    const by = event.clientX - held.x;
    if (!held.moved && Math.abs(by) < TREMOR_PX) return;
    const { min, max } = input;
    held.value += by * held.step * (event.shiftKey ? LONG : 1);
    held.value = Math.min(Math.max(held.value, min === "" ? -Infinity : Number(min)), max === "" ? Infinity : Number(max));
    held.x = event.clientX;
    const value = rounded(Math.round(held.value / held.step) * held.step, DIGITS);
    if (value === input.valueAsNumber) return;
    enter(value, { step: !held.moved });
    held.moved = dragged = true;
  });
  for (const name of ["pointerup", "pointercancel", "lostpointercapture"]) {
    label.addEventListener(name, () => {
      if (held?.moved) enter(input.value, { step: false, live: false });
      held = null;
    });
  }
  // a click on a label puts the focus on its field, and a keyboard on a phone
  label.addEventListener("click", (event) => dragged && event.preventDefault());
}
