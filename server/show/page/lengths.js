"use strict";
// A mechanism whose lengths are inputs of its generated code: γ, G and its singular poses.

const element = (id) => document.getElementById(id);
// for the view: no force acts
const load = { tip: 0, force: [0, 0, 0], moment: [0, 0, 0] };
const freedoms = robot.y.length;
const first = { lengths: robot.lengths.map((of) => of.value), y: robot.y.map(() => 0) };
const now = { lengths: [...first.lengths], y: [...first.y], answer: null };
// samples of a curve, and cells of a side of a map
const [SAMPLES, CELLS] = [241, 41];

const sizes = (fields) => Object.values(fields).reduce((sum, of) => sum + of.rows * of.columns, 0);
const given = new Float64Array(sizes(pose.given));
const wanted = new Float64Array(pose.outputs);

function field(name) {
  const { at, rows, columns } = pose.wanted[name];
  return Array.from(wanted.subarray(at, at + rows * columns));
}

// γ and G at y; nothing where no way leads there from the first pose
function ask(y, lengths) {
  for (const [name, numbers] of Object.entries({ y, lengths, q_guess: robot.zero })) {
    given.set(numbers, pose.given[name].at);
  }
  if (pose.ask(given, wanted) === 2) return null;
  return { q: field("q"), u: field("u"), G: field("G"), G_u: field("G_u"), poses: field("frame_pose") };
}

// det G_u: the motors lose the mechanism where it vanishes
function determinant({ G_u }) {
  return freedoms === 1 ? G_u[0] : G_u[0] * G_u[3] - G_u[1] * G_u[2];
}

// the largest deviation from the plans of robots with other lengths, by the size of the field
const deviation = (() => {
  const found = { worst: 0, states: 0, left: 0 };
  for (const { lengths, y, q, G } of robot.checks) {
    const answer = ask(y, lengths);
    found.states += 1;
    found.left += answer ? 0 : 1;
    for (const [own, expected] of answer ? [[answer.q, q], [answer.G, G]] : []) {
      const size = Math.max(1e-300, ...expected.map(Math.abs));
      own.forEach((x, k) => {
        const off = Math.abs(x - expected[k]) / size;
        found.worst = off <= found.worst ? found.worst : off;
      });
    }
  }
  return found;
})();

function worlds({ poses }) {
  const found = [];
  for (let k = 0; k < poses.length; k += 7) found.push(poses.slice(k, k + 7));
  return found;
}

const text = (x) => (Math.abs(x) < 5e-5 ? 0 : x).toFixed(4);

function makeSliders(box, list, numbers) {
  return list.map(({ name, lower, upper, unit }, k) => {
    const row = document.createElement("div");
    row.className = "slider";
    const label = document.createElement("label");
    const output = document.createElement("output");
    const input = document.createElement("input");
    label.htmlFor = output.htmlFor = `${box}${k}`;
    label.textContent = name;
    Object.assign(input, { type: "range", id: label.htmlFor, min: lower, max: upper, step: "any" });
    const show = () => {
      input.value = numbers()[k];
      output.textContent = `${text(numbers()[k])} ${unit}`;
      input.setAttribute("aria-valuetext", output.textContent);
    };
    const take = (value) => {
      numbers()[k] = Math.min(upper, Math.max(lower, value));
      update(box === "lengths");
    };
    input.addEventListener("input", () => take(Number(input.value)));
    input.addEventListener("keydown", (event) => {
      const by = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1, PageDown: -10, PageUp: 10 };
      if (!(event.key in by)) return;
      event.preventDefault();
      take(numbers()[k] + (by[event.key] * (upper - lower)) / 100);
    });
    row.append(label, output, input);
    element(box).append(row);
    return show;
  });
}

const ink = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
let charts = [];
// what the curves or the map show
let seen = null;

// of one freedom: u and G_u over y, dashed with the first lengths
function curves() {
  const y = Array.from({ length: SAMPLES }, (_, k) => robot.reach * ((2 * k) / (SAMPLES - 1) - 1));
  const of = (lengths) => {
    const answers = y.map((x) => ask([x], lengths));
    return [answers.map((answer) => answer && answer.u[0]), answers.map((answer) => answer && answer.G_u[0])];
  };
  const [u, G_u] = of(now.lengths);
  curves.first ??= of(first.lengths);
  // the sign of G_u changes between two samples: halved until y is met to 1e-12
  const zeros = [];
  for (let k = 1; k < SAMPLES; k++) {
    if (G_u[k] === null || G_u[k - 1] === null || G_u[k] * G_u[k - 1] > 0) continue;
    let [low, high] = [y[k - 1], y[k]];
    while (high - low > 1e-12) {
      const middle = (low + high) / 2;
      const answer = ask([middle], now.lengths);
      if (!answer || answer.G_u[0] * G_u[k - 1] <= 0) high = middle;
      else low = middle;
    }
    zeros.push((low + high) / 2);
  }
  return { y, u, G_u, zeros, open: u.filter((x) => x === null).length / SAMPLES };
}

