// @NAME@: @REQUEST@ of the robot @ROBOT@, fingerprint @FINGERPRINT@, @OPERATIONS@ operations.
// SI and radians. Written by sarrus.
const @NAME@ = (() => {
"use strict";
@HEAD@
const count = @CLOSED@;
@NEWTON@
const answer = @ANSWER@;
return {
  robot: "@ROBOT@",
  fingerprint: "@FINGERPRINT@",
  operations: @OPERATIONS@,
  inputs: @INPUTS@,
  outputs: @OUTPUTS@,
  given: {
@GIVEN@  },
  wanted: {
@WANTED@  },
  // numbers behind the given ones where Newton's method closes loops
  closed: [
@NUMBERS@  ],
  // 0: answered; 1: some limit is exceeded, the numbers are right; 2: no answer, all are NaN
  run(given, wanted) {
    const state = answer(given, wanted);
    if (state & 2) {
      wanted.fill(NaN);
      return 2;
    }
    return state;
  },
  // the same from the given numbers alone
  ask(given, wanted) {
    const all = close(given);
    if (all) return this.run(all, wanted);
    wanted.fill(NaN);
    return 2;
  },
};
})();
if (typeof module === "object") module.exports = @NAME@;
