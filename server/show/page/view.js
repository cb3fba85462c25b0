"use strict";
// The drawing: points of links, from which a view with WebGL or one of lines is made.

// lines between points of links: [link, point, link, point, kind]
const rods = [];
const marks = [];
const boxes = [];
const axes = [];
// what the URDF draws: [link, pose, shape, pose of its box, half sides of it]
const shapes = robot.visuals.map((of) => {
  const middle = placed(of.at, of.middle);
  return [of.link, of.at, of, [...middle, ...of.at.slice(3)], of.half];
});

(() => {
  // all joints at zero: cut frames are given there
  const zero = [];
  const at = (k) => {
    const joint = robot.links[k].joint;
    zero[k] ??= joint ? times(at(joint.parent), joint.at) : unit;
    return zero[k];
  };
  const origin = [0, 0, 0];
  robot.links.forEach((link, k) => {
    const { joint } = link;
    if (joint) {
      const from = joint.at.slice(0, 3);
      rods.push([joint.parent, origin, joint.parent, from, "rod"]);
      if (joint.kind === "prismatic") rods.push([joint.parent, from, k, origin, "slide"]);
      if (joint.kind === "revolute" || joint.kind === "prismatic") {
        const length = Math.hypot(...joint.axis);
        axes.push([k, joint.axis.map((x) => x / length), joint.name]);
      }
    }
    // the root does not move: its box would only hide the others
    if (link.box && joint) boxes.push([k, link.box.at, link.box.half]);
  });
  for (const loop of robot.loops) {
    const ends = [loop.predecessor, loop.successor];
    const points = ends.map((end, k) => {
      const cut = loop.at.placed ? loop.at.placed[k] : times(inverse(at(end)), at(loop.at.link));
      return cut.slice(0, 3);
    });
    ends.forEach((end, k) => {
      rods.push([end, origin, end, points[k], "rod"]);
      marks.push([end, points[k], loop.name]);
    });
  }
  rods.push(...(robot.rods ?? []));
  marks.push(...(robot.marks ?? []));
})();

const view = {
  yaw: -0.9, pitch: 0.35, distance: 3, target: [0, 0, 0], size: 1, worlds: null,
  // the link of the ball that is dragged, none below zero
  hand: -1,
  shown: { axes: true, cuts: true, boxes: robot.visuals.length === 0, shapes: true },
};

// the force and the moment on a tip: their two ends, none where they are zero
function arrow(of, usual) {
  const link = robot.links.findIndex((other) => other.name === robot.tips[load.tip]);
  const size = Math.hypot(...of);
  if (!view.worlds || link < 0 || size === 0) return null;
  const from = view.worlds[link].slice(0, 3);
  return [from, from.map((x, k) => x + (0.35 * view.size * of[k]) / (size + usual))];
}

const arrows = () => [arrow(load.force, 50), arrow(load.moment, 5)];

// little-endian numbers in base64
function decoded(text, wide) {
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  return wide ? new Uint32Array(bytes.buffer) : new Uint16Array(bytes.buffer);
}

// corners of the triangles of each mesh, one after the other
const meshes = robot.meshes.map((mesh) => {
  if (!mesh) return null;
  const points = decoded(mesh.points, false);
  const list = new Float32Array(3 * decoded(mesh.triangles, mesh.wide).length);
  decoded(mesh.triangles, mesh.wide).forEach((p, k) => {
    for (let i = 0; i < 3; i++) list[3 * k + i] = mesh.low[i] + mesh.step[i] * points[3 * p + i];
  });
  return list;
});

// the eye, and the directions right and up of the picture
function eye() {
  const { yaw, pitch, distance, target } = view;
  const back = [Math.cos(pitch) * Math.cos(yaw), Math.cos(pitch) * Math.sin(yaw), Math.sin(pitch)];
  const right = [-Math.sin(yaw), Math.cos(yaw), 0];
  const up = [
    -Math.sin(pitch) * Math.cos(yaw), -Math.sin(pitch) * Math.sin(yaw), Math.cos(pitch),
  ];
  return { at: target.map((x, k) => x + distance * back[k]), back, right, up };
}

// that of view across the smaller side of the picture
const angle = (35 * Math.PI) / 180;

// where a point of the root's frame stands in the picture, in its pixels
function pixel(p, width, height) {
  const { at, back, right, up } = eye();
  const d = p.map((x, k) => x - at[k]);
  const along = (axis) => axis[0] * d[0] + axis[1] * d[1] + axis[2] * d[2];
  const scale = Math.min(width, height) / 2 / Math.tan(angle / 2) / Math.max(1e-9, -along(back));
  return [width / 2 + along(right) * scale, height / 2 - along(up) * scale];
}

