// Bundle what the page uses of its libraries, with their licences and the digests of both.

import { createHash } from "node:crypto";
import { readFile, readdir, writeFile } from "node:fs/promises";
import { build } from "esbuild";

const TARGET = "../api/page/vendor";

const { metafile } = await build({
  entryPoints: ["openlayers.js"],
  bundle: true,
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

const digests = [];
for (const name of (await readdir(TARGET)).filter((one) => /\.(js|txt)$/.test(one)).sort()) {
  digests.push(`${createHash("sha256").update(await readFile(`${TARGET}/${name}`)).digest("hex")}  ${name}\n`);
}
await writeFile(`${TARGET}/SHA256SUMS`, digests.join(""));
