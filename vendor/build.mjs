// Bundle what the web page uses of its libraries, and copy what pages and images of figures bring along,
// each with licences and digests.

import { createHash } from "node:crypto";
import { copyFile, readFile, readdir, rm, writeFile } from "node:fs/promises";
import { build } from "esbuild";

const TARGET = "../api/page/vendor";

const scripts = async () => (await readdir(TARGET)).filter((one) => one.endsWith(".js"));
// what two bundles share has names that change with it
for (const name of await scripts()) await rm(`${TARGET}/${name}`);
const { metafile } = await build({
  entryPoints: ["openlayers.js", "editing.js", "tiles.js", "yaml.js"],
  bundle: true,
  splitting: true,
  chunkNames: "shared-[hash]",
  minify: true,
  format: "esm",
  target: "es2022",
  legalComments: "none",
  metafile: true,
  outdir: TARGET,
});

const used = Object.keys(metafile.inputs).map((path) => path.match(/^node_modules\/((?:@[^/]+\/)?[^/]+)/)?.[1]);
const licences = [];
for (const name of [...new Set(used.filter(Boolean))].sort()) {
  const folder = `node_modules/${name}`;
  const { version, license } = JSON.parse(await readFile(`${folder}/package.json`, "utf8"));
  const file = (await readdir(folder)).find((one) => /^licen[cs]e/i.test(one));
  const text = file ? await readFile(`${folder}/${file}`, "utf8") : "";
  licences.push(`${name} ${version}, ${license}\n\n${text.trim()}\n`);
}
await writeFile(`${TARGET}/LICENCES.txt`, licences.join(`\n${"-".repeat(80)}\n\n`));

const FIGURES = "../syncplan/plotting/vendored";
const COPIES = {
  "plotly-basic.min.js": "plotly.js-basic-dist-min/plotly-basic.min.js",
  "plotly-LICENSE": "plotly.js-basic-dist-min/LICENSE",
  "arimo-latin-400-normal.woff2": "@fontsource/arimo/files/arimo-latin-400-normal.woff2",
  "arimo-LICENSE": "@fontsource/arimo/LICENSE",
};
for (const [name, from] of Object.entries(COPIES)) await copyFile(`node_modules/${from}`, `${FIGURES}/${name}`);

const FONTS = { "inter.woff2": "files/inter-latin-wght-normal.woff2", "inter-LICENSE": "LICENSE" };
for (const [name, from] of Object.entries(FONTS)) await copyFile(`node_modules/@fontsource-variable/inter/${from}`, `${TARGET}/${name}`);

await digest(TARGET, ["LICENCES.txt", ...Object.keys(FONTS), ...(await scripts())]);
await digest(FIGURES, Object.keys(COPIES));

async function digest(folder, names) {
  const lines = names.sort().map(async (name) => {
    const content = await readFile(`${folder}/${name}`);
    return `${createHash("sha256").update(content).digest("hex")}  ${name}\n`;
  });
  await writeFile(`${folder}/SHA256SUMS`, (await Promise.all(lines)).join(""));
}
