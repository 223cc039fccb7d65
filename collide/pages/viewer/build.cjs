/**
 * Makes bundle.js of source/*.js and three.js: `npm install && npm run build` in a copy of this folder, or here with
 * NODE_PATH naming a node_modules that has the versions of package.json.
 *
 * The first line of the bundle names the versions and a SHA-256 of our sources; a test compares it with the files.
 */
"use strict";
const { execFileSync } = require("node:child_process");
const { createHash } = require("node:crypto");
const fs = require("node:fs");
const path = require("node:path");
const esbuild = require("esbuild");

const wanted = require("./package.json").devDependencies;
const sources = path.join(__dirname, "source");
const names = fs.readdirSync(sources).filter((name) => name.endsWith(".js")).sort();

/** Name, newline, text of every source in the order of their names: what the test hashes, too. */
function hashOfSources() {
  const hash = createHash("sha256");
  for (const name of names) hash.update(`${name}\n`).update(fs.readFileSync(path.join(sources, name)));
  return hash.digest("hex");
}

function checkVersions() {
  const three = JSON.parse(fs.readFileSync(path.join(path.dirname(require.resolve("three")), "../package.json")));
  const found = { esbuild: esbuild.version, three: three.version };
  for (const [name, version] of Object.entries(wanted)) {
    if (found[name] !== version) throw new Error(`${name} is ${found[name]}, package.json says ${version}`);
  }
}

checkVersions();
for (const name of names) execFileSync(process.execPath, ["--check", path.join(sources, name)]);
const [output] = esbuild.buildSync({
  entryPoints: [path.join(sources, "main.js")],
  bundle: true,
  charset: "ascii",
  format: "iife",
  legalComments: "inline",
  minify: true,
  nodePaths: (process.env.NODE_PATH || "").split(path.delimiter).filter(Boolean),
  target: "es2022",
  write: false,
}).outputFiles;
const text = output.text;
// what would end or change the element that the script stands in
for (const end of ["</script", "<script", "<!--"]) {
  if (text.toLowerCase().includes(end)) throw new Error(`the bundle has ${end} in it`);
}
const versions = Object.entries(wanted).map(([name, version]) => `${name} ${version}`).join(", ");
const first = `/* collide viewer; ${versions}; sources sha256 ${hashOfSources()} */`;
fs.writeFileSync(path.join(__dirname, "bundle.js"), `${first}\n${text}`);
console.log(`bundle.js: ${names.length} sources, ${text.length} bytes`);
