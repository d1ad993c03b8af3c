// The parts of OpenLayers that edit, which the page loads after the map.

export { default as DragBox } from "ol/interaction/DragBox.js";
export { default as Draw } from "ol/interaction/Draw.js";
export { default as Modify } from "ol/interaction/Modify.js";
