"use strict";
// The sliders, the table of motors and the status in words.

const words = {
  unreachable: "Unreachable: no pose closes the loops here",
  singular_closure: "Singular: the loops lose a rank here",
  not_found: "No pose found: neither the closed forms nor Newton's method are certain here",
  no_motors: "Unreachable: no pose of this branch has these motor positions",
  no_forces: "Singular: the motors do not control the robot here, or no digit of a force is certain",
  ok: "ok",
};
// sigma_min from which on the status speaks of it
const near = 0.01;
const element = (id) => document.getElementById(id);
const now = { by: "y", y: [], answer: null, status: "ok", why: "" };

// the quaternion's real part follows the others
const isShown = (of) => of.part !== "qw";
const quaternion = (k) => robot.y[k].part === "qx";

function text(x) {
  return (Math.abs(x) < 5e-5 ? 0 : x).toFixed(4);
}

function range(of) {
  const usual = of.slides || of.part ? (of.part.startsWith("q") ? 1 : 0.5) : Math.PI;
  const lower = of.lower ?? (of.upper === null ? -usual : of.upper - 2 * usual);
  return [lower, of.upper ?? lower + 2 * usual];
}

// y at which the page opens: zero, or the end of the range next to it
function start() {
  const y = robot.y.map((of) => {
    const [lower, upper] = range(of);
    return of.part === "qw" ? 1 : Math.min(upper, Math.max(lower, 0));
  });
  return normalised(y);
}

function normalised(y) {
  robot.y.forEach((_, k) => {
    if (!quaternion(k)) return;
    const v = y.slice(k, k + 3);
    const size = Math.hypot(...v);
    const part = size > 0.999 ? 0.999 / size : 1;
    v.forEach((x, i) => (y[k + i] = x * part));
    y[k + 3] = Math.sqrt(1 - Math.min(0.998001, (size * part) ** 2));
  });
  return y;
}

// ranges of u: limits, else where the robot takes its motors
function ranges() {
  const seen = robot.u.map(() => [Infinity, -Infinity]);
  let seed = 1;
  const random = () => (seed = (seed * 48271) % 2147483647) / 2147483647;
  for (let k = 0; k < 300; k++) {
    const y = robot.y.map((of, i) => {
      const [lower, upper] = range(of);
      return of.part ? start()[i] : lower + (upper - lower) * random();
    });
    const at = answered(pose, y);
    if (at.state === 2) continue;
    at.get("u").forEach((x, i) => {
      seen[i] = [Math.min(seen[i][0], x), Math.max(seen[i][1], x)];
    });
  }
  return robot.u.map((of, i) => {
    const usual = seen[i][0] < seen[i][1] ? seen[i] : range(of);
    return [of.lower ?? usual[0], of.upper ?? usual[1]];
  });
}

let ends = null;

function makeSliders() {
  const box = element("sliders");
  box.replaceChildren();
  const list = now.by === "y" ? robot.y : robot.u;
  if (now.by === "u") ends ??= ranges();
  list.forEach((of, k) => {
    if (now.by === "y" && !isShown(of)) return;
    const [lower, upper] = now.by === "y" ? range(of) : ends[k];
    const row = document.createElement("div");
    row.className = "slider";
    const label = document.createElement("label");
    label.htmlFor = `slider${k}`;
    label.textContent = of.name;
    const output = document.createElement("output");
    output.htmlFor = label.htmlFor;
    const input = document.createElement("input");
    Object.assign(input, { type: "range", id: label.htmlFor, min: lower, max: upper, step: "any" });
    input.dataset.index = k;
    input.addEventListener("input", () => slide(k, Number(input.value)));
    input.addEventListener("keydown", (event) => {
      const by = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1, PageDown: -10, PageUp: 10 };
      if (!(event.key in by)) return;
      event.preventDefault();
      const value = Number(input.value) + (by[event.key] * (upper - lower)) / 100;
      input.value = Math.min(upper, Math.max(lower, value));
      slide(k, Number(input.value));
    });
    row.append(label, output, input);
    box.append(row);
  });
}

// sliders of a force and a moment along the root's axes
function makeForces() {
  element("load").hidden = robot.tips.length === 0;
  robot.tips.forEach((name, k) => element("tip").add(new Option(name, k)));
  element("tip").addEventListener("change", (event) => {
    load.tip = Number(event.target.value);
    again();
  });
  for (const [name, most, unit] of [["force", 100, "N"], ["moment", 10, "N m"]]) {
    ["x", "y", "z"].forEach((axis, k) => {
      const row = document.createElement("div");
      row.className = "slider";
      const label = document.createElement("label");
      label.htmlFor = `${name}_${axis}`;
      label.textContent = `${name} along ${axis}`;
      const output = document.createElement("output");
      const input = document.createElement("input");
      Object.assign(input, { type: "range", id: label.htmlFor, min: -most, max: most, step: most / 100, value: 0 });
      const say = () => {
        output.textContent = `${input.value} ${unit}`;
        input.setAttribute("aria-valuetext", output.textContent);
      };
      say();
      input.addEventListener("input", () => {
        load[name][k] = Number(input.value);
        say();
        again();
      });
      row.append(label, output, input);
      element("forces").append(row);
    });
  }
}

