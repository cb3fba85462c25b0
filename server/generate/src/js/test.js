// Answers of @NAME@ against those of sarrus: node @NAME@_test.js
"use strict";
const kernel = require("./@NAME@.js");
// what it returns, what goes in, and the generic kernel's numbers
const states = [
@ROWS@];
const wanted = new Float64Array(kernel.outputs);
if (["states", "given"].includes(process.argv[2])) {
  // doubles in, with the numbers of closures or without; what it returns and its numbers out
  const given = new Float64Array(new Uint8Array(require("fs").readFileSync(0)).buffer);
  const alone = process.argv[2] === "given";
  const size = Object.values(kernel.given).reduce((sum, of) => sum + of.rows * of.columns, 0);
  const count = alone ? size : kernel.inputs;
  const answers = [];
  for (let k = 0; k < given.length; k += count) {
    const numbers = given.subarray(k, k + count);
    answers.push(alone ? kernel.ask(numbers, wanted) : kernel.run(numbers, wanted), ...wanted);
  }
  require("fs").writeFileSync(1, new Uint8Array(new Float64Array(answers).buffer));
  process.exit(0);
}
let different = 0;
for (const [state, given, expected] of states) {
  const same = kernel.run(given, wanted) === state
    && (state === 2 || expected.every((x, k) => Object.is(x, wanted[k])));
  if (!same) different += 1;
}
if (different > 0) {
  console.log(`@NAME@: ${different} of ${states.length} states differ`);
  process.exit(1);
}
const calls = 2000;
const start = process.hrtime.bigint();
for (let k = 0; k < calls; k++) kernel.run(states[k % states.length][1], wanted);
const each = Number(process.hrtime.bigint() - start) / 1e3 / calls;
console.log(`@NAME@: ${states.length} states, the same bits; ${each.toFixed(1)} us a call`);
