export * from "../../../vendor/openlayers.js";
