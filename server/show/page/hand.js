"use strict";
// A hand that is dragged: y follows by damped steps on the page's own functions.

const hand = { link: -1, target: null };

// where the hand is, with the answer of the pose; nothing where there is none
function place(y) {
  const at = answered(pose, y);
  if (at.state === 2) return null;
  let { frame } = robot.links[hand.link];
  for (const kernel of frames) {
    const { rows, columns } = kernel.wanted.frame_pose;
    const count = (rows * columns) / 7;
    if (frame < count) {
      const own = kernel === pose ? at : answered(kernel, y);
      if (own.state === 2) return null;
      return { y, at, p: own.get("frame_pose").slice(7 * frame, 7 * frame + 3) };
    }
    frame -= count;
  }
  return null;
}

// coordinates with their columns ∂p/∂y, by differences of answers
function columnsOf(here) {
  const list = [];
  robot.y.forEach((of, k) => {
    if (!isShown(of)) return;
    for (const h of [1e-7, -1e-7]) {
      const there = place(normalised(here.y.map((x, i) => (i === k ? x + h : x))));
      if (!there) continue;
      list.push([k, there.p.map((x, i) => (x - here.p[i]) / h)]);
      break;
    }
  });
  return list;
}

// bounds of y and u as rows over the chosen coordinates: [name, row, room down, room up]
function bounds(here, list) {
  const n = robot.y.length;
  const room = (of, x) => [(of.lower ?? -Infinity) - x, (of.upper ?? Infinity) - x];
  const rows = list.map(([k], c) =>
    [robot.y[k].name, list.map((_, i) => (i === c ? 1 : 0)), ...room(robot.y[k], here.y[k])]);
  // velocities of quaternions are not their rates
  if (robot.y.some((of) => of.part)) return rows;
  const G_u = here.at.get("G_u");
  here.at.get("u").forEach((x, r) => {
    const of = robot.u[r];
    rows.push([of.name, list.map(([k]) => G_u[r * n + k]), ...room(of, x)]);
  });
  return rows;
}

// the step that least squares of the distance and of its own length give, along the bounds at
// which it would leave the limits
function stepOf(off, list, rows) {
  const n = list.length;
  const dot = (a, b) => a.reduce((sum, x, i) => sum + x * b[i], 0);
  const size = list.reduce((sum, [, column]) => sum + dot(column, column), 0);
  const damping = 1e-2 * dot(off, off) + 1e-9 * size + 1e-12;
  const kept = [];
  for (;;) {
    const A = list.map(([, a], i) => [
      ...list.map(([, b], j) => dot(a, b) + (i === j ? damping : 0)),
      ...kept.map(([, row]) => row[i]),
    ]);
    kept.forEach(([, row]) => A.push([...row, ...kept.map(() => 0)]));
    const all = solved(A, [...list.map(([, a]) => dot(a, off)), ...kept.map(() => 0)]);
    if (!all) return { step: list.map(() => 0), kept };
    const step = all.slice(0, n);
    const close = 1e-6;
    const next = rows.find((of) => {
      const by = dot(of[1], step);
      return !kept.includes(of) && ((by > 0 && of[3] < close) || (by < 0 && of[2] > -close));
    });
    if (!next || kept.length === n) {
      // no farther than to the next bound, and no more than 0.3 in a coordinate
      let part = Math.min(1, 0.3 / Math.max(1e-12, ...step.map(Math.abs)));
      for (const of of rows) {
        const by = dot(of[1], step);
        if (kept.includes(of) || by === 0) continue;
        const room = Math.max(0, (by > 0 ? of[3] : -of[2]) - close / 2);
        part = Math.min(part, room / Math.abs(by));
      }
      return { step: step.map((x) => part * x), kept };
    }
    kept.push(next);
  }
}

