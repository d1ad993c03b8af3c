// Files to save: the scenario, the plan, and every export of it.

import { byId, element, notice, save, shown } from "./elements.js";
import { choice, labelled, number, wide } from "./requests.js";
import { withValue } from "./scenario.js";
import { ask } from "./service.js";
import { FORMATS, MISSIONS, ON_EARTH, PILOTS } from "./tables.js";
import { firstOpen, LEVELS } from "./verdict.js";

/** The panel of downloads. `storePlan()` resolves with the identifier of the plan on show. */
export function offerDownloads(store, storePlan) {
  const fault = element("p", { class: "fault", role: "alert", id: "download-fault" });
  const notes = element("div", { role: "status", id: "export-notes" });
  const pilot = choice("pilot", PILOTS);
  const pilots = wide("For", pilot);
  const format = choice("format", FORMATS);
  const travels = element("div", { class: "travels", id: "export-findings" });
  const origin = originFields(store);
  const suit = () => {
    pilots.hidden = !MISSIONS.includes(format.value);
    origin.hidden = !ON_EARTH.includes(format.value) || store.scenario?.geo_origin !== undefined;
    // not disabled: Tab leads to it from the last field that it waits for
    buttons[2].setAttribute("aria-disabled", !origin.hidden);
    // nothing is said of files that can't be made yet
    travels.hidden = !origin.hidden;
  };
  format.addEventListener("change", suit);
  const buttons = [
    element("button", { type: "button", onclick: () => saveScenario(store) }, "Scenario"),
    element("button", { type: "button", onclick: () => run(savePlan) }, "Plan"),
    element("button", { type: "button", onclick: () => origin.hidden && run(saveExport) }, "Export"),
    element("button", { type: "button", onclick: () => showReport(open()) }, "Print report"),
  ];
  const force = element("input", { type: "checkbox", id: "force" });
  const forced = element("label", { for: "force", class: "check" }, force, element("span", {}, " Export although the verdict is ", element("span", { class: "together" }, "NO-GO")));
  const report = element("button", { type: "button", onclick: () => run(saveReport) }, "Report");
  byId("downloads").append(
    element("div", { class: "row" }, buttons[0], buttons[1], report, buttons[3]),
    wide("Format", format),
    pilots,
    origin,
    travels,
    forced,
    buttons[2],
    fault,
    notes,
  );
  const enable = () => {
    for (const one of buttons) one.disabled = store.scenario === null;
    suit();
    report.disabled = store.report === null;
    fault.textContent = "";
    notes.replaceChildren();
  };
  const foretell = (known) => {
    forced.hidden = !known || store.plan.verdict.go;
    travels.replaceChildren(...(known ? travelling(store.plan.verdict.findings) : []));
  };
  foretell(false);
  enable();
  store.on(["opened", "scenario", "report"], enable);
  store.on(["plan"], () => foretell(true));
  // what is at fault can't be exported, and nothing is known of it
  store.on(["faults"], () => foretell(false));

  async function run(task) {
    fault.textContent = "";
    notes.replaceChildren();
    try {
      await task();
    } catch (error) {
      fault.textContent = store.deleted(error) || error.message;
    }
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
    notice(`Exported, ${shown(file.size / 1024)} KiB. The file that ends in .sync.json says how vehicles join their circles.`);
  }

  /** The plan as one printed sheet, in a tab of its own, which the click has to open. */
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

/** Asks for the place of the origin, which formats on the earth need. */
function originFields(store) {
  const [lat, lon] = [number("origin-lat", ""), number("origin-lon", "")];
  const take = () => {
    const [lat_deg, lon_deg] = [lat, lon].map((one) => one.valueAsNumber);
    if (Number.isNaN(lat_deg) || Number.isNaN(lon_deg)) return;
    store.edit(withValue(store.scenario, "geo_origin", { lat_deg, lon_deg, alt_m: 0 }));
    for (const one of [lat, lon]) one.value = "";
  };
  for (const one of [lat, lon]) one.addEventListener("change", take);
  return element(
    "fieldset",
    { class: "group" },
    element("legend", {}, "Where the origin lies"),
    element("p", { class: "hint" }, "This format needs the place on the earth of the point 0, 0."),
    labelled("Latitude (°)", lat),
    labelled("Longitude (°)", lon),
  );
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
