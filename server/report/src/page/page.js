// Hover, zoom and pictures of the figures. The page is complete without it.
"use strict";

const tip = document.createElement("output");
tip.className = "tip";
tip.hidden = true;
document.body.append(tip);

// The place of a pointer in an SVG's own units.
function placed(svg, event) {
  return new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
}

// The marks of a picture in the order of `data-marks`: "SERIES X Y;…", SERIES as in the legend.
function marks(figure, svg) {
  const legend = [...figure.querySelectorAll(".legend li")];
  const forms = legend.map((item) => item.querySelectorAll("polygon").length);
  const polygons = [...svg.querySelectorAll("polygon")];
  let next = 0;
  return figure.dataset.marks.split(";").map((mark) => {
    const [series, x, y] = mark.split(" ").map(Number);
    const own = polygons.slice(next, next + forms[series]);
    next += own.length;
    const box = own[0].getBBox();
    const at = [box.x + box.width / 2, box.y + box.height / 2];
    return { name: legend[series].querySelector("span").textContent, x, y, at };
  });
}

function hover(figure, svg) {
  const [up, right] = figure.querySelectorAll(".axis");
  const label = (axis) => axis.textContent.replace(/[↑→]/g, "").trim();
  let all = null;
  svg.addEventListener("pointermove", (event) => {
    all ??= marks(figure, svg);
    const { x, y } = placed(svg, event);
    const off = (mark) => Math.hypot(mark.at[0] - x, mark.at[1] - y);
    const nearest = all.reduce((a, b) => (off(b) < off(a) ? b : a));
    tip.hidden = off(nearest) > 40;
    tip.textContent =
      `${nearest.name}\n${label(right)}: ${nearest.x}\n${label(up)}: ${nearest.y}`;
    const room = document.documentElement.clientWidth - tip.offsetWidth - 4;
    tip.style.left = `${Math.max(4, Math.min(event.clientX + 14, room))}px`;
    tip.style.top = `${event.clientY + 18}px`;
  });
  svg.addEventListener("pointerleave", () => (tip.hidden = true));
}

// A rectangle drawn with the mouse fills the picture; a double click shows all of it again.
function zoom(svg) {
  const whole = svg.getAttribute("viewBox");
  const frame = document.createElementNS(svg.namespaceURI, "rect");
  frame.setAttribute("class", "frame");
  let from = null;
  const box = (to) => ({
    x: Math.min(from.x, to.x),
    y: Math.min(from.y, to.y),
    width: Math.abs(to.x - from.x),
    height: Math.abs(to.y - from.y),
  });
  svg.addEventListener("pointerdown", (event) => {
    if (event.pointerType !== "mouse" || event.button !== 0) return;
    from = placed(svg, event);
    svg.setPointerCapture(event.pointerId);
    svg.append(frame);
    event.preventDefault();
  });
  svg.addEventListener("pointermove", (event) => {
    if (!from) return;
    for (const [name, value] of Object.entries(box(placed(svg, event)))) {
      frame.setAttribute(name, value);
    }
  });
  svg.addEventListener("pointerup", (event) => {
    if (!from) return;
    const { x, y, width, height } = box(placed(svg, event));
    from = null;
    frame.remove();
    if (width > 30 && height > 30) svg.setAttribute("viewBox", `${x} ${y} ${width} ${height}`);
  });
  svg.addEventListener("dblclick", () => svg.setAttribute("viewBox", whole));
}

// The picture as a text of its own, with the colours that it has now.
function text(svg) {
  const copy = svg.cloneNode(true);
  const [, , width, height] = svg.getAttribute("viewBox").split(" ");
  copy.setAttribute("width", width);
  copy.setAttribute("height", height);
  const own = svg.querySelectorAll("*");
  copy.querySelectorAll("*").forEach((to, k) => {
    const style = getComputedStyle(own[k]);
    for (const name of ["fill", "stroke"]) {
      if (to.hasAttribute(name)) to.setAttribute(name, style[name]);
    }
  });
  copy.style.fontFamily = "sans-serif";
  copy.style.background = getComputedStyle(document.body).backgroundColor;
  return new XMLSerializer().serializeToString(copy);
}

function save(blob, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  URL.revokeObjectURL(link.href);
}

function files(figure, svg) {
  const button = (kind, act) => {
    const made = document.createElement("button");
    made.textContent = kind;
    made.addEventListener("click", act);
    return made;
  };
  const asSvg = button("SVG", () =>
    save(new Blob([text(svg)], { type: "image/svg+xml" }), `${figure.id}.svg`));
  const asPng = button("PNG", async () => {
    const picture = new Image();
    picture.src = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(text(svg))}`;
    await picture.decode();
    const canvas = document.createElement("canvas");
    [canvas.width, canvas.height] = [picture.width, picture.height];
    const pen = canvas.getContext("2d");
    pen.fillStyle = getComputedStyle(document.body).backgroundColor;
    pen.fillRect(0, 0, canvas.width, canvas.height);
    pen.drawImage(picture, 0, 0);
    canvas.toBlob((blob) => save(blob, `${figure.id}.png`));
  });
  figure.querySelector(".from").append(" ", asSvg, " ", asPng);
}

for (const figure of document.querySelectorAll("figure[data-marks]")) {
  for (const svg of figure.querySelectorAll(".wide svg, .narrow svg")) {
    hover(figure, svg);
    zoom(svg);
  }
  files(figure, figure.querySelector(".wide svg"));
}