// moves the hand toward a point by poses inside the limits, each nearer than the one before
function reach(target, steps = 40) {
  stop();
  hand.target = target;
  const away = (of) => distance(of.p, target);
  let here = place(now.answer.y);
  // a pose outside of its limits may be left
  const allowed = here?.at.state;
  let last = [];
  for (let k = 0; here && k < steps && away(here) > 1e-9; k++) {
    const list = columnsOf(here);
    const off = target.map((x, i) => x - here.p[i]);
    const { step, kept } = stepOf(off, list, bounds(here, list));
    last = kept;
    let next = null;
    for (let part = 1; part > 1e-3 && !next; part /= 2) {
      const y = [...here.y];
      list.forEach(([i], c) => (y[i] += part * step[c]));
      const there = place(normalised(y));
      if (there && there.at.state <= allowed && away(there) < away(here) - 1e-12) next = there;
    }
    if (!next) break;
    here = next;
  }
  if (!here) return;
  const answer = set(here.y);
  if (away(here) > 1e-6 && answer.status === "ok") {
    const names = last.map(([name]) => name).join(", ");
    now.why = `. The hand stays ${text(away(here))} m from its target`
      + (names ? `, at the limits of ${names}` : "");
    show();
  }
}

// whether a point of the picture is on the hand, from where it is dragged then
function grab(at, near) {
  if (hand.link < 0 || !now.answer) return false;
  const { clientWidth, clientHeight } = view.canvas;
  const p = now.answer.worlds[hand.link].slice(0, 3);
  const of = pixel(p, clientWidth, clientHeight);
  hand.target = p;
  return Math.hypot(at[0] - of[0], at[1] - of[1]) < near;
}

// moves the target by pixels, in the plane through it that faces the eye
function drag(x, y) {
  const { at, back, right, up } = eye();
  const deep = hand.target.reduce((sum, t, k) => sum - back[k] * (t - at[k]), 0);
  const least = Math.max(1, Math.min(view.canvas.clientWidth, view.canvas.clientHeight));
  const scale = (2 * Math.max(1e-9, deep) * Math.tan(angle / 2)) / least;
  reach(hand.target.map((t, k) => t + scale * (x * right[k] - y * up[k])), 6);
}

// the link and the fields of its place, which keys change
function makeHand() {
  const choice = element("held");
  robot.links.forEach(({ name, frame }, k) => {
    if (frame !== null) choice.add(new Option(name, k));
  });
  element("hand").hidden = choice.length === 0;
  const tip = robot.links.findIndex(({ name }) => name === robot.tips[0]);
  if (tip >= 0) choice.value = tip;
  Object.assign(view, { grab, drag });
  const choose = () => {
    hand.link = choice.length > 0 ? Number(choice.value) : -1;
    view.hand = hand.link;
  };
  choose();
  choice.addEventListener("change", () => {
    choose();
    show();
  });
  ["x", "y", "z"].forEach((axis, k) => {
    const row = document.createElement("div");
    row.className = "slider";
    const label = document.createElement("label");
    label.htmlFor = `hand_${axis}`;
    label.textContent = `${axis}, m`;
    const input = document.createElement("input");
    Object.assign(input, { type: "number", id: label.htmlFor, step: "any" });
    const move = (value) => {
      if (!now.answer || !Number.isFinite(value)) return;
      const p = now.answer.worlds[hand.link].slice(0, 3);
      p[k] = value;
      reach(p);
    };
    input.addEventListener("change", () => move(Number(input.value)));
    input.addEventListener("keydown", (event) => {
      const by = { ArrowDown: -1, ArrowUp: 1, PageDown: -10, PageUp: 10 }[event.key];
      if (!by || !now.answer) return;
      event.preventDefault();
      move(now.answer.worlds[hand.link][k] + (by * view.size) / 200);
      showHand();
    });
    row.append(label, input);
    element("places").append(row);
  });
}

function showHand() {
  if (hand.link < 0 || !now.answer) return;
  const p = now.answer.worlds[hand.link];
  ["x", "y", "z"].forEach((axis, k) => {
    const field = element(`hand_${axis}`);
    // a swing does not write into a field in which somebody writes
    if (swinging === null || document.activeElement !== field) field.value = text(p[k]);
  });
}