// the view that holds the robot in these poses
function fitAll(all) {
  const boxed = [...boxes, ...shapes.map(([k, , , at, half]) => [k, at, half])];
  const points = all.flatMap((worlds) => [
    ...rods.flatMap(([a, p, b, q]) => [placed(worlds[a], p), placed(worlds[b], q)]),
    ...boxed.flatMap(([k, at, half]) =>
      corners.map((c) => placed(times(worlds[k], at), c.map((x, i) => x * half[i]))))]);
  if (points.length === 0) points.push([0, 0, 0]);
  const bound = (of) => [0, 1, 2].map((k) => of(...points.map((p) => p[k])));
  const low = bound(Math.min);
  const high = bound(Math.max);
  view.target = low.map((x, k) => (x + high[k]) / 2);
  view.size = Math.max(0.05, distance(low, high));
  view.distance = (0.62 * view.size) / Math.tan(angle / 2);
}

const corners = [0, 1, 2, 3, 4, 5, 6, 7].map((k) => [k & 1 ? 1 : -1, k & 2 ? 1 : -1, k & 4 ? 1 : -1]);
const edges = [];
for (let a = 0; a < 8; a++) {
  for (const bit of [1, 2, 4]) if (!(a & bit)) edges.push([a, a | bit]);
}

function colours() {
  const style = getComputedStyle(document.documentElement);
  const of = (name) => style.getPropertyValue(name).trim();
  return {
    rod: of("--rod"), slide: of("--slide"), axis: of("--axis"), cut: of("--cut"), box: of("--box"),
    grid: of("--grid"), force: of("--force"), shape: of("--shape"), moment: of("--moment"),
    hand: of("--mark"),
  };
}

// lines on a canvas
function lines(canvas) {
  const context = canvas.getContext("2d");
  return () => {
    const scale = window.devicePixelRatio || 1;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    canvas.width = width * scale;
    canvas.height = height * scale;
    context.setTransform(scale, 0, 0, scale, 0, 0);
    const colour = colours();
    const draw = (p, q, style, thick) => {
      context.strokeStyle = style;
      context.lineWidth = thick;
      context.beginPath();
      context.moveTo(...pixel(p, width, height));
      context.lineTo(...pixel(q, width, height));
      context.stroke();
    };
    const { worlds, shown, size } = view;
    if (!worlds) return;
    context.lineCap = "round";
    const box = (k, at, half, style) => {
      const frame = times(worlds[k], at);
      const points = corners.map((c) => placed(frame, c.map((x, i) => x * half[i])));
      for (const [a, b] of edges) draw(points[a], points[b], style, 1);
    };
    if (shown.boxes) for (const [k, at, half] of boxes) box(k, at, half, colour.box);
    if (shown.shapes) for (const [k, , , at, half] of shapes) box(k, at, half, colour.shape);
    for (const [a, p, b, q, kind] of rods) {
      draw(placed(worlds[a], p), placed(worlds[b], q), colour[kind], 4);
    }
    if (shown.axes) {
      for (const [k, axis] of axes) {
        const end = (s) => placed(worlds[k], axis.map((x) => s * 0.06 * size * x));
        draw(end(-1), end(1), colour.axis, 1.5);
      }
    }
    arrows().forEach((ends, k) => {
      if (ends) draw(...ends, k === 0 ? colour.force : colour.moment, 5);
    });
    const point = (p, style, radius) => {
      context.fillStyle = style;
      context.beginPath();
      context.arc(...pixel(p, width, height), radius, 0, 7);
      context.fill();
    };
    if (shown.cuts) for (const [k, p] of marks) point(placed(worlds[k], p), colour.cut, 5);
    if (view.hand >= 0) point(worlds[view.hand].slice(0, 3), colour.hand, 8);
  };
}

// of half sides 1, but for meshes
function geometryOf(shape) {
  if (shape.kind === "box") return new THREE.BoxGeometry(2, 2, 2);
  if (shape.kind === "sphere") return new THREE.SphereGeometry(1, 32, 20);
  if (shape.kind === "cylinder") {
    return new THREE.CylinderGeometry(1, 1, 2, 32).rotateX(Math.PI / 2);
  }
  const geometry = new THREE.BufferGeometry();
  const of = meshes[shape.mesh] ?? new Float32Array();
  geometry.setAttribute("position", new THREE.Float32BufferAttribute(of, 3));
  geometry.computeVertexNormals();
  return geometry;
}

