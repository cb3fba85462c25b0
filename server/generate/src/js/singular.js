
// least singular value of a square matrix, row by row, by rotations of its columns (Hestenes)
function least(A, n) {
  const at = (r, c) => A[r * n + c];
  for (let sweep = 0; sweep < 60; sweep++) {
    let turned = false;
    for (let a = 0; a < n; a++) {
      for (let b = a + 1; b < n; b++) {
        let [aa, bb, ab] = [0, 0, 0];
        for (let r = 0; r < n; r++) {
          aa += at(r, a) * at(r, a);
          bb += at(r, b) * at(r, b);
          ab += at(r, a) * at(r, b);
        }
        if (Math.abs(ab) <= 1e-15 * Math.sqrt(aa * bb)) continue;
        turned = true;
        const z = (bb - aa) / (2 * ab);
        const t = (z < 0 ? -1 : 1) / (Math.abs(z) + Math.sqrt(1 + z * z));
        const c = 1 / Math.sqrt(1 + t * t);
        for (let r = 0; r < n; r++) {
          const [x, y] = [at(r, a), at(r, b)];
          A[r * n + a] = c * (x - t * y);
          A[r * n + b] = c * (y + t * x);
        }
      }
    }
    if (!turned) break;
  }
  let found = Infinity;
  for (let a = 0; a < n; a++) {
    let square = 0;
    for (let r = 0; r < n; r++) square += at(r, a) * at(r, a);
    found = Math.min(found, Math.sqrt(square));
  }
  return found;
}

// sigma_min at closed tree coordinates; 1 without loops
function sigma(q) {
  const all = new Float64Array(sizes.reduce((sum, n) => sum + n * n, 0));
  if (loops(q, all) & 2) return NaN;
  let found = Infinity;
  let first = 0;
  for (const n of sizes) {
    found = Math.min(found, least(all.slice(first, first + n * n), n));
    first += n * n;
  }
  return sizes.length === 0 ? 1 : found;
}
