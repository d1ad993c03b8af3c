// A moment of a flown trial: where vehicles were, the path just flown, and where they were taken to be.

/** how much of a period stays on show behind each vehicle */
const TAIL_SHARE = 0.25;

/** What goes on at a time in s: a hold until it ends, a loss from its moment on. */
export function eventsAt(events, time) {
  return events.filter(({ begin_s: begin, end_s: end }) => begin <= time && (end === null || time < end));
}

/** Marks of a track at a time in s, and of events where they began; `times` are those of its places. */
export function momentOfFlight({ vehicles }, { times, landmarks }, period, time, events = []) {
  const step = times[1] - times[0] || period;
  const at = (moment) => Math.min(Math.round((moment - times[0]) / step), times.length - 1);
  const k = at(time);
  const first = Math.max(0, k - Math.max(1, Math.round((TAIL_SHARE * period) / step)));
  const there = vehicles.filter((one) => one.true_x_m[k] !== null);
  const marks = there.flatMap((one) => {
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
  const begun = events.map((one) => ({ kind: "event", name: one.what, place: placeOf(one, vehicles, landmarks, at(one.begin_s)) }));
  return [...marks, ...begun.filter(({ place }) => place)];
}

/** Where an event's subject is at step `k` of a track, or was last: a vehicle, a sensor of one, a landmark. */
function placeOf({ subject }, vehicles, landmarks, k) {
  const named = ({ name }) => subject === name || subject.endsWith(` of ${name}`);
  const { true_x_m: x, true_y_m: y } = vehicles.find(named) ?? {};
  const last = x?.findLastIndex((value, i) => i <= k && value !== null) ?? -1;
  return last < 0 ? landmarks.find(named)?.position_m : [x[last], y[last]];
}