// solids by WebGL
function solids(canvas) {
  const renderer = new THREE.WebGLRenderer({ canvas, antialias: true, alpha: true, preserveDrawingBuffer: true });
  const scene = new THREE.Scene();
  const camera = new THREE.PerspectiveCamera((angle * 180) / Math.PI, 1, 0.01, 100);
  camera.up.set(0, 0, 1);
  const sun = new THREE.DirectionalLight(0xffffff, 2);
  scene.add(new THREE.HemisphereLight(0xffffff, 0x888888, 1.6), sun);
  const material = (colour, opacity = 1) =>
    new THREE.MeshLambertMaterial({ color: colour, transparent: opacity < 1, opacity });
  const colour = colours();
  const radius = 0.008 * view.size;
  const cylinder = new THREE.CylinderGeometry(1, 1, 1, 16);
  const solid = (geometry, of) => {
    const mesh = new THREE.Mesh(geometry, of);
    scene.add(mesh);
    return mesh;
  };
  const of = { rod: material(colour.rod), slide: material(colour.slide), grid: material(colour.grid) };
  const axisOf = material(colour.axis);
  const forceOf = material(colour.force);
  const momentOf = material(colour.moment);
  const pulls = [forceOf, momentOf].map((of) => solid(cylinder, of));
  const shapeOf = material(colour.shape);
  const drawn = shapes.map(([, , shape]) => {
    const [r, g, b, opacity] = shape.colour ?? [];
    const own = shape.colour ? material(0xffffff, opacity) : shapeOf;
    if (shape.colour) own.color.setRGB(r, g, b, "srgb");
    own.side = 2; // files wind some triangles the other way
    const mesh = solid(geometryOf(shape), own);
    if (shape.kind === "mesh") mesh.scale.set(...shape.scale);
    else mesh.scale.set(...shape.half.map((x) => Math.max(x, 1e-6)));
    return mesh;
  });
  const bars = rods.map(([, , , , kind]) => solid(cylinder, of[kind]));
  const joints = axes.map(() => solid(cylinder, axisOf));
  const ball = new THREE.SphereGeometry(0.014 * view.size, 20, 12);
  const cutOf = material(colour.cut);
  const cuts = marks.map(() => solid(ball, cutOf));
  const handOf = material(colour.hand);
  const held = solid(ball, handOf);
  held.scale.setScalar(1.6);
  const boxOf = material(colour.box, 0.3);
  const lineOf = new THREE.LineBasicMaterial({ color: colour.box });
  const cube = new THREE.BoxGeometry(2, 2, 2);
  const rim = new THREE.EdgesGeometry(cube);
  const masses = boxes.map(([, , half]) => {
    const group = new THREE.Group();
    group.add(new THREE.Mesh(cube, boxOf), new THREE.LineSegments(rim, lineOf));
    group.scale.set(...half.map((x) => Math.max(x, 1e-6)));
    scene.add(group);
    return group;
  });
  const grid = new THREE.GridHelper(2 * view.size, 10, colour.grid, colour.grid);
  grid.rotation.x = Math.PI / 2;
  scene.add(grid);
  const vertical = new THREE.Vector3(0, 1, 0);
  const along = new THREE.Vector3();
  const lay = (mesh, p, q, thick) => {
    along.set(q[0] - p[0], q[1] - p[1], q[2] - p[2]);
    const length = along.length();
    mesh.visible = length > 1e-6 * view.size;
    mesh.scale.set(thick, Math.max(length, 1e-9), thick);
    mesh.position.set((p[0] + q[0]) / 2, (p[1] + q[1]) / 2, (p[2] + q[2]) / 2);
    if (mesh.visible) mesh.quaternion.setFromUnitVectors(vertical, along.divideScalar(length));
  };
  const recoloured = () => {
    const now = colours();
    for (const [name, list] of [["rod", [of.rod]], ["slide", [of.slide]], ["axis", [axisOf]],
      ["cut", [cutOf]], ["box", [boxOf, lineOf]], ["force", [forceOf]],
      ["moment", [momentOf]], ["hand", [handOf]], ["shape", [shapeOf]], ["grid", [of.grid].concat(grid.material)]]) {
      list.forEach((each) => each.color.set(now[name]));
    }
    grid.geometry.deleteAttribute("color");
    grid.material.vertexColors = false;
  };
  recoloured();
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
    recoloured();
    view.draw();
  });
  return () => {
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    renderer.setPixelRatio(Math.min(2, window.devicePixelRatio || 1));
    renderer.setSize(width, height, false);
    const { at } = eye();
    camera.aspect = width / Math.max(1, height);
    const narrow = Math.max(1, height / Math.max(1, width));
    camera.fov = (360 / Math.PI) * Math.atan(Math.tan(angle / 2) * narrow);
    camera.near = view.distance / 100;
    camera.far = view.distance + 10 * view.size;
    camera.updateProjectionMatrix();
    camera.position.set(...at);
    camera.lookAt(...view.target);
    sun.position.set(at[0], at[1], at[2] + view.size);
    const { worlds, shown } = view;
    if (worlds) {
      rods.forEach(([a, p, b, q], k) => {
        lay(bars[k], placed(worlds[a], p), placed(worlds[b], q), radius);
      });
      arrows().forEach((ends, k) => {
        if (ends) lay(pulls[k], ...ends, 1.3 * radius);
        pulls[k].visible = ends !== null;
      });
      held.visible = view.hand >= 0;
      if (held.visible) held.position.set(...worlds[view.hand].slice(0, 3));
      shapes.forEach(([k, at], i) => {
        const world = times(worlds[k], at);
        drawn[i].position.set(...world.slice(0, 3));
        drawn[i].quaternion.set(...world.slice(3));
        drawn[i].visible = shown.shapes;
      });
      axes.forEach(([k, axis], i) => {
        const end = (s) => placed(worlds[k], axis.map((x) => s * 0.06 * view.size * x));
        lay(joints[i], end(-1), end(1), 0.35 * radius);
        joints[i].visible = shown.axes;
      });
      marks.forEach(([k, p], i) => {
        cuts[i].position.set(...placed(worlds[k], p));
        cuts[i].visible = shown.cuts;
      });
      boxes.forEach(([k, pose], i) => {
        const world = times(worlds[k], pose);
        masses[i].position.set(...world.slice(0, 3));
        masses[i].quaternion.set(...world.slice(3));
        masses[i].visible = shown.boxes;
      });
    }
    renderer.render(scene, camera);
  };
}

