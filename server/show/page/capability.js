"use strict";
// The maps: one quantity over two coordinates with contour lines, the others by sliders.

const element = (id) => document.getElementById(id);
const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const canvas = element("canvas");
const state = { map: 0, quantity: 0, at: [] };
const map = () => maps[state.map];
const units = { torque_max: "N m, N", torque_min: "N m, N", torque_alone: "N m, N",
  speed_max: "rad/s, m/s", speed_free: "rad/s, m/s", reflected_inertia: "kg m², kg", sigma_min: "" };
const words = { torque_max: "largest, others free", torque_min: "least, others free",
  torque_alone: "others zero", speed_max: "others at rest", speed_free: "others free",
  reflected_inertia: "of the rotors", sigma_min: "distance to singular poses of the loops" };

// the quantities of a map: a title and a number of a point
function quantities() {
  const { joints } = map();
  const list = [];
  for (const name of Object.keys(words)) {
    if (name === "sigma_min") {
      list.push([`σ_min: ${words[name]}`, (k) => map()[name][k], units[name]]);
    } else if (name === "reflected_inertia") {
      joints.forEach((a, i) => joints.forEach((b, j) => {
        if (j >= i) list.push([`inertia ${a}${i === j ? "" : ", " + b}: ${words[name]}`,
          (k) => map()[name][k][i]?.[j] ?? null, units[name]]);
      }));
    } else {
      joints.forEach((a, i) => list.push([`${name.replace("_", " ")} ${a}: ${words[name]}`,
        (k) => map()[name][k][i], units[name]]));
    }
  }
  return list;
}

// the number of a point from its places along the coordinates
const index = (at) => at.reduce((k, place, i) => k * map().sizes[i] + place, 0);
const value = (k) => (map().reachable[k] ? quantities()[state.quantity][1](k) : null);
const position = (i, place) =>
  map().ranges[i][0] + ((map().ranges[i][1] - map().ranges[i][0]) * place) / (map().sizes[i] - 1);
const shown = (x) => (x === null || x === undefined ? "none" : Number(x.toPrecision(5)).toString());

// dark blue to yellow, by equal steps of lightness
const stops = [[59, 28, 110], [46, 92, 150], [32, 144, 140], [106, 190, 86], [244, 224, 66]];
function colour(part) {
  const x = Math.min(0.9999, Math.max(0, part)) * (stops.length - 1);
  const k = Math.floor(x);
  return stops[k].map((c, i) => Math.round(c + (stops[k + 1][i] - c) * (x - k)));
}

// places of the two drawn coordinates; a single one is drawn as a line
function grid() {
  const { sizes } = map();
  const get = state.quantity;
  const of = quantities()[get][1];
  const flat = sizes.length === 1;
  const rows = flat ? 1 : sizes[1];
  const numbers = [];
  for (let j = 0; j < rows; j++) {
    for (let i = 0; i < sizes[0]; i++) {
      const at = [...state.at];
      at[0] = i;
      if (!flat) at[1] = j;
      const k = index(at);
      numbers.push(map().reachable[k] ? of(k) : null);
    }
  }
  return { n: sizes[0], rows, numbers };
}

function sized(target) {
  const scale = devicePixelRatio || 1;
  const { clientWidth: w, clientHeight: h } = target;
  target.width = Math.max(1, w * scale);
  target.height = Math.max(1, h * scale);
  const context = target.getContext("2d");
  context.setTransform(scale, 0, 0, scale, 0, 0);
  context.font = "13px system-ui, sans-serif";
  return [context, w, h];
}

const margin = { left: 62, right: 86, top: 24, bottom: 48 };
function frame(w, h) {
  return { x: margin.left, y: margin.top, w: Math.max(40, w - margin.left - margin.right),
    h: Math.max(40, h - margin.top - margin.bottom) };
}

function draw() {
  const [context, w, h] = sized(canvas);
  const box = frame(w, h);
  const { n, rows, numbers } = grid();
  const there = numbers.filter((x) => x !== null && x !== undefined);
  const low = there.reduce((a, b) => Math.min(a, b), Infinity);
  const high = there.reduce((a, b) => Math.max(a, b), -Infinity);
  const part = (x) => (high > low ? (x - low) / (high - low) : 0.5);
  context.fillStyle = style("--ground");
  context.fillRect(0, 0, w, h);
  if (rows === 1) line(context, box, n, numbers, low, high);
  else field(context, box, n, rows, numbers, part, low, high);
  axes(context, box, rows > 1, low, high);
  // the point
  context.strokeStyle = style("--ink");
  context.lineWidth = 2;
  const x = box.x + (box.w * state.at[0]) / (n - 1);
  const y = rows > 1 ? box.y + box.h * (1 - state.at[1] / (rows - 1)) : box.y + box.h;
  context.beginPath();
  context.arc(x, y, 6, 0, 7);
  context.stroke();
  numbersAt();
}

