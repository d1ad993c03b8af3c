// Places on the earth beside those that pymap3d 3.2 gives: enu2geodetic(x, y, 0, lat, lon, 0).

import assert from "node:assert/strict";
import test from "node:test";
import { graticuleOf, placeOf, placeWords, pointOf } from "../../api/page/earth.js";

const GOLDEN = [
  [[47.3977, 8.5456], [190, 70], [47.3983295899, 8.5481169262]],
  [[47.3977, 8.5456], [-2500, 4000], [47.4336732408, 8.5124603894]],
  [[47.3977, 8.5456], [9000, -7000], [47.3346760613, 8.6646793740]],
  [[-33.9, 151.2], [190, 70], [-33.8993689007, 151.2020541965]],
  [[-33.9, 151.2], [-2500, 4000], [-33.8639351002, 151.1729822751]],
  [[-33.9, 151.2], [9000, -7000], [-33.9630693478, 151.2973764088]],
  [[78.2, 15.6], [190, 70], [78.2006268564, 15.6083199907]],
  [[78.2, 15.6], [-2500, 4000], [78.2358062227, 15.4902037591]],
  [[78.2, 15.6], [9000, -7000], [78.1370322625, 15.9920251753]],
];
const ORIGIN = { lat_deg: 47.3977, lon_deg: 8.5456 };

test("places are pymap3d's to a millimetre", () => {
  for (const [[lat_deg, lon_deg], point, [lat, lon]] of GOLDEN) {
    const found = placeOf({ lat_deg, lon_deg }, point);
    assert.ok(Math.abs(found[0] - lat) < 1e-8, `${found}`);
    assert.ok(Math.abs(found[1] - lon) * Math.cos((lat * Math.PI) / 180) < 1e-8, `${found}`);
  }
});

test("the way back leads to the same point", () => {
  for (const [[lat_deg, lon_deg], point] of GOLDEN) {
    const origin = { lat_deg, lon_deg };
    const back = pointOf(origin, placeOf(origin, point));
    assert.ok(Math.hypot(back[0] - point[0], back[1] - point[1]) < 1e-6, `${back}`);
  }
});

test("a graticule has round coordinates at a spacing that suits the view, and each line lies on its coordinate", () => {
  for (const half of [5, 80, 1000, 8000]) {
    const lines = graticuleOf(ORIGIN, [-half, -half, half, half], half / 4);
    for (const along of ["parallel", "meridian"]) {
      const own = lines.filter((one) => one.along === along);
      assert.ok(own.length >= 2 && own.length <= 9, `${half}: ${own.length}`);
      for (const { path, name } of own) {
        for (const point of path) {
          const value = placeOf(ORIGIN, point)[along === "parallel" ? 0 : 1];
          assert.ok(Math.abs(value - Number.parseFloat(name)) < 2e-6, `${name}: ${value}`);
        }
      }
    }
  }
  const [first] = graticuleOf(ORIGIN, [-100, -100, 100, 100], 50);
  assert.deepEqual([first.name, first.along], ["47.3970° N", "parallel"]);
});

test("south and west have letters, not signs", () => {
  assert.equal(placeWords([-33.9, -70.25]), "33.900000° S, 70.250000° W");
});