// turns, moves and magnifies by pointers, wheel and keys
function steer(canvas) {
  const pointers = new Map();
  // the pointer that drags the hand
  let holding = null;
  const turn = (x, y) => {
    view.yaw -= 0.008 * x;
    view.pitch = Math.max(-1.5, Math.min(1.5, view.pitch + 0.008 * y));
  };
  const move = (x, y) => {
    const { right, up } = eye();
    const least = Math.max(1, Math.min(canvas.clientWidth, canvas.clientHeight));
    const scale = (2 * view.distance * Math.tan(angle / 2)) / least;
    view.target = view.target.map((t, k) => t - scale * (x * right[k] - y * up[k]));
  };
  const zoom = (factor) => {
    view.distance = Math.max(0.05 * view.size, Math.min(20 * view.size, view.distance * factor));
  };
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, [event.clientX, event.clientY]);
    const near = event.pointerType === "touch" ? 28 : 14;
    if (view.grab?.([event.offsetX, event.offsetY], near)) holding = event.pointerId;
  });
  canvas.addEventListener("pointermove", (event) => {
    const old = pointers.get(event.pointerId);
    if (!old) return;
    const now = [event.clientX, event.clientY];
    const [x, y] = [now[0] - old[0], now[1] - old[1]];
    if (event.pointerId === holding) {
      view.drag(x, y);
    } else if (pointers.size === 2) {
      const other = [...pointers].find(([id]) => id !== event.pointerId)[1];
      const length = (p) => Math.hypot(p[0] - other[0], p[1] - other[1]);
      zoom(length(old) / Math.max(1, length(now)));
      move(x / 2, y / 2);
    } else if (event.shiftKey) {
      move(x, y);
    } else {
      turn(x, y);
    }
    pointers.set(event.pointerId, now);
    view.draw();
  });
  const away = (event) => {
    pointers.delete(event.pointerId);
    if (event.pointerId === holding) holding = null;
  };
  canvas.addEventListener("pointerup", away);
  canvas.addEventListener("pointercancel", away);
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    zoom(Math.exp(0.001 * event.deltaY));
    view.draw();
  }, { passive: false });
  canvas.addEventListener("keydown", (event) => {
    const arrows = { ArrowLeft: [-20, 0], ArrowRight: [20, 0], ArrowUp: [0, -20], ArrowDown: [0, 20] };
    const by = arrows[event.key];
    if (by) {
      if (event.shiftKey) move(...by);
      else turn(...by);
    } else if (event.key === "+" || event.key === "=") {
      zoom(0.9);
    } else if (event.key === "-") {
      zoom(1 / 0.9);
    } else {
      return;
    }
    event.preventDefault();
    view.draw();
  });
}

// the boxes that choose the drawn parts
function chooseShown(shown) {
  shown.querySelector("[value=boxes]").checked = view.shown.boxes;
  shown.querySelector("[value=shapes]").parentElement.hidden = robot.visuals.length === 0;
  shown.addEventListener("change", (event) => {
    view.shown[event.target.value] = event.target.checked;
    view.draw();
  });
}

function open(canvas) {
  let draw = null;
  if (location.hash !== "#lines") {
    try {
      draw = solids(canvas);
    } catch {
      // no WebGL: another canvas, as this one may have lost its context
      const fresh = canvas.cloneNode(false);
      canvas.replaceWith(fresh);
      canvas = fresh;
    }
  }
  view.kind = draw ? "solids" : "lines";
  view.draw = draw ?? lines(canvas);
  view.canvas = canvas;
  steer(canvas);
  new ResizeObserver(() => view.draw()).observe(canvas);
}
