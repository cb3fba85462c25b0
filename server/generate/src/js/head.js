// Fused multiply-add, sine, cosine and arc tangent: the operations of sarrus, one by one.

const double = new Float64Array(1);
const word = new Uint32Array(double.buffer);
const low = new Uint8Array(new Uint16Array([1]).buffer)[0] === 1 ? 0 : 1;

// x + y, rounded to odd where it is inexact: another rounding afterwards is that of the exact sum
function odd(x, y) {
  const s = x + y;
  const t = s - x;
  const error = (x - (s - t)) + (y - t);
  if (error === 0) return s;
  double[0] = s;
  if (word[low] & 1) return s;
  if (error > 0 === s > 0) {
    word[low] += 1;
  } else {
    if (word[low] === 0) word[1 - low] -= 1;
    word[low] -= 1;
  }
  return double[0];
}

// a b + c, rounded once (Boldo and Melquiond 2008)
function fma(a, b, c) {
  const p = a * b;
  const size = Math.abs(p);
  if (!(size < 1e280 && Math.abs(a) < 1e280 && Math.abs(b) < 1e280 && Math.abs(c) < 1e290)) {
    return p + c;
  }
  if (size < 1e-250) {
    // the error of such a product may be no double
    if (a === 0 || b === 0 || Math.abs(c) > 1e-200) return p + c;
    return fma(a * 1.6069380442589903e60, b * 1.6069380442589903e60, c * 2.5822498780869086e120)
      * 3.8725919148493183e-121;
  }
  let t = 134217729 * a;
  const a1 = t - (t - a);
  const a0 = a - a1;
  t = 134217729 * b;
  const b1 = t - (t - b);
  const b0 = b - b1;
  const e = a0 * b0 - (((p - a1 * b1) - a0 * b1) - a1 * b0);
  if (e === 0) return p + c;
  const h = c + e;
  t = h - c;
  const l = (c - (h - t)) + (e - t);
  const v = p + h;
  t = v - p;
  return v + odd((p - (v - t)) + (h - t), l);
}

// x with the sign of s before its own
function signed(x, s) {
  return s < 0 || (s === 0 && 1 / s < 0) ? -x : x;
}

function choose(first, a, b) {
  return first ? a : b;
}

function larger(a, b) {
  return a > b ? a : b;
}

// -0 where bit k of an integer is set
function bit(n, k) {
  return Math.floor(n / (1 << k)) % 2 === 1 ? -0 : 0;
}

const turn = new Float64Array(2);
