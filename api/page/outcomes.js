// What jobs came to, in words and tables.

import { element, folded, present, shown, table } from "./elements.js";
import { gained } from "./jobs.js";
import { explained } from "./terms.js";

/** share of the least separation, or phase tolerance, that may be lost without a word */
const KEPT_SHARE = 0.9;
/** What a result says, by the kind of its job. */
const OUTCOMES = { refinement: refined, validation: validated, flight: flown };

/** Return what there is to say of the result of a job; `lost` are the motions that no sighting of its plan can detect. */
export function outcomeOf({ kind }, result, lost) {
  return present(OUTCOMES[kind](result, lost));
}

function badge(look, text) {
  return element("p", { class: `badge ${look}` }, text);
}

function remark(strong, text) {
  return element("p", { class: "remark" }, element("strong", {}, `${strong} `), text);
}

function refined(plan) {
  const { improved, reason, before, after } = plan.refinement;
  // what is not to be flown is no success, however small its error
  const go = plan.verdict?.go === true;
  return [
    badge(improved && go ? "good" : "", improved ? `Predicted error ${gained({ before, after })}` : "No better plan was found"),
    element("p", {}, ...explained(improved ? `Rank ${before.rank} → ${after.rank}.` : reason)),
    improved && after.least_distance_m !== null && separationOf(before.least_distance_m, after.least_distance_m),
    improved && meetingsOf(before, after),
  ];
}

/** How near vehicles come before and after: what is gained in error may be paid for in room. */
function separationOf(before, after) {
  const text = `Least separation ${shown(before)} → ${shown(after, "m")}.`;
  if (after >= KEPT_SHARE * before) return element("p", {}, ...explained(text));
  return remark(`⚠ ${text}`, "Vehicles come closer to each other than before. “Least separation” in the scenario limits this.");
}

/** What becomes of the meetings: error may be paid for in time to spare, too. Results of earlier versions do not say. */
function meetingsOf({ least_tolerance_rad: had, meetings: earlier }, { least_tolerance_rad: has, meetings, widest_meeting_m: widest }) {
  if (had === undefined || had === null || has === null) return null;
  const counts = `Meetings a period ${shown(earlier)} → ${shown(meetings)}, the widest ${shown(widest, "m")} apart.`;
  const text = `Phase tolerance of the links ${shown(had)} → ${shown(has, "rad")}, at the least.`;
  if (has >= KEPT_SHARE * had) return element("p", {}, ...explained(`${text} ${counts}`));
  return remark(`⚠ ${text}`, `Meetings bear less delay than before. ${counts}`);
}

function validated(report, lost) {
  const { overall, anees, trials, errors } = report;
  // what a filter believes of a motion that nothing detects is no proof; what is not to be flown is no success
  const doubtful = lost.length > 0 || report.verdict?.go === false;
  const looks = { consistent: doubtful ? "" : "good", unknown: "" };
  const motions = lost.map((one) => one.description).join("; ");
  return [
    badge(looks[anees.verdict] ?? "bad", `Found ${shown(overall.rms_second_half_m, "m")}, predicted ${shown(overall.predicted_rms_m, "m")}`),
    element("p", {}, ...explained(`RMS over the second half of ${counted(trials, "trial")}. ${consistencyOf(anees)}`)),
    spreadOf(overall),
    errors?.length > 0 && furtherErrors(errors),
    motions && remark("The plan is not observable.", `A consistent filter does not determine what no sighting can detect: ${motions}.`),
  ];
}

function consistencyOf(anees) {
  if (anees.verdict === "unknown") return "Too few trials to show whether the filter is consistent: run more.";
  const [low, high] = anees.band.map((end) => shown(end));
  return `The filter is ${anees.verdict}: ANEES ${shown(anees.value)}, 95 % interval ${low} to ${high}.`;
}