// the same pose once more
function again() {
  if (swinging === null) set(now.y);
}

function makeMotors() {
  const body = element("motors").tBodies[0];
  robot.u.forEach((of) => {
    const row = body.insertRow();
    row.insertCell().textContent = of.name;
    for (let k = 0; k < 2; k++) {
      const cell = row.insertCell();
      const number = document.createElement("span");
      const bar = document.createElement("div");
      bar.className = "bar";
      bar.append(document.createElement(k === 0 ? "i" : "b"));
      cell.append(number, bar);
    }
  });
}

function slide(k, value) {
  stop();
  if (now.by === "y") {
    const y = [...now.y];
    y[k] = value;
    set(normalised(y));
  } else {
    const from = now.answer ?? ask(start(), zeros, zeros);
    const u = [...from.u];
    u[k] = value;
    const y = independents(u, from.y);
    if (y) {
      set(y);
    } else {
      const part = reached(from.u, u, (at) => independents(at, from.y) !== null, 10);
      now.status = "no_motors";
      now.why = `. On the way ${robot.u[k].name} comes to ${text(from.u[k] + part * (value - from.u[k]))}. The last pose stands.`;
      show(value, k);
    }
  }
}

// takes y, and its rates, and shows the answer
function set(y, yd = zeros, ydd = zeros) {
  now.y = y;
  const answer = ask(y, yd, ydd);
  now.status = answer.status;
  now.why = "";
  if (answer.status === "no_pose") explain(y);
  if (answer.worlds) {
    now.answer = answer;
    view.worlds = answer.worlds;
  }
  show();
  return answer;
}

// the reason of a missing pose, and the end of the way to it from the last one
function explain(y) {
  now.status = "not_found";
  if (!now.answer) return;
  const from = now.answer.y;
  const { status, y: last, sigma } = reason(from, y);
  now.status = status;
  const far = y.map((x, k) => Math.abs(x - from[k]));
  const k = far.indexOf(Math.max(...far));
  const limits = ask(last, zeros, zeros).exceeded ?? [];
  now.why = `. On the way ${robot.y[k].name} comes to ${text(last[k])}, σ_min ${sigma.toExponential(1)}`
    + `${limits.length > 0 ? `, with ${limits.join(", ")}` : ""}. The last pose stands.`;
}

function show(asked, of) {
  const { answer, status } = now;
  const fails = status !== "ok";
  const exceeded = answer && !fails ? answer.exceeded : [];
  const notes = [];
  if (!fails && answer.sigma_min < near) {
    notes.push(`Near a singular pose: σ_min ${answer.sigma_min.toExponential(1)}`);
  }
  if (exceeded.length > 0) notes.push(`Outside a limit: ${exceeded.join(", ")}`);
  element("picture").className = fails || notes.length > 0 ? "bad" : "";
  const spoken = element("status");
  spoken.className = fails ? "bad" : notes.length > 0 ? "warn" : "";
  spoken.textContent = notes.length > 0 ? notes.join(". ") : words[status] + now.why;
  spoken.dataset.status = status;
  element("distance").textContent = !robot.closed || !answer
    ? "" : `Distance to a singular pose, σ_min: ${text(answer.sigma_min)}`;
  element("distance").dataset.value = answer?.sigma_min;
  for (const input of document.querySelectorAll("#sliders input")) {
    const k = Number(input.dataset.index);
    const list = now.by === "y" ? robot.y : robot.u;
    const value = k === of ? asked : now.by === "y" ? now.y[k] : answer?.u[k];
    if (value === undefined) continue;
    if (document.activeElement !== input || k !== of) input.value = value;
    const unit = list[k].part.startsWith("q") ? "" : list[k].slides || list[k].part ? " m" : " rad";
    const output = input.parentElement.querySelector("output");
    output.textContent = text(value) + unit;
    input.setAttribute("aria-valuetext", output.textContent);
  }
  const rows = element("motors").tBodies[0].rows;
  robot.u.forEach((motor, k) => {
    const [u, tau] = [answer?.u[k], status === "ok" ? answer.tau_u?.[k] : undefined];
    const [, first, second] = rows[k].cells;
    const low = motor.lower ?? -1;
    const high = motor.upper ?? 1;
    const limited = motor.lower !== null || motor.upper !== null;
    put(first, u, motor.slides ? "m" : "rad", limited && beyond(u ?? NaN, motor) !== null);
    first.querySelector(".bar").hidden = !(motor.lower !== null && motor.upper !== null);
    const at = Math.min(1, Math.max(0, (u - low) / (high - low)));
    first.querySelector("i").style.left = `${100 * at}%`;
    put(second, tau, motor.slides ? "N" : "N m", motor.effort !== null && Math.abs(tau) > motor.effort);
    const bar = second.querySelector("b");
    bar.parentElement.hidden = motor.effort === null;
    const part = Math.min(1, Math.abs(tau ?? 0) / (motor.effort || 1)) / 2;
    bar.style.left = `${100 * (tau < 0 ? 0.5 - part : 0.5)}%`;
    bar.style.width = `${100 * part}%`;
    second.title = motor.effort === null ? "" : `limit ${motor.effort}`;
    first.title = limited ? `limits ${motor.lower ?? "none"} to ${motor.upper ?? "none"}` : "";
  });
  const line = { y: now.y, want: ["q", "u", "tau_u"] };
  if ([...load.moment, ...load.force].some((x) => x !== 0)) {
    line.wrenches = { [robot.tips[load.tip]]: [...load.moment, ...load.force] };
  }
  element("command").textContent =
    `echo '${JSON.stringify(line)}' | sarrus ask inverse-dynamics ${robot.flags}`;
  showHand();
  view.draw();
}

