// Khronos glTF validator on argv[3]; argv[2] is where the validator's package lies.
const fs = require("node:fs");
const path = require("node:path");
const validator = require(path.resolve(process.argv[2]));
validator.validateBytes(new Uint8Array(fs.readFileSync(process.argv[3]))).then((report) => {
  const { numErrors, numWarnings } = report.issues;
  if (numErrors + numWarnings > 0) {
    console.error(JSON.stringify(report.issues, null, 1));
    process.exit(1);
  }
  console.log("glTF validator: 1 passed, 0 failed");
});
