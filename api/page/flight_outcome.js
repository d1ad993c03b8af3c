// What a flight came to, in words and by vehicle.

import { element, shown } from "./elements.js";

/** Return what there is to say of the report of a flight. */
export function flown(report) {
  const { overall, trials, verdict } = report;
  const { filter_lost_share: lost, out_of_contact_share: away, least_separation_m: nearest } = report;
  const harmed = lost > 0 || away > 0 || (nearest?.below_asked_share ?? 0) > 0;
  const look = harmed ? "bad" : verdict.go ? "good" : "";
  return [
    element(
      "p",
      { class: `badge ${look}` },
      `Off the plan by ${shown(overall.tracking_rms_m, "m")}, estimates off by ${shown(overall.rms_second_half_m, "m")}`,
    ),
    element("p", {}, `RMS over the second half of ${trials === 1 ? "1 flight" : `${trials} flights`}. ${losses(lost, away)}`),
    ...separation(nearest),
    element("p", {}, meetings(report.links)),
    ...happened(report.events),
    vehicles(report.vehicles),
    details("What this flight supposes", ...report.notes.map((note) => element("p", { class: "hint" }, `${note}.`))),
  ];
}

function losses(lost, away) {
  const filters = lost ? `The filter was lost in ${percent(lost)} of them` : "No filter was lost";
  const contact = away ? `in ${percent(away)} a vehicle was out of contact for over two periods` : "no vehicle was out of contact for two periods";
  return `${filters}; ${contact}.`;
}

/** How near vehicles came; in less room than asked for is a remark of its own. */
function separation(nearest) {
  if (!nearest) return [];
  const { median, worst, between, time_s: time, planned, below_asked_share: below } = nearest;
  const text = `Least separation ${shown(median, "m")} in the median flight, ${shown(worst, "m")} in the worst (${between.join(" and ")}, at ${shown(time, "s")}); the plan has ${shown(planned, "m")}.`;
  if (!below) return [element("p", {}, text)];
  return [
    element("p", { class: "remark" }, element("strong", {}, `⚠ In ${percent(below)} of the flights vehicles came nearer than asked. `), text),
  ];
}

/** The share of all planned meetings that were kept. */
export function meetings(links) {
  const planned = links.reduce((sum, one) => sum + one.meetings, 0);
  if (!planned) return "The plan has no meetings in this time.";
  const kept = links.reduce((sum, one) => sum + one.kept_share * one.meetings, 0);
  return `${percent(kept / planned)} of the planned meetings were kept.`;
}

function happened(events) {
  return events.map(({ what, settled_s: settled }) =>
    element("p", {}, settled === null || settled === undefined ? `${what}.` : `${what}; back in phase ${shown(settled, "s")} later.`),
  );
}

function vehicles(flown) {
  const heads = ["Vehicle", "Error (m)", "Off plan (m)", "Phase (s)", "Met (%)"];
  const row = ({ name, errors, phase_error_s: phase, meetings_kept: kept }) =>
    element(
      "tr",
      {},
      element("th", { scope: "row" }, name),
      ...[
        errors ? short(errors.rms_second_half_m) : "lost",
        short(errors?.tracking_rms_m),
        short(phase?.rms),
        kept === null ? "—" : short(100 * kept),
      ].map((text) => element("td", {}, text)),
    );
  return element(
    "table",
    { class: "losses" },
    element("thead", {}, element("tr", {}, ...heads.map((head) => element("th", { scope: "col" }, head)))),
    element("tbody", {}, ...flown.map(row)),
  );
}

function details(title, ...children) {
  return element("details", {}, element("summary", {}, title), ...children);
}

function percent(share) {
  return `${short(100 * share)} %`;
}

/** A number of three digits, of which a narrow table has room for five in a row. */
function short(value) {
  return shown(value === null || value === undefined ? null : Number(value.toPrecision(3)));
}
