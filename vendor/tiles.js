// The parts of OpenLayers that draw tiles, which the page loads where an operator sets some.

export { default as TileLayer } from "ol/layer/Tile.js";
export { addCoordinateTransforms } from "ol/proj.js";
export { default as XYZ } from "ol/source/XYZ.js";
