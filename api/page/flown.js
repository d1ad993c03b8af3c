// A moment of a flown trial: where vehicles were, the path just flown, and where they were taken to be.

/** how much of a period stays on show behind each vehicle */
const TAIL_SHARE = 0.25;

/** Marks of a track at a time in s; `times` are those of its places. */
export function momentOfFlight({ vehicles }, times, period, time) {
  const step = times[1] - times[0] || period;
  const k = Math.min(Math.round((time - times[0]) / step), times.length - 1);
  const first = Math.max(0, k - Math.max(1, Math.round((TAIL_SHARE * period) / step)));
  const there = vehicles.filter((one) => one.true_x_m[k] !== null);
  return there.flatMap((one) => {
    const place = (which, i) => [one[`${which}_x_m`][i], one[`${which}_y_m`][i]];
    const path = Array.from({ length: k - first + 1 }, (_, i) => place("true", first + i));
    const [from, to] = [path[path.length - 2] ?? path[0], path[path.length - 1]];
    const heading = Math.atan2(to[1] - from[1], to[0] - from[0]);
    return [
      ...(path.length > 1 ? [{ kind: "tail", path }] : []),
      { kind: "vehicle", place: to, heading },
      { kind: "estimate", place: place("estimated", k) },
    ];
  });
}