function drawCurves() {
  const titles = [`${robot.u[0]}: u, m`, "G_u, m/rad"];
  const columns = [seen.u, seen.G_u];
  if (charts.length > 0) {
    charts.forEach((chart, k) => chart.setData([seen.y, columns[k], curves.first[k]]));
    return;
  }
  const axis = (more) => ({ stroke: () => ink("--soft"), grid: { stroke: () => ink("--rule"), width: 1 },
    ticks: { stroke: () => ink("--rule"), width: 1 }, ...more });
  // the pose, and where the motor is lost
  const marked = (u) => {
    const { ctx } = u;
    const { top, height } = u.bbox;
    ctx.save();
    ctx.lineWidth = 1.5 * devicePixelRatio;
    for (const [x, colour] of [...seen.zeros.map((x) => [x, "--bad"]), [now.y[0], "--mark"]]) {
      const at = u.valToPos(x, "x", true);
      ctx.strokeStyle = ink(colour);
      ctx.beginPath();
      ctx.moveTo(at, top);
      ctx.lineTo(at, top + height);
      ctx.stroke();
    }
    ctx.restore();
  };
  charts = titles.map((title, k) => {
    const box = document.createElement("div");
    box.className = "chart";
    const head = document.createElement("h2");
    head.textContent = title;
    box.append(head);
    element("charts").append(box);
    return new uPlot({
      width: Math.max(240, box.clientWidth),
      height: 190,
      scales: { x: { time: false } },
      axes: [axis({}), axis({ size: 64 })],
      cursor: { y: false },
      series: [{ label: "y, rad" },
        { label: "now", stroke: () => ink("--mark"), width: 2, points: { show: false } },
        { label: "first lengths", stroke: () => ink("--soft"), width: 1, dash: [6, 5], points: { show: false } }],
      hooks: { draw: [marked] },
    }, [seen.y, columns[k], curves.first[k]], box);
  });
  new ResizeObserver(() => charts.forEach((chart) => {
    const width = Math.max(240, element("charts").clientWidth);
    if (Math.abs(chart.width - width) > 1) chart.setSize({ width, height: 190 });
  })).observe(element("charts"));
}

// of two freedoms: det G_u over both, row by row from the least second one
function map() {
  const at = (k) => robot.reach * ((2 * k) / (CELLS - 1) - 1);
  const values = [];
  for (let r = 0; r < CELLS; r++) {
    for (let c = 0; c < CELLS; c++) {
      const answer = ask([at(c), at(r)], now.lengths);
      values.push(answer && determinant(answer));
    }
  }
  const known = values.filter((x) => x !== null);
  return { values, most: Math.max(...known.map(Math.abs)), open: 1 - known.length / values.length };
}

function drawMap() {
  let canvas = element("map");
  if (!canvas) {
    const head = document.createElement("h2");
    head.textContent = `det G_u over ${robot.y[0]} (across) and ${robot.y[1]} (up)`;
    canvas = Object.assign(document.createElement("canvas"), { id: "map", width: 8 * CELLS, height: 8 * CELLS });
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", `${head.textContent}: white where it vanishes, grey where there is no pose`);
    element("charts").append(head, canvas);
  }
  const context = canvas.getContext("2d");
  seen.values.forEach((x, k) => {
    const [r, c] = [Math.floor(k / CELLS), k % CELLS];
    const part = x === null ? 0 : Math.sqrt(Math.min(1, Math.abs(x) / seen.most));
    context.fillStyle = x === null ? "#8a8f98" : `hsl(${x > 0 ? 215 : 20} 85% ${100 - 55 * part}%)`;
    context.fillRect(8 * c, 8 * (CELLS - 1 - r), 8, 8);
  });
  // cells beside a change of sign
  context.fillStyle = ink("--bad");
  seen.values.forEach((x, k) => {
    const [r, c] = [Math.floor(k / CELLS), k % CELLS];
    for (const [other, ends, w, h] of [[k + 1, c + 1 === CELLS, 2, 8], [k + CELLS, r + 1 === CELLS, 8, 2]]) {
      if (ends || x === null || (seen.values[other] ?? null) === null || x * seen.values[other] > 0) continue;
      context.fillRect(8 * (c + (w === 2 ? 1 : 0)) - (w === 2 ? 1 : 0), 8 * (CELLS - 1 - r) - (h === 2 ? 1 : 0), w, h);
    }
  });
  const place = (x) => 8 * (((x / robot.reach + 1) / 2) * (CELLS - 1) + 0.5);
  context.lineWidth = 3;
  context.strokeStyle = "#101418";
  context.beginPath();
  context.arc(place(now.y[0]), 8 * CELLS - place(now.y[1]), 7, 0, 7);
  context.stroke();
}

