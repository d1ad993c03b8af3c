// Before a flight: what the files of an export hold and lack, and the files.

import { attemptAt, byId, element, mark, notice, options, renew, save, shown } from "./elements.js";
import { polygonsOf, vehiclesOf } from "./scenario.js";
import { ask } from "./service.js";
import { FORMATS, PILOTS } from "./tables.js";
import { LEVELS } from "./verdict.js";

/** Vehicles whose altitudes are listed; of more, the least and the largest are stated. */
const MOST_LISTED = 12;

/** The panel of what is done before a flight. `storePlan()` resolves with the identifier of the plan on show. */
export function offerPreflight(store, storePlan) {
  const [pilot, format, force, forced, rows] = ["pilot", "format", "force", "forced", "preflight"].map(byId);
  const [fault, notes, lacks, graveCount, travels] = ["download-fault", "export-notes", "export-lacks", "export-count", "export-findings"].map(byId);
  const lacksPlace = () => FORMATS[format.value].on_earth && store.scenario?.geo_origin === undefined;
  const acts = {
    "save-scenario": () => saveScenario(store),
    "save-plan": () => run(savePlan),
    "save-report": () => run(saveReport),
    "print-report": () => showReport(open()),
  };
  for (const [id, act] of Object.entries(acts)) byId(id).addEventListener("click", act);
  // by the button, or by Enter in a field
  byId("preflight-fields").addEventListener("submit", (event) => {
    event.preventDefault();
    if (!lacksPlace()) return run(saveExport);
    mark(byId("field-geo-origin-lat-deg"), "this format needs latitude and longitude of the point 0, 0");
    byId("field-geo-origin-lat-deg").focus();
  });
  pilot.append(...options(PILOTS));
  format.append(...options(Object.fromEntries(Object.entries(FORMATS).map(([name, { title }]) => [name, title]))));

  const suit = () => {
    const { mission, altitude_m: usual } = FORMATS[format.value];
    pilot.disabled = !mission;
    // not disabled: Tab leads to it from the last field that it waits for
    byId("export").setAttribute("aria-disabled", lacksPlace());
    if (!store.scenario) return;
    renew(rows, rowsOf(store.scenario, FORMATS[format.value]));
    if (!Array.isArray(store.scenario.altitude_m)) byId("field-altitude-m").placeholder = usual ? `${usual} if empty` : "";
    lacks.textContent = lacksPlace() ? "Export needs latitude and longitude of the point 0, 0." : "";
  };
  const enable = () => {
    for (const id of ["save-scenario", "save-plan", "print-report", "export"]) byId(id).disabled = store.scenario === null;
    byId("save-report").disabled = store.report === null;
    suit();
    fault.textContent = "";
    notes.replaceChildren();
  };
  const foretell = (known) => {
    forced.hidden = !known || store.plan.verdict.go;
    const grave = known ? store.plan.verdict.findings.filter(({ level }) => level !== "note") : [];
    const stops = grave.filter(({ level }) => level === "stop").length;
    graveCount.textContent = known ? `Findings: ${stops} stop${stops === 1 ? "" : "s"}, ${grave.length - stops} warning${grave.length - stops === 1 ? "" : "s"}, all stated in the files.` : "";
    travels.replaceChildren(...grave.map(({ level, message }) => element("p", { class: `remark ${level}` }, element("strong", {}, LEVELS[level]), message)));
  };
  format.addEventListener("change", suit);
  foretell(false);
  enable();
  store.on(["opened", "scenario", "report"], enable);
  store.on(["plan"], () => foretell(true));
  // what is at fault can't be exported, and nothing is known of it
  store.on(["faults"], () => foretell(false));

  function run(task) {
    notes.replaceChildren();
    return attemptAt(fault, task, (error) => store.deleted(error) || error.message);
  }

  async function savePlan() {
    const answer = await ask("GET", `v1/plans/${await storePlan()}`);
    save(await answer.blob(), `${nameOf(store)}.plan.json`, "application/json");
  }

  async function saveExport() {
    const asked = [FORMATS[format.value].mission ? pilot.value : "", force.checked && !forced.hidden ? "force=true" : ""].filter(Boolean).join("&");
    const at = `v1/plans/${await storePlan()}/exports/${format.value}${asked && "?"}${asked}`;
    const answer = await ask("GET", at, { accept: "application/zip" });
    const file = await answer.blob();
    save(file, `${nameOf(store)}-${format.value}.zip`, "application/zip");
    const texts = JSON.parse(answer.headers.get("Syncplan-Notes") || "[]");
    const remarks = texts.map((note) => element("p", { class: "remark note" }, note));
    notes.replaceChildren(...(remarks.length ? [element("h3", {}, "To do before the flight"), ...remarks] : []));
    // not below the notice
    notes.scrollIntoView({ block: "center" });
    notice("Exported. The file that ends in .sync.json says how vehicles join their circles.");
  }

  /** The plan as printed sheets, in a tab of its own, which the click has to open. */
  async function showReport(tab) {
    await run(async () => {
      const answer = await ask("GET", `v1/plans/${await storePlan()}/report`, { accept: "text/html" });
      tab.location = URL.createObjectURL(await answer.blob());
    });
    if (fault.textContent) tab.close();
  }

  /** The report of the job on show, the bytes that the command line would write. */
  async function saveReport() {
    const answer = await ask("GET", `v1/jobs/${store.report}/result`);
    save(await answer.blob(), `${nameOf(store)}.report.json`, "application/json");
  }
}

/** What the files of a format hold of a scenario, and what they lack. */
function rowsOf(scenario, format) {
  const polygons = polygonsOf(scenario);
  const corners = polygons.find(({ kind }) => kind === "area")?.corners.length;
  const keepOuts = polygons.filter(({ kind }) => kind === "keep-out").length;
  const fence = [corners && `area of ${corners} corners`, keepOuts && `${keepOuts} keep-out${keepOuts > 1 ? "s" : ""}`].filter(Boolean);
  const rows = [
    ["Files", format.holds],
    ["Area and keep-outs", fence.join(", ") || "none: no area and no keep-out is drawn"],
    ["Altitudes", altitudesOf(scenario, format)],
    ["Take-off and landing", "not in the files: the vehicles take off before, and land after"],
    ["Start", scenario.start_time ?? "not stated: all operators agree on one moment"],
  ];
  return rows.map(([name, value]) => element("tr", {}, element("th", { scope: "row" }, name), element("td", {}, value)));
}

/** The altitudes that the files of a format state, in words. */
function altitudesOf(scenario, { altitude_m: usual }) {
  const metres = (height) => shown(height, "m", 6);
  if (scenario.altitude_m === undefined) return `${metres(usual)} for all: none is stated, and this is the format's`;
  const all = vehiclesOf(scenario).map(({ name, altitude }) => `${name} ${metres(altitude)}`);
  if (!Array.isArray(scenario.altitude_m)) return `${metres(scenario.altitude_m)} above ground, all vehicles`;
  const range = [Math.min, Math.max].map((of) => metres(of(...scenario.altitude_m))).join(" to ");
  return all.length > MOST_LISTED ? `${range} above ground` : `${all.join(", ")} above ground`;
}

function saveScenario(store) {
  save(`${JSON.stringify(store.scenario, null, 1)}\n`, `${nameOf(store)}.json`, "application/json");
  if (store.given) notice("This file holds the scenario alone: its phases are computed anew when it is opened. The file of the plan keeps them.");
}

function nameOf(store) {
  return (store.scenario.name || "scenario").replaceAll(/[^\p{L}\p{N}._-]+/gu, "-");
}
