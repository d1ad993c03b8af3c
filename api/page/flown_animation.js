// A flown trial as an animation of the map: where vehicles were, and where they were taken to be.

const TRUE_COLOUR = "#0072b2";
const ESTIMATE_COLOUR = "#d55e00";
/** entries of the legend for what the plan's own animation moves */
const OF_MOVING = ["directions-entry", "vehicles-entry"];
/** how much of a period stays on show behind each vehicle */
const TAIL_SHARE = 0.25;

/** Return the animation of a track; `plan` is that of the plan, `times` are in s.
 *
 * Of the plan's own animation, what does not move stays.
 */
export function flownAnimation(plan, track, times, period) {
  const moving = new Set(plan.frames[0].traces);
  const still = plan.data.filter((one, k) => !moving.has(k) && !OF_MOVING.includes(one.uid));
  const tail = Math.max(1, Math.round((TAIL_SHARE * period) / (times[1] - times[0] || period)));
  const frame = (k) => [tails(track, Math.max(0, k - tail), k), places(track, "true", k), places(track, "estimated", k)];
  const [line, real, taken] = frame(0);
  const looks = [
    { ...line, name: "path just flown", type: "scatter", mode: "lines", line: { color: TRUE_COLOUR, width: 2 }, hoverinfo: "skip" },
    { ...real, name: "true place", type: "scatter", mode: "markers", marker: { color: TRUE_COLOUR, size: 11 } },
    { ...taken, name: "estimated place", type: "scatter", mode: "markers", marker: { color: ESTIMATE_COLOUR, size: 15, symbol: "circle-open", line: { width: 2 } } },
  ];
  const traces = looks.map((_, k) => still.length + k);
  return {
    data: [...still, ...looks.map((one, k) => ({ ...one, uid: `flown-${k}` }))],
    layout: { ...plan.layout, title: { subtitle: { text: `Flight ${track.trial + 1}` } } },
    frames: times.map((_, k) => ({ data: frame(k), traces })),
    times,
  };
}

function places({ vehicles }, which, k) {
  return {
    x: vehicles.map((one) => one[`${which}_x_m`][k]),
    y: vehicles.map((one) => one[`${which}_y_m`][k]),
    text: vehicles.map((one) => one.name),
  };
}

/** The true paths from one moment to another, with a gap between vehicles. */
function tails({ vehicles }, first, last) {
  const path = (axis) => vehicles.flatMap((one) => [...one[`true_${axis}_m`].slice(first, last + 1), null]);
  return { x: path("x"), y: path("y") };
}