function put(cell, x, unit, over) {
  const number = cell.querySelector("span");
  number.textContent = x === undefined ? "–" : `${text(x)} ${unit}`;
  number.className = over ? "over" : "";
  number.dataset.value = x;
  cell.querySelector(".bar").classList.toggle("over", over);
}

// every joint through a part of its range, one after the other, from rest to rest
let swinging = null;

function swing() {
  const seconds = 3;
  const joints = robot.y.map((of, k) => [of, k]).filter(([of]) => of.part === "");
  if (joints.length === 0) return;
  const rest = start();
  const begin = performance.now();
  element("swing").setAttribute("aria-pressed", "true");
  const frame = (time) => {
    const t = Math.max(0, time - begin) / 1000;
    const [of, k] = joints[Math.floor(t / seconds) % joints.length];
    const [lower, upper] = range(of);
    const w = (2 * Math.PI) / seconds;
    // out and back twice as smooth as a cycloid's half: (1 − cos w t) / 2 of the larger side
    const far = upper - rest[k] > rest[k] - lower ? upper - rest[k] : lower - rest[k];
    const part = (0.5 * far) / 2;
    const s = t % seconds;
    const y = [...rest];
    const yd = [...zeros];
    const ydd = [...zeros];
    const v = robot.yd.indexOf(of.name);
    y[k] = rest[k] + part * (1 - Math.cos(w * s));
    yd[v] = part * w * Math.sin(w * s);
    ydd[v] = part * w * w * Math.cos(w * s);
    set(y, yd, ydd);
    swinging = requestAnimationFrame(frame);
  };
  swinging = requestAnimationFrame(frame);
}

function stop() {
  if (swinging !== null) cancelAnimationFrame(swinging);
  swinging = null;
  element("swing").setAttribute("aria-pressed", "false");
}

(() => {
  element("name").textContent = robot.name;
  const n = (count, word) => `${count} ${word}${count === 1 ? "" : "s"}`;
  element("about").textContent =
    `${n(robot.q.length, "tree coordinate")}, ${n(robot.yd.length, "independent")}, `
    + `${n(robot.u.length, "motor")}, ${n(robot.loops.length, "cut")}. Poses and forces at rest, or of the swing.`;
  const off = deviation.worst === 0 ? "0" : deviation.worst.toExponential(1);
  element("fine").textContent =
    `Largest deviation from sarrus ${robot.version} in this browser: ${off}, by the size of each `
    + `field, on ${deviation.states - deviation.left} of ${deviation.states} states. ${robot.operations} operations; fingerprint ${robot.fingerprint}.`
    + robot.notes.map((note) => ` ${note}.`).join("");
  const y = start();
  const answer = ask(y, zeros, zeros);
  if (answer.worlds) fitAll([answer.worlds]);
  open(element("canvas"));
  if (robot.u.length !== robot.yd.length || robot.y.some((of) => of.part)) {
    document.querySelector("#by input[value=u]").disabled = true;
  }
  makeSliders();
  makeMotors();
  makeForces();
  makeHand();
  set(y);
  element("by").addEventListener("change", (event) => {
    stop();
    now.by = event.target.value;
    if (now.answer) now.y = now.answer.y;
    makeSliders();
    set(now.y);
  });
  chooseShown(element("shown"));
  element("swing").addEventListener("click", () => (swinging === null ? swing() : stop()));
  element("zero").addEventListener("click", () => {
    stop();
    set(start());
  });
  if (robot.swing && !matchMedia("(prefers-reduced-motion: reduce)").matches) swing();
})();
