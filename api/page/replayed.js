// A replay of a recording on the map, in place of the plan, until it is ended: paths, landmarks, and robots that move.

import { chip, shown } from "./elements.js";

/** Return what shows the report of a replay on the map and lets it be played. */
export function offerReplays(store, map, player) {
  const line = chip("End replay", end);
  store.on(["scenario", "opened"], end);
  return show;

  function show({ name, position_rmse_m: error, paths }) {
    const { vehicles, track_time_s: times, landmarks } = paths;
    line.say(`Replay of ${name}, dashed: estimated${error === null ? "" : `, RMS error ${shown(error, "m")}`}`);
    map.instead([
      ...vehicles.flatMap((vehicle) => ["true", "estimated"].flatMap((which) => pathsOf(vehicle, which))),
      ...landmarks.map(({ name: title, position_m: place }) => ({ kind: "landmark", name: title, place })),
    ]);
    // where no truth is known, a robot is where it is taken to be
    const known = error === null ? vehicles.map((robot) => ({ ...robot, true_x_m: robot.estimated_x_m, true_y_m: robot.estimated_y_m })) : vehicles;
    player.offer({ series: { tracks: [{ trial: 0, vehicles: known }], track_time_s: times, ground: { landmarks } } }, { alone: true });
  }

  function end() {
    if (!line.hide()) return;
    map.instead(null);
    player.offer();
  }
}

/** The true or estimated path of a robot, in parts where it is known. */
function pathsOf(vehicle, which) {
  const [xs, ys] = ["x", "y"].map((axis) => vehicle[`${which}_${axis}_m`]);
  /** @type {number[][][]} */
  const parts = [[]];
  for (const [i, x] of xs.entries()) {
    if (x === null) parts.push([]);
    else parts[parts.length - 1].push([x, ys[i]]);
  }
  return parts.filter((path) => path.length > 1).map((path) => ({ kind: which === "true" ? "path" : "beside", path }));
}
