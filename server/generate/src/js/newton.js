
// Newton's method block by block from the zero pose, as the plan does it: the thresholds and the
// rule of server/dynamics/src/closure/numerical/newton.rs without kept inverses, the substeps of
// continuation.rs.
const end = 1.4901161193847657e-9;

// closes the dependents in q; signs: determinants to keep the sign of, of blocks that remember
function attempt(cluster, q, signs, moved) {
  for (const [b, block] of cluster.blocks.entries()) {
    const n = block.unknowns.length;
    const out = new Float64Array(n + 4);
    let last = block.couples ? Infinity : 0.5 / 0.3;
    let sign = signs && block.remembers ? signs[b] : 0;
    let done = false;
    for (let k = 0; k < 10 && !done; k++) {
      if (block.step(q, out) & 2) return false;
      const [size, residual, det, gain] = out.subarray(n);
      if (det * sign < 0) return false;
      sign = det;
      if (k === 0 && !block.couples) {
        const far = Math.max(size, moved);
        if (!(size < 0.5 && far * far * gain < 0.7 * 0.7)) return false;
      }
      done = size < end || residual < cluster.floor;
      if (!done && !(size < 0.3 * last)) return false;
      last = size;
      block.unknowns.forEach((i, r) => (q[i] = out[r]));
    }
    if (!done) return false;
  }
  return true;
}

function determinants(cluster, q) {
  return cluster.blocks.map((block) => {
    const out = new Float64Array(block.unknowns.length + 4);
    return block.remembers && !(block.step(q, out) & 2) ? out[block.unknowns.length + 2] : 0;
  });
}

// straight to the independents in q, else in substeps from the zero pose
function closed(cluster, q) {
  const goal = cluster.independents.map(([i]) => q[i]);
  const whole = cluster.independents.reduce(
    (sum, [i, unit]) => sum + Math.abs(q[i] - zero[i]) * unit, 0);
  if (whole <= cluster.reach && attempt(cluster, q, null, whole)) return true;
  let last = Float64Array.from(zero);
  if (!attempt(cluster, last, determinants(cluster, last), 0)) return false;
  let signs = determinants(cluster, last);
  let at = 0;
  let step = 1;
  let failed = false;
  for (let attempts = 0; at < 1; attempts++) {
    if (step < 1e-12 || attempts > 300) return false;
    const next = Math.min(1, at + step);
    const trial = Float64Array.from(last);
    cluster.independents.forEach(([i], k) => {
      trial[i] = next === 1 ? goal[k] : fma(goal[k] - zero[i], next, zero[i]);
    });
    const moved = whole * (next - at);
    if ((at > 0 || moved <= cluster.reach) && attempt(cluster, trial, signs, moved)) {
      last = trial;
      signs = determinants(cluster, last);
      at = next;
      step *= failed ? 1 : 2;
      failed = false;
    } else {
      step *= 0.5;
      failed = true;
    }
  }
  for (const block of cluster.blocks) block.unknowns.forEach((i) => (q[i] = last[i]));
  return true;
}

// the given numbers, with those of the closures behind them; nothing where a loop stays open
function close(given) {
  const q = Float64Array.from(zero);
  for (const [place, k] of places) q[place] = given[k];
  for (const cluster of clusters) if (!closed(cluster, q)) return null;
  const numbers = new Float64Array(count);
  const both = new Float64Array(size + q.length);
  for (let k = 0; k < size; k++) both[k] = given[k];
  both.set(q, size);
  if (rates(both, numbers) & 2) return null;
  // lengths come last
  const all = new Float64Array(given.length + count);
  all.set(both.subarray(0, size));
  all.set(numbers, size);
  for (let k = size; k < given.length; k++) all[count + k] = given[k];
  return all;
}