/** What to expect of one trial, and how often to expect worse; reports of earlier versions do not say. */
function spreadOf({ median_rms_second_half_m: median, share_over_3_predicted: far, share_over_10_predicted: lost }) {
  if (median === undefined || median === null) return null;
  const [over3, over10] = [far, lost].map((share) => `${shown(100 * share)} %`);
  const often = far ? ` In ${over3} of the trials some vehicle is off by more than 3 times the prediction, in ${over10} by more than 10 times.` : "";
  return element("p", {}, `Median trial ${shown(median, "m")}.${often}`);
}

/** What was found of the filter's other states, beside the prediction. */
function furtherErrors(errors) {
  const rows = errors.map(({ state, unit, rms_second_half: found, predicted_rms: predicted }) => [state, shown(found, unit), shown(predicted, unit)]);
  return folded("Errors that the filter estimates", table(["Error", "Found", "Predicted"], rows));
}

function flown(report) {
  const { overall, trials, verdict, events, links, notes } = report;
  const { filter_lost_share: lost, out_of_contact_share: away, least_separation_m: nearest } = report;
  const harmed = lost > 0 || away > 0 || nearest?.below_asked_share > 0;
  return [
    badge(
      harmed ? "bad" : verdict.go ? "good" : "",
      `Off the plan by ${shown(overall.tracking_rms_m, "m")}, estimates off by ${shown(overall.rms_second_half_m, "m")}`,
    ),
    element("p", {}, `RMS over the second half of ${counted(trials, "flight")}. ${losses(lost, away)}`),
    nearest && separation(nearest),
    element("p", {}, meetings(links)),
    ...events.map(happened),
    vehicles(report.vehicles),
    folded("What this flight supposes", notes.map((note) => element("p", { class: "hint" }, `${note}.`))),
  ];
}

function losses(lost, away) {
  const filters = lost ? `The filter was lost in ${percent(lost)} of them` : "No filter was lost";
  const contact = away ? `in ${percent(away)} a vehicle was out of contact for over two periods` : "no vehicle was out of contact for two periods";
  return `${filters}; ${contact}.`;
}

function happened({ what, settled_s: settled }) {
  return element("p", {}, typeof settled === "number" ? `${what}; back in phase ${shown(settled, "s")} later.` : `${what}.`);
}

/** How near vehicles came; in less room than asked for is a remark of its own. */
function separation({ median, worst, between, time_s: time, planned, below_asked_share: below }) {
  const where = `(${between.join(" and ")}, at ${shown(time, "s")})`;
  const text = `Least separation ${shown(median, "m")} in the median flight, ${shown(worst, "m")} in the worst ${where}; the plan has ${shown(planned, "m")}.`;
  return below ? remark(`⚠ In ${percent(below)} of the flights vehicles came nearer than asked.`, text) : element("p", {}, text);
}

/** The share of all planned meetings that were kept. */
function meetings(links) {
  const planned = links.reduce((sum, one) => sum + one.meetings, 0);
  if (!planned) return "The plan has no meetings in this time.";
  const kept = links.reduce((sum, one) => sum + one.kept_share * one.meetings, 0);
  return `${percent(kept / planned)} of the planned meetings were kept.`;
}

function vehicles(all) {
  const rows = all.map(({ name, errors, phase_error_s: phase, meetings_kept: kept }) => [
    name,
    errors ? short(errors.rms_second_half_m) : "lost",
    short(errors?.tracking_rms_m),
    short(phase?.rms),
    kept === null ? "—" : short(100 * kept),
  ]);
  return table(["Vehicle", "Error (m)", "Off plan (m)", "Phase (s)", "Met (%)"], rows);
}

function counted(count, noun) {
  return count === 1 ? `1 ${noun}` : `${count} ${noun}s`;
}

/** A number of three digits, of which a narrow table has room for five in a row. */
function short(value) {
  return shown(value, "", 3);
}

function percent(share) {
  return `${short(100 * share)} %`;
}