function field(context, box, n, rows, numbers, part, low, high) {
  const image = new ImageData(n, rows);
  numbers.forEach((x, k) => {
    const row = rows - 1 - Math.floor(k / n);
    const to = 4 * (row * n + (k % n));
    const missing = x === null || x === undefined;
    image.data.set(missing ? [128, 128, 128, 60] : [...colour(part(x)), 255], to);
  });
  const small = new OffscreenCanvas(n, rows);
  small.getContext("2d").putImageData(image, 0, 0);
  context.save();
  context.beginPath();
  context.rect(box.x, box.y, box.w, box.h);
  context.clip();
  context.imageSmoothingEnabled = false;
  const cell = [box.w / (n - 1), box.h / (rows - 1)];
  context.drawImage(small, box.x - cell[0] / 2, box.y - cell[1] / 2, box.w + cell[0], box.h + cell[1]);
  // contour lines by triangles of the cells
  context.strokeStyle = "rgba(255,255,255,.85)";
  context.fillStyle = style("--ink");
  context.lineWidth = 1;
  for (let level = 1; level < 9; level++) {
    const at = low + ((high - low) * level) / 9;
    if (!(high > low)) break;
    context.beginPath();
    for (let j = 0; j + 1 < rows; j++) {
      for (let i = 0; i + 1 < n; i++) {
        const corners = [[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]];
        for (const triangle of [[0, 1, 2], [0, 2, 3]]) cut(context, box, n, rows, numbers, at,
          triangle.map((c) => corners[c]));
      }
    }
    context.stroke();
  }
  context.restore();
}

function cut(context, box, n, rows, numbers, at, triangle) {
  const ends = [];
  for (let c = 0; c < 3; c++) {
    const a = triangle[c];
    const b = triangle[(c + 1) % 3];
    const x = numbers[a[1] * n + a[0]];
    const y = numbers[b[1] * n + b[0]];
    if (x === null || y === null || x < at === y < at) continue;
    const t = (at - x) / (y - x);
    ends.push([box.x + (box.w * (a[0] + (b[0] - a[0]) * t)) / (n - 1),
      box.y + box.h * (1 - (a[1] + (b[1] - a[1]) * t) / (rows - 1))]);
  }
  if (ends.length === 2) {
    context.moveTo(...ends[0]);
    context.lineTo(...ends[1]);
  }
}

function line(context, box, n, numbers, low, high) {
  context.strokeStyle = style("--mark");
  context.lineWidth = 2;
  context.beginPath();
  let pen = false;
  numbers.forEach((y, i) => {
    if (y === null || y === undefined) { pen = false; return; }
    const to = [box.x + (box.w * i) / (n - 1),
      box.y + box.h * (1 - (high > low ? (y - low) / (high - low) : 0.5))];
    if (pen) context.lineTo(...to);
    else context.moveTo(...to);
    pen = true;
  });
  context.stroke();
}

function axes(context, box, isPlane, low, high) {
  const { joints, ranges } = map();
  context.fillStyle = style("--ink");
  context.strokeStyle = style("--rule");
  context.lineWidth = 1;
  context.strokeRect(box.x, box.y, box.w, box.h);
  context.textAlign = "center";
  for (let k = 0; k <= 4; k++) {
    const x = ranges[0][0] + ((ranges[0][1] - ranges[0][0]) * k) / 4;
    context.fillText(shown(x), box.x + (box.w * k) / 4, box.y + box.h + 18);
  }
  context.fillText(joints[0], box.x + box.w / 2, box.y + box.h + 38);
  context.textAlign = "right";
  const [from, to] = isPlane ? ranges[1] : [low, high];
  for (let k = 0; k <= 4; k++) {
    context.fillText(shown(from + ((to - from) * k) / 4), box.x - 8, box.y + box.h * (1 - k / 4) + 4);
  }
  context.textAlign = "left";
  context.fillText(isPlane ? joints[1] : quantities()[state.quantity][2], 6, box.y - 8);
  if (!isPlane || !(low <= high)) return;
  for (let k = 0; k < 100; k++) {
    context.fillStyle = `rgb(${colour(k / 100)})`;
    context.fillRect(box.x + box.w + 12, box.y + box.h * (1 - (k + 1) / 100), 12, box.h / 100 + 1);
  }
  context.fillStyle = style("--ink");
  for (let k = 0; k <= 3; k++) {
    context.fillText(shown(low + ((high - low) * k) / 3), box.x + box.w + 28, box.y + box.h * (1 - k / 3) + 4);
  }
}

// the numbers of the point, and the set of its torques
function numbersAt() {
  const k = index(state.at);
  const body = element("numbers").tBodies[0];
  body.replaceChildren();
  const add = (name, x) => {
    const row = body.insertRow();
    row.insertCell().textContent = name;
    row.insertCell().textContent = x;
  };
  map().joints.forEach((joint, i) => add(joint, shown(map().points[k][i] ?? position(i, state.at[i]))));
  if (!map().reachable[k]) add("pose", "not reached");
  quantities().forEach(([name, of, unit]) =>
    add(name, map().reachable[k] ? `${shown(of(k))} ${unit}` : "none"));
  map().motors.forEach((motor, i) => add(`u ${motor}`, shown(map().u[k][i])));
  const vertices = map().torque_vertices?.[k] ?? [];
  element("title").hidden = element("set").hidden = !map().torque_vertices;
  if (map().torque_vertices) drawSet(vertices);
}

