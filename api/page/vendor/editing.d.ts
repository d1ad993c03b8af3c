export * from "../../../vendor/editing.js";
