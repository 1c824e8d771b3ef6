// Prints Khronos' validation reports of the GLB files named on the command line, as one JSON object by file.
const fs = require("fs");
const validator = require("gltf-validator");

async function main(paths) {
  const reports = {};
  for (const path of paths) {
    reports[path] = await validator.validateBytes(new Uint8Array(fs.readFileSync(path)), { maxIssues: 0 });
  }
  console.log(JSON.stringify(reports));
}

main(process.argv.slice(2));
