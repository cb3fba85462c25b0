"use strict";
// A motion: the robot at the time of the cursor, and its curves.

const element = (id) => document.getElementById(id);
const { run } = robot;
const load = { tip: 0, force: [0, 0, 0], moment: [0, 0, 0] };

function floats(text) {
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  return new Float32Array(bytes.buffer);
}

const rows = floats(run.q);
// sigma_min from which on the status speaks of it
const near = 0.01;

// the places of each joint's coordinates
const places = robot.links.map(({ joint }) =>
  robot.q.flatMap((of, k) => (joint && of.name.split("/")[0] === joint.name ? [k] : [])));

// pose of a link in its joint's frame
function moved({ kind, axis }, x) {
  const length = Math.hypot(...axis);
  const along = axis.map((a) => a / length);
  if (x.length === 0) return unit;
  if (kind === "prismatic") return [...along.map((a) => a * x[0]), 0, 0, 0, 1];
  if (kind === "spherical") return [0, 0, 0, ...x];
  if (kind === "floating") return x;
  return [0, 0, 0, ...along.map((a) => a * Math.sin(x[0] / 2)), Math.cos(x[0] / 2)];
}

// pose of every link in the root's frame from the tree coordinates
function worlds(q) {
  const found = [];
  const of = (k) => {
    const { joint } = robot.links[k];
    const own = joint && moved(joint, places[k].map((i) => q[i]));
    found[k] ??= joint ? times(of(joint.parent), times(joint.at, own)) : unit;
    return found[k];
  };
  robot.links.forEach((_, k) => of(k));
  return found;
}

// the largest distance of these poses from those of the kernels, in metres and parts of a turn
const deviation = Math.max(0, ...run.checks.flatMap(({ q, links, poses }) => {
  const own = worlds(q);
  return links.map((link, k) => {
    const pose = poses.slice(7 * k, 7 * k + 7);
    const sign = Math.sign(pose.slice(3).reduce((sum, x, i) => sum + x * own[link][3 + i], 0));
    return Math.max(...pose.map((x, i) => Math.abs(x - (i > 2 ? sign : 1) * own[link][i])));
  });
}));

const charts = [];
const colour = (k) => {
  const dark = matchMedia("(prefers-color-scheme: dark)").matches;
  return `hsl(${(210 + 137.5 * k) % 360} 65% ${dark ? 68 : 38}%)`;
};
const ink = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const digits = (x) => (x === null || x === undefined || Number.isNaN(x) ? "–" : Number(x).toPrecision(4));

// limits that the curves come near to, as dashed lines
function limits(u, curves) {
  const { ctx } = u;
  const { left, width, top, height } = u.bbox;
  ctx.save();
  ctx.setLineDash([6 * devicePixelRatio, 5 * devicePixelRatio]);
  ctx.lineWidth = devicePixelRatio;
  curves.forEach((curve, k) => {
    if (!u.series[k + 1].show) return;
    for (const limit of [curve.lower, curve.upper]) {
      if (limit === null) continue;
      const y = Math.round(u.valToPos(limit, "y", true));
      if (y < top || y > top + height) continue;
      ctx.strokeStyle = colour(k);
      ctx.beginPath();
      ctx.moveTo(left, y);
      ctx.lineTo(left + width, y);
      ctx.stroke();
    }
  });
  ctx.restore();
}

// the range of values, with limits of which more than half is used
function span(curves) {
  return (u, low, high) => {
    if (low === null || high === null) return [0, 1];
    curves.forEach((curve, k) => {
      if (!u.series[k + 1].show) return;
      const most = Math.max(...curve.numbers.map((x) => Math.abs(x ?? 0)));
      for (const limit of [curve.lower, curve.upper]) {
        if (limit === null || most < 0.5 * Math.abs(limit)) continue;
        [low, high] = [Math.min(low, limit), Math.max(high, limit)];
      }
    });
    const room = 0.05 * (high - low || Math.abs(high) || 1);
    return [low - room, high + room];
  };
}

