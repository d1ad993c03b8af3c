// Files to save: the scenario, the plan, and every export of it.

import { attemptAt, byId, element, notice, options, save, shown } from "./elements.js";
import { withValue } from "./scenario.js";
import { ask } from "./service.js";
import { FORMATS, MISSIONS, ON_EARTH, PILOTS } from "./tables.js";
import { firstOpen, LEVELS } from "./verdict.js";

/** The panel of downloads. `storePlan()` resolves with the identifier of the plan on show. */
export function offerDownloads(store, storePlan) {
  const [pilot, format, origin, force, forced] = ["pilot", "format", "origin", "force", "forced"].map(byId);
  const [fault, notes, travels] = ["download-fault", "export-notes", "export-findings"].map(byId);
  const acts = {
    "save-scenario": () => saveScenario(store),
    "save-plan": () => run(savePlan),
    "save-report": () => run(saveReport),
    "print-report": () => showReport(open()),
    export: () => origin.hidden && run(saveExport),
  };
  for (const [id, act] of Object.entries(acts)) byId(id).addEventListener("click", act);
  pilot.append(...options(PILOTS));
  format.append(...options(FORMATS));
  askForOrigin(store);

  const suit = () => {
    byId("pilots").hidden = !MISSIONS.includes(format.value);
    origin.hidden = !ON_EARTH.includes(format.value) || store.scenario?.geo_origin !== undefined;
    // not disabled: Tab leads to it from the last field that it waits for
    byId("export").setAttribute("aria-disabled", !origin.hidden);
    // nothing is said of files that can't be made yet
    travels.hidden = !origin.hidden;
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
    travels.replaceChildren(...(known ? travelling(store.plan.verdict.findings) : []));
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
    const asked = [MISSIONS.includes(format.value) ? pilot.value : "", force.checked && !forced.hidden ? "force=true" : ""].filter(Boolean).join("&");
    const at = `v1/plans/${await storePlan()}/exports/${format.value}${asked && "?"}${asked}`;
    const answer = await ask("GET", at, { accept: "application/zip" });
    const file = await answer.blob();
    save(file, `${nameOf(store)}-${format.value}.zip`, "application/zip");
    const texts = JSON.parse(answer.headers.get("Syncplan-Notes") || "[]");
    notes.replaceChildren(...texts.map((note) => element("p", { class: "remark" }, note)));
    // not below the notice
    notes.scrollIntoView({ block: "center" });
    notice(`Exported, ${shown(file.size / 1024)} KiB. The file that ends in .sync.json says how vehicles join their circles.`);
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

/** Ask for the place of the origin, which formats on the earth need. */
function askForOrigin(store) {
  const fields = ["origin-lat", "origin-lon"].map(byId);
  byId("origin").addEventListener("change", () => {
    const [lat_deg, lon_deg] = fields.map((one) => one.valueAsNumber);
    if (Number.isNaN(lat_deg) || Number.isNaN(lon_deg)) return;
    store.edit(withValue(store.scenario, "geo_origin", { lat_deg, lon_deg, alt_m: 0 }));
    for (const one of fields) one.value = "";
  });
}

/** What speaks against flying a plan, as the sidecar of its export will say. */
function travelling(findings) {
  const grave = findings.filter((one) => one.level !== "note");
  if (!grave.length) return [element("p", { class: "hint" }, "No stop and no warning goes with the files.")];
  const said = grave.map(({ level, message }) => element("p", { class: `remark ${level}` }, element("strong", {}, LEVELS[level]), message));
  return [element("p", { class: "hint" }, "These findings go with the files, in their .sync.json:"), ...firstOpen(said, "finding")];
}

function saveScenario(store) {
  save(`${JSON.stringify(store.scenario, null, 1)}\n`, `${nameOf(store)}.json`, "application/json");
  if (store.given) notice("This file holds the scenario alone: its phases are computed anew when it is opened. The file of the plan keeps them.");
}

function nameOf(store) {
  return (store.scenario.name || "scenario").replaceAll(/[^\p{L}\p{N}._-]+/gu, "-");
}
