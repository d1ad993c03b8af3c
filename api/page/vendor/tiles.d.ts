export * from "../../../vendor/tiles.js";
