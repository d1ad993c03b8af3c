// Uses the page in Firefox as people do, by mouse and keyboard, and prints what it came to as JSON.
//
//     node tests/crosschecks/firefox.mjs ADDRESS AXE_SCRIPT FIREFOX

import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { setTimeout as sleep } from "node:timers/promises";

const { default: puppeteer } = createRequire(new URL("../../vendor/package.json", import.meta.url))("puppeteer-core");

const [address, axe, executablePath] = process.argv.slice(2);
const FIELD = [[-25, -25], [165, -25], [165, 40], [95, 40], [95, 95], [-25, 95], [-25, -25]];
const HEARD = ["error", "warn"];

const browser = await puppeteer.launch({ browser: "firefox", executablePath, headless: true, defaultViewport: null, args: ["--width=1440", "--height=980"] });
const page = await browser.newPage();
const came = { complaints: [], violations: {}, circles: 0, area: [], mission: "" };
page.on("console", (message) => HEARD.includes(message.type()) && came.complaints.push(message.text()));
page.on("pageerror", (error) => came.complaints.push(`${error}`));

/** Wait until a function of the page holds; the page's policy forbids to wait within it. */
async function until(holds) {
  for (let k = 0; !(await page.evaluate(holds)); k += 1) {
    if (k > 600) throw new Error(`still not so: ${holds}`);
    await sleep(100);
  }
}

/** Press a button or a tab on show. */
async function press(name) {
  const pressed = await page.evaluateHandle((words) => [...document.querySelectorAll("button, [role=tab]")].find((control) => control.checkVisibility() && [control.textContent.trim(), control.ariaLabel].some((said) => said?.startsWith(words))), name);
  await pressed.click();
}

async function type(selector, text) {
  await page.click(selector, { count: 3 });
  await page.keyboard.type(text);
}

/** Judge what is on show by axe. */
async function judge(state) {
  await page.evaluate(`${readFileSync(axe, "utf8")}; 0`);
  const violations = await page.evaluate("axe.run().then(({ violations }) => violations.map(({ id }) => id))");
  if (violations.length) came.violations[state] = violations;
}

try {
  await page.goto(address);
  await until(() => document.querySelector("#badge.good")?.textContent.includes("rank 18 of 18") && !document.querySelector("#new").disabled);
  await judge("first plan");
  await press("New");
  await judge("new team");
  await type("#new-count", "5");
  await press("Create");
  await until(() => document.querySelector("#badge.good")?.textContent.includes("5 vehicles know"));
  await press("Zoom out");
  await sleep(400);
  await press("Area");
  for (const place of FIELD) {
    const [x, y] = await page.evaluate((at) => {
      const { left, top } = document.getElementById("map-plot").getBoundingClientRect();
      const [right, down] = document.getElementById("map-plot").map.getPixelFromCoordinate(at);
      return [left + right, top + down];
    }, place);
    await page.mouse.move(x, y);
    await page.mouse.click(x, y);
    await sleep(350);
  }
  for (const part of ["Verdict", "Run", "Design", "Preflight"]) {
    await press(part);
    await judge(part);
  }
  await type("#field-altitude-m", "60");
  await type("#field-geo-origin-lat-deg", "47.4");
  await type("#field-geo-origin-lon-deg", "8.5");
  await page.keyboard.press("Enter");
  await until(() => document.querySelector("#notice").textContent.startsWith("Exported"));
  came.mission = await page.$eval("#notice", (notice) => notice.textContent);
  await press("Figures");
  await until(() => document.querySelectorAll("#panel-plot .trace, #panel-plot .bars").length > 0);
  await judge("figures");
  Object.assign(came, await page.evaluate(() => {
    const features = document.getElementById("map-plot").map.getLayers().getArray().flatMap((layer) => layer.getSource().getFeatures?.() ?? []);
    const of = (kind) => features.filter((feature) => feature.get("kind") === kind);
    return { circles: of("circle").length, area: of("area").flatMap((area) => area.getGeometry().getCoordinates()[0]) };
  }));
} finally {
  await browser.close();
}
console.log(JSON.stringify(came));
