// The parts of OpenLayers that the page uses.

export { default as Feature } from "ol/Feature.js";
export { default as OlMap } from "ol/Map.js";
export { default as View } from "ol/View.js";
export { default as ScaleLine } from "ol/control/ScaleLine.js";
export { LineString, Point, Polygon, Circle as Ring } from "ol/geom.js";
export { default as DragPan } from "ol/interaction/DragPan.js";
export { default as MouseWheelZoom } from "ol/interaction/MouseWheelZoom.js";
export { default as PinchZoom } from "ol/interaction/PinchZoom.js";
export { default as VectorLayer } from "ol/layer/Vector.js";
export { default as Projection } from "ol/proj/Projection.js";
export { default as VectorSource } from "ol/source/Vector.js";
export { Circle as Disc, Fill, RegularShape, Stroke, Style, Text } from "ol/style.js";