function makeChart({ title, log, curves }) {
  const box = document.createElement("div");
  box.className = "chart";
  const head = document.createElement("h2");
  head.textContent = title;
  box.append(head);
  element("charts").append(box);
  for (const curve of curves) {
    curve.numbers = Array.from(floats(curve.values), (x) => (Number.isFinite(x) ? x : null));
    if (log) curve.numbers = curve.numbers.map((x) => (x > 0 ? x : null));
  }
  const axis = (more) => ({ stroke: () => ink("--soft"), grid: { stroke: () => ink("--rule"), width: 1 },
    ticks: { stroke: () => ink("--rule"), width: 1 }, ...more });
  const chart = new uPlot({
    width: Math.max(240, box.clientWidth),
    height: 200,
    scales: { x: { time: false }, y: log ? { distr: 3 } : { range: span(curves) } },
    axes: [axis({}), axis({ size: 64, space: 28, values: (_, list) => list.map((x) => (x === null ? "" : String(Number(x.toPrecision(4))))) })],
    cursor: { y: false, focus: { prox: 24 } },
    series: [{ label: "time, s", value: (_, x) => digits(x) },
      ...curves.map(({ name, lower, upper }, k) => ({
        label: lower === null && upper === null ? name : `${name} [${lower ?? "–"}, ${upper ?? "–"}]`,
        stroke: () => colour(k), width: 1.5, points: { show: false }, value: (_, x) => digits(x),
      }))],
    hooks: {
      draw: [(u) => limits(u, curves)],
      setCursor: [(u) => {
        if (!going && u.cursor.idx !== null && u.cursor.left >= 0) go(u.cursor.idx, u);
      }],
      setScale: [(u, key) => {
        if (key !== "x" || going) return;
        going = true;
        const { min, max } = u.scales.x;
        for (const other of charts) if (other !== u) other.setScale("x", { min, max });
        going = false;
      }],
    },
  }, [run.times, ...curves.map((curve) => curve.numbers)], box);
  charts.push(chart);
}

let going = false;
let place = 0;

// every limit that is exceeded at a sample, in words
function exceeded(k) {
  return run.charts.flatMap(({ curves }) => curves.flatMap(({ name, lower, upper, numbers }) => {
    const x = numbers[k];
    if (x === null) return [];
    if (lower !== null && x < lower) return [`${name} ${digits(x)} < ${lower}`];
    return upper !== null && x > upper ? [`${name} ${digits(x)} > ${upper}`] : [];
  }));
}

// takes the robot and all curves to a sample; `from` is the chart under the pointer
function go(k, from) {
  going = true;
  place = k;
  view.worlds = worlds(rows.subarray(k * robot.q.length, (k + 1) * robot.q.length));
  const time = run.times[k];
  element("time").value = k;
  element("clock").textContent = `${time.toFixed(3)} s`;
  element("time").setAttribute("aria-valuetext", element("clock").textContent);
  for (const chart of charts) {
    if (chart !== from) chart.setCursor({ left: chart.valToPos(time, "x"), top: 0 });
  }
  const notes = exceeded(k).map((words) => `Outside a limit: ${words}`);
  const sigma = run.sigma_min.length > 0 ? run.sigma_min[k] : null;
  if (sigma !== null && sigma < near) notes.unshift(`Near a singular pose: σ_min ${sigma.toExponential(1)}`);
  element("picture").className = notes.length > 0 ? "bad" : "";
  element("status").className = notes.length > 0 ? "warn" : "";
  element("status").textContent = notes.length > 0 ? notes.slice(0, 4).join(". ") : "ok";
  view.draw();
  going = false;
}

let playing = null;

function play() {
  const last = run.times.length - 1;
  const from = place >= last ? run.times[0] : run.times[place];
  const begin = performance.now();
  element("play").textContent = "Stop";
  element("play").setAttribute("aria-pressed", "true");
  const frame = (now) => {
    const time = from + (now - begin) / 1000;
    const next = run.times.findIndex((t) => t >= time);
    go(next < 0 ? last : next);
    if (next < 0) stop();
    else playing = requestAnimationFrame(frame);
  };
  playing = requestAnimationFrame(frame);
}

function stop() {
  if (playing !== null) cancelAnimationFrame(playing);
  playing = null;
  element("play").textContent = "Play";
  element("play").setAttribute("aria-pressed", "false");
}

(() => {
  element("name").textContent = robot.name;
  const item = (text) => Object.assign(document.createElement("li"), { textContent: text });
  element("texts").append(...run.texts.map(item));
  element("command").textContent = run.command;
  element("fine").textContent =
    `${run.times.length} of ${run.samples} samples; motion.csv has all, with every digit. Poses deviate by at most `
    + `${deviation.toExponential(1)} from sarrus ${robot.version}. Fingerprint ${robot.fingerprint}.`
    + robot.notes.map((note) => ` ${note}.`).join("");
  const all = [0, 0.25, 0.5, 0.75, 1].map((part) => {
    const k = Math.round(part * (run.times.length - 1));
    return worlds(rows.subarray(k * robot.q.length, (k + 1) * robot.q.length));
  });
  fitAll(all);
  open(element("canvas"));
  element("time").max = run.times.length - 1;
  run.charts.forEach(makeChart);
  chooseShown(element("shown"));
  element("time").addEventListener("input", (event) => {
    stop();
    go(Number(event.target.value));
  });
  element("play").addEventListener("click", () => (playing === null ? play() : stop()));
  new ResizeObserver(() => charts.forEach((chart) => {
    const width = Math.max(240, element("charts").clientWidth);
    if (Math.abs(chart.width - width) > 1) chart.setSize({ width, height: 200 });
  })).observe(element("charts"));
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () =>
    charts.forEach((chart) => chart.redraw()));
  go(0);
})();
