// The ground under the map: a grid in metres; where a scenario states its origin on the earth, a graticule in degrees, and
// the tiles that an operator set.

import { DEGREE, graticuleOf, linesAt, MAJOR_M, placeOf, placeWords, pointOf, WIDEST_M } from "./earth.js";
import { byId } from "./elements.js";
import { mark } from "./looks.js";
import { TILES } from "./tables.js";
import { LineString, Point, VectorLayer, VectorSource } from "./vendor/openlayers.js";

const APART_PX = 130;
const DEEPEST = 19;
/** marks stay legible over tiles, in the dark as well */
const FAINT = 0.6;

/** The ground of a map; `style` gives its marks their looks. */
export class Ground {
  #map;
  #lines = new VectorSource();
  /** null until ground is laid @type {import("./earth.js").Origin | undefined | null} */
  #origin = null;
  /** @type {any} */
  #tiles = null;

  constructor(map, style) {
    this.#map = map;
    map.getLayers().insertAt(0, new VectorLayer({ source: this.#lines, style, updateWhileInteracting: true, updateWhileAnimating: true }));
    // "change" comes before the view has its new state
    map.getView().on("propertychange", () => this.#draw());
    map.on("change:size", () => this.#draw());
  }

  /** Lay the ground about an origin on the earth, or without one. */
  lie(origin) {
    if (JSON.stringify(origin) === JSON.stringify(this.#origin)) return;
    this.#origin = origin;
    this.#draw();
    if (this.#tiles) this.#map.removeLayer(this.#tiles);
    this.#tiles = null;
    byId("attribution").textContent = "";
    if (origin && TILES) this.#layTiles(origin, TILES);
  }

  /** Where a point lies, in words; empty without an origin. */
  words(point) {
    return this.#origin ? placeWords(placeOf(this.#origin, point)) : "";
  }

  #draw() {
    const view = this.#map.getView();
    const extent = view.calculateExtent(this.#map.getSize());
    this.#lines.clear(true);
    if (extent.some((edge) => Math.abs(edge) > WIDEST_M)) return;
    const apart = APART_PX * view.getResolution();
    if (!this.#origin) {
      this.#lines.addFeatures(gridOf(extent, apart).map((path) => mark(new LineString(path), { kind: "graticule" })));
      return;
    }
    const lines = graticuleOf(this.#origin, extent, apart);
    this.#lines.addFeatures(lines.flatMap(({ along, path, name }) => [mark(new LineString(path), { kind: "graticule" }), mark(new Point(path[0]), { kind: along, name })]));
  }

  /** Tiles come in Mercator's projection of a sphere of the ellipsoid's longer axis; OpenLayers bends them to the plane. */
  async #layTiles(origin, { url, attribution }) {
    const { addCoordinateTransforms, TileLayer, XYZ } = await import("./vendor/tiles.js");
    if (origin !== this.#origin) return;
    const toMercator = (point) => {
      const [lat, lon] = placeOf(origin, point);
      return [MAJOR_M * lon * DEGREE, MAJOR_M * Math.log(Math.tan(Math.PI / 4 + (lat * DEGREE) / 2))];
    };
    const toPlane = (point) => pointOf(origin, [(2 * Math.atan(Math.exp(point[1] / MAJOR_M)) - Math.PI / 2) / DEGREE, point[0] / MAJOR_M / DEGREE]);
    addCoordinateTransforms(this.#map.getView().getProjection(), "EPSG:3857", toMercator, toPlane);
    this.#tiles = new TileLayer({ opacity: FAINT, source: new XYZ({ url, maxZoom: DEEPEST }) });
    this.#map.getLayers().insertAt(0, this.#tiles);
    byId("attribution").textContent = attribution;
  }
}

/** Lines of whole metres across a part of the plane, so many m apart or somewhat more. */
function gridOf([west, south, east, north], apart) {
  const upright = linesAt([west, east], apart).map(([x]) => [[x, south], [x, north]]);
  return [...upright, ...linesAt([south, north], apart).map(([y]) => [[west, y], [east, y]])];
}
