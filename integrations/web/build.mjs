// Builds what is committed: lib/reader.js, the reader for programs, and the page of `enliven web`.
//
//   node build.mjs            writes both
//   node build.mjs --check    exits with 1 if a committed file differs from its source

import { readFileSync, writeFileSync } from "node:fs";
import { fileURLToPath } from "node:url";

import { build } from "esbuild";

const here = (path) => fileURLToPath(new URL(path, import.meta.url));
const shared = { bundle: true, write: false, target: "es2022", charset: "utf8", absWorkingDir: here(".") };
const targets = [
  {
    path: here("lib/reader.js"),
    options: { ...shared, entryPoints: ["src/reader/index.ts"], format: "esm" },
  },
  {
    path: here("../../shared/enliven/web_page/page.js"),
    options: {
      ...shared, entryPoints: ["src/page/main.ts"], format: "iife", minify: true, legalComments: "none",
      banner: { js: "/* Built from integrations/web by build.mjs. Licences: LICENCES.txt next to this file. */" },
    },
  },
];

let differs = false;
for (const { path, options } of targets) {
  const [{ text }] = (await build(options)).outputFiles;
  if (!process.argv.includes("--check")) {
    writeFileSync(path, text);
    console.log(`${path}: ${Math.round(text.length / 1024)} KiB`);
  } else if (readFileSync(path, "utf8") !== text) {
    differs = true;
    console.error(`${path} is not built from its source: run node build.mjs`);
  }
}
process.exit(differs ? 1 : 0);
