"use strict";
// Answers of the generated functions, in the words of the page.

function field(kernel, numbers, name) {
  const { at, rows, columns } = kernel.wanted[name];
  return Array.from(numbers.subarray(at, at + rows * columns));
}

// the pose from which loops are closed: zero, with unit quaternions
const guess = robot.q.map((of) => (of.part === "qw" ? 1 : 0));

function answered(kernel, y, yd = zeros, ydd = zeros) {
  const parts = { y, yd, ydd, q_guess: guess, wrenches: wrenches() };
  const given = new Float64Array(length(kernel));
  for (const [name, { at }] of Object.entries(kernel.given)) given.set(parts[name], at);
  const wanted = new Float64Array(kernel.outputs);
  let state = kernel.ask(given, wanted);
  if (state === 2 && kernel.rest) state = kernel.rest.ask(given, wanted);
  return { state, get: (name) => field(kernel, wanted, name) };
}

// a force at the origin of a tip and a moment, in the root's axes [N, N m]
const load = { tip: 0, force: [0, 0, 0], moment: [0, 0, 0] };

function wrenches() {
  return robot.tips.flatMap((_, k) =>
    k === load.tip ? [...load.moment, ...load.force] : [0, 0, 0, 0, 0, 0]);
}

const zeros = robot.yd.map(() => 0);

// how many numbers a function is given
function length(kernel) {
  return Object.values(kernel.given).reduce((sum, { rows, columns }) => sum + rows * columns, 0);
}

// the largest deviation from the stored answers of the generic kernels, by the size of the field
const deviation = (() => {
  let worst = 0;
  let states = 0;
  let left = 0;
  for (const kernel of [force, ...frames]) {
    const wanted = new Float64Array(kernel.outputs);
    for (const [state, given, expected] of kernel.states) {
      states += 1;
      if (kernel.ask(Float64Array.from(given.slice(0, length(kernel))), wanted) !== state) {
        left += 1;
        continue;
      }
      for (const { at, rows, columns } of Object.values(kernel.wanted)) {
        const own = expected.slice(at, at + rows * columns);
        const size = Math.max(1e-300, ...own.map(Math.abs));
        own.forEach((x, k) => {
          const off = Math.abs(wanted[at + k] - x) / size;
          worst = off <= worst ? worst : off;
        });
      }
    }
  }
  return { worst, states, left };
})();

// pose of every link in the root's frame
function worlds(y, known) {
  const moving = [];
  for (const kernel of frames) {
    const answer = known.get(kernel) ?? answered(kernel, y);
    if (answer.state === 2) return null;
    const all = answer.get("frame_pose");
    for (let k = 0; k < all.length; k += 7) moving.push(all.slice(k, k + 7));
  }
  const found = [];
  const of = (k) => {
    const { frame, joint } = robot.links[k];
    found[k] ??= frame !== null ? moving[frame] : joint ? times(of(joint.parent), joint.at) : unit;
    return found[k];
  };
  robot.links.forEach((_, k) => of(k));
  return found;
}

// how a number exceeds its limits, in words; nothing where it does not
function beyond(x, of) {
  if (of.lower !== null && x < of.lower) return `${x.toFixed(3)} < ${of.lower}`;
  return of.upper !== null && x > of.upper ? `${x.toFixed(3)} > ${of.upper}` : null;
}

// status as `sarrus ask` names it where it is known, and the rest of an answer
function ask(y, yd, ydd) {
  const at = answered(pose, y);
  if (at.state === 2) return { status: "no_pose" };
  const found = worlds(y, new Map([[pose, at]]));
  if (!found) return { status: "no_pose" };
  const answer = { status: "ok", y, q: at.get("q"), u: at.get("u"), worlds: found, exceeded: [] };
  answer.G_u = at.get("G_u");
  answer.sigma_min = sigma_min(Float64Array.from(answer.q));
  const forces = answered(force, y, yd, ydd);
  answer.tau_u = forces.state === 2 ? null : forces.get("tau_u");
  if (!answer.tau_u) answer.status = "no_forces";
  const exceeds = (words, of, what) => {
    if (words) answer.exceeded.push(`${what} of ${motors.has(of.name) ? "motor " : ""}${of.name} ${words}`);
  };
  robot.q.forEach((of, k) => exceeds(beyond(answer.q[k], of), of, "position"));
  robot.u.forEach((of, k) => {
    const tau = answer.tau_u?.[k] ?? 0;
    const most = of.effort ?? Infinity;
    exceeds(beyond(tau, { lower: -most, upper: most }), of, "force");
  });
  if (at.state === 1 && answer.exceeded.length === 0) answer.exceeded.push("velocity of a joint");
  return answer;
}

const motors = new Set(robot.u.map((of) => of.name));

// the part of the straight way from one list of numbers to another up to which `holds`
function reached(from, to, holds, halvings = 20) {
  let [low, high] = [0, 1];
  for (let k = 0; k < halvings; k++) {
    const middle = (low + high) / 2;
    if (holds(from.map((x, i) => x + middle * (to[i] - x)))) low = middle;
    else high = middle;
  }
  return low;
}

// why there is no pose at y: the loops open on the way from a closed pose (`unreachable`), only
// there (`singular_closure`), or neither is sure
function reason(from, to) {
  const closes = (y) => answered(pose, y).state !== 2;
  const last = from.map((x, i) => x + (1 - 1e-7) * (to[i] - x));
  const part = closes(last) ? 1 - 1e-7 : reached(from, to, closes);
  const y = from.map((x, i) => x + part * (to[i] - x));
  // it vanishes with the root of the distance
  const sigma = sigma_min(Float64Array.from(answered(pose, y).get("q")));
  const status = !(sigma < 1e-2) ? "not_found" : part === 1 - 1e-7 ? "singular_closure" : "unreachable";
  return { status, y, sigma };
}

// y whose actuators stand at u, from a closed pose: Newton's method on the page's own functions,
// until u is met
function independents(u, start) {
  const n = robot.y.length;
  let y = [...start];
  let step = null;
  let last = Infinity;
  for (let k = 0; k < 60; k++) {
    const at = answered(pose, y);
    const off = at.state === 2 ? null : at.get("u").map((x, r) => u[r] - x);
    const size = off ? Math.max(...off.map(Math.abs)) : Infinity;
    if (size < 1e-12 * (1 + Math.max(...u.map(Math.abs)))) return y;
    if (size < last) {
      const G_u = at.get("G_u");
      const rows = off.map((_, r) => G_u.slice(r * n, r * n + n));
      step = solved(rows, off);
      if (!step) return null;
      last = size;
      start = y;
    } else if (size < 1e-9) {
      return start;
    } else {
      // half the way from the last pose that was better
      step = step?.map((x) => x / 2);
      if (!step) return null;
    }
    const part = Math.min(1, 0.3 / Math.max(...step.map(Math.abs)));
    y = start.map((x, r) => x + part * step[r]);
  }
  return null;
}
