"use strict";
// Poses [x, y, z, qx, qy, qz, qw] of a frame in another.

function turned(pose, v) {
  const [x, y, z, w] = pose.slice(3);
  const t = [2 * (y * v[2] - z * v[1]), 2 * (z * v[0] - x * v[2]), 2 * (x * v[1] - y * v[0])];
  return [
    v[0] + w * t[0] + y * t[2] - z * t[1],
    v[1] + w * t[1] + z * t[0] - x * t[2],
    v[2] + w * t[2] + x * t[1] - y * t[0],
  ];
}

function placed(pose, p) {
  const v = turned(pose, p);
  return [pose[0] + v[0], pose[1] + v[1], pose[2] + v[2]];
}

function times(a, b) {
  const [x, y, z, w] = a.slice(3);
  const [X, Y, Z, W] = b.slice(3);
  return [
    ...placed(a, b),
    w * X + x * W + y * Z - z * Y,
    w * Y + y * W + z * X - x * Z,
    w * Z + z * W + x * Y - y * X,
    w * W - x * X - y * Y - z * Z,
  ];
}

function inverse(a) {
  const back = [0, 0, 0, -a[3], -a[4], -a[5], a[6]];
  return [...turned(back, [-a[0], -a[1], -a[2]]), ...back.slice(3)];
}

const unit = [0, 0, 0, 0, 0, 0, 1];

function distance(a, b) {
  return Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
}

// x of A x = b by elimination with pivoting; nothing where A is singular
function solved(A, b) {
  const n = b.length;
  const rows = A.map((row, k) => [...row, b[k]]);
  for (let k = 0; k < n; k++) {
    let best = k;
    for (let r = k + 1; r < n; r++) if (Math.abs(rows[r][k]) > Math.abs(rows[best][k])) best = r;
    [rows[k], rows[best]] = [rows[best], rows[k]];
    if (!(Math.abs(rows[k][k]) > 1e-14)) return null;
    for (let r = k + 1; r < n; r++) {
      const part = rows[r][k] / rows[k][k];
      for (let c = k; c <= n; c++) rows[r][c] -= part * rows[k][c];
    }
  }
  const x = new Array(n).fill(0);
  for (let k = n - 1; k >= 0; k--) {
    let sum = rows[k][n];
    for (let c = k + 1; c < n; c++) sum -= rows[k][c] * x[c];
    x[k] = sum / rows[k][k];
  }
  return x;
}