function drawSet(vertices) {
  const [context, w, h] = sized(element("set"));
  const all = maps[state.map].torque_vertices.flat();
  const most = all.reduce((m, v) => Math.max(m, Math.abs(v[0]), Math.abs(v[1])), 1e-9);
  const now = vertices.reduce((m, v) => Math.max(m, Math.abs(v[0]), Math.abs(v[1])), 0) || most;
  const scale = (Math.min(w, h) / 2 - 22) / Math.min(most, 1.5 * now);
  const to = ([x, y]) => [w / 2 + x * scale, h / 2 - y * scale];
  context.clearRect(0, 0, w, h);
  context.strokeStyle = style("--rule");
  context.beginPath();
  context.moveTo(0, h / 2);
  context.lineTo(w, h / 2);
  context.moveTo(w / 2, 0);
  context.lineTo(w / 2, h);
  context.stroke();
  context.fillStyle = style("--soft");
  context.textAlign = "right";
  context.fillText(map().joints[0], w - 4, h / 2 - 6);
  context.textAlign = "left";
  context.fillText(map().joints[1], w / 2 + 6, 14);
  if (!vertices.length) return;
  context.strokeStyle = style("--mark");
  context.lineWidth = 2;
  context.beginPath();
  vertices.forEach((v, i) => (i ? context.lineTo(...to(v)) : context.moveTo(...to(v))));
  context.closePath();
  context.globalAlpha = 0.2;
  context.fillStyle = style("--mark");
  context.fill();
  context.globalAlpha = 1;
  context.stroke();
}

function choose() {
  const { sizes, joints, name, submechanism, no_limit, unreachable_corners } = map();
  state.at = sizes.map((n) => Math.floor((n - 1) / 2));
  state.quantity = Math.min(state.quantity, quantities().length - 1);
  element("quantity").replaceChildren(...quantities().map(([title], k) => new Option(title, k)));
  element("quantity").value = state.quantity;
  const reached = map().reachable.filter((x) => x).length;
  element("about").textContent =
    `${submechanism ?? name}: ${sizes.join(" × ")} points, ${reached} of ${map().reachable.length} reached`;
  element("sliders").replaceChildren(...joints.map((joint, i) => {
    const holder = document.createElement("div");
    holder.className = "slider";
    const label = document.createElement("label");
    const output = document.createElement("output");
    const input = document.createElement("input");
    Object.assign(input, { type: "range", min: 0, max: sizes[i] - 1, step: 1, id: `at${i}` });
    label.htmlFor = input.id;
    label.textContent = joint;
    input.addEventListener("input", () => { state.at[i] = Number(input.value); follow(); });
    holder.append(label, output, input);
    return holder;
  }));
  const corners = unreachable_corners.map((corner) => `(${corner.map(shown).join(", ")})`);
  element("notes").textContent = [
    no_limit.length ? `No limit of force or speed: ${no_limit.join(", ")}.` : "",
    corners.length ? `Corners of the joints' ranges that are not reached: ${corners.join(", ")}.` : "",
    "Grey: no pose. Each number holds at rest.",
  ].join(" ");
  follow();
}

function follow() {
  state.at.forEach((place, i) => {
    const input = element(`at${i}`);
    input.value = place;
    input.previousElementSibling.textContent = shown(position(i, place));
  });
  draw();
}

function point(event) {
  const bounds = canvas.getBoundingClientRect();
  const box = frame(bounds.width, bounds.height);
  const { sizes } = map();
  const place = (part, n) => Math.min(n - 1, Math.max(0, Math.round(part * (n - 1))));
  state.at[0] = place((event.clientX - bounds.left - box.x) / box.w, sizes[0]);
  if (sizes.length > 1) state.at[1] = place(1 - (event.clientY - bounds.top - box.y) / box.h, sizes[1]);
  follow();
}

canvas.addEventListener("pointermove", point);
canvas.addEventListener("pointerdown", point);
canvas.addEventListener("keydown", (event) => {
  const step = { ArrowLeft: [0, -1], ArrowRight: [0, 1], ArrowDown: [1, -1], ArrowUp: [1, 1] }[event.key];
  if (!step || step[0] >= state.at.length) return;
  event.preventDefault();
  const [i, d] = step;
  state.at[i] = Math.min(map().sizes[i] - 1, Math.max(0, state.at[i] + d));
  follow();
});
element("map").replaceChildren(...maps.map((one, k) => new Option(one.submechanism, k)));
element("map").addEventListener("change", (event) => { state.map = Number(event.target.value); choose(); });
element("quantity").addEventListener("change", (event) => { state.quantity = Number(event.target.value); follow(); });
addEventListener("resize", draw);
if (maps.length) choose();