function table() {
  const { q, G } = now.answer;
  const row = (tag, cells) => {
    const line = document.createElement("tr");
    cells.forEach((words, k) => {
      const cell = document.createElement(k === 0 ? "th" : tag);
      cell.textContent = words;
      if (k > 0) cell.className = "number";
      line.append(cell);
    });
    return line;
  };
  element("gamma").replaceChildren(
    row("th", ["joint", "q", ...robot.y.map((name) => `∂q/∂${name}`)]),
    ...robot.q.map((name, k) =>
      row("td", [name, text(q[k]), ...robot.y.map((_, i) => text(G[k * freedoms + i]))])));
}

let shows = [];
let waiting = 0;

// shows the pose, and the curves where the lengths have changed
function update(isLonger) {
  const answer = ask(now.y, now.lengths);
  const spoken = element("status");
  if (answer) {
    now.answer = answer;
    view.worlds = worlds(answer);
    const size = determinant(answer);
    const is_near = Math.abs(size) < 1e-3 * update.usual;
    spoken.textContent = `${freedoms === 1 ? "G_u" : "det G_u"} ${size.toPrecision(4)}${is_near ? ": the motors hardly move the mechanism here" : ""}`;
    spoken.className = is_near ? "warn" : "";
    spoken.dataset.value = size;
    element("picture").className = "";
    table();
  } else {
    spoken.textContent = "Unreachable: no way leads to this pose with these lengths. The last pose stands.";
    spoken.className = element("picture").className = "bad";
  }
  shows.forEach((show) => show());
  view.draw();
  if (isLonger) {
    cancelAnimationFrame(waiting);
    waiting = requestAnimationFrame(survey);
  } else if (seen) {
    if (freedoms === 1) charts.forEach((chart) => chart.redraw());
    else drawMap();
  }
}

// the whole range of y with these lengths
function survey() {
  seen = freedoms === 1 ? curves() : map();
  if (freedoms === 1) drawCurves();
  else drawMap();
  const open = seen.open > 0 ? ` ${(100 * seen.open).toFixed(0)} % of the range has no pose.` : "";
  const zeros = seen.zeros?.map((x) => `y = ${x.toFixed(4)}`).join(", ");
  const singular = freedoms === 2
    ? "Red: det G_u changes its sign, the motors lose the mechanism there."
    : zeros ? `Singular: G_u = 0 at ${zeros}, where the motor is lost.` : "G_u vanishes nowhere.";
  element("singular").textContent = singular + open;
}

(() => {
  element("name").textContent = robot.name[0].toUpperCase() + robot.name.slice(1);
  const off = deviation.worst === 0 ? "0" : deviation.worst.toExponential(1);
  element("fine").textContent =
    `Lengths are inputs of generated code, ${pose.operations} operations. Largest deviation from plans of robots with `
    + `other lengths, sarrus ${robot.version}, in this browser: ${off} by the size of q and of G, on `
    + `${deviation.states - deviation.left} of ${deviation.states} states.`;
  const start = ask(first.y, first.lengths);
  update.usual = Math.abs(determinant(start));
  view.worlds = worlds(start);
  fitAll([view.worlds]);
  // the words stand above it
  view.distance *= 1.2;
  open(element("canvas"));
  const length = (of) => ({ ...of, unit: "m" });
  const angle = (name) => ({ name, lower: -robot.reach, upper: robot.reach, unit: "rad" });
  shows = [
    ...makeSliders("lengths", robot.lengths.map(length), () => now.lengths),
    ...makeSliders("sliders", robot.y.map(angle), () => now.y),
  ];
  element("reset").addEventListener("click", () => {
    now.lengths = [...first.lengths];
    now.y = [...first.y];
    update(true);
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => update(true));
  update(true);
})();
