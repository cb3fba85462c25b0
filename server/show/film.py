#!/usr/bin/env python3
"""Makes the animation of the README: the wrists of the full robot, as its page draws them.

`server/show/film.py server/docs/wrists.gif`, with `sarrus` and Chromium in the PATH and Pillow.
"""

import base64
import io
import json
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

SECONDS, RATE, SIZE = 10, 10, (480, 300)
COLOURS = 48

# a wrist through its ranges, from one side
SCRIPT = """
const frames = [];
const place = (name) => robot.y.findIndex((of) => of.name === name);
const link = (name) => robot.links.findIndex((of) => of.name === name);
Object.assign(view.shown, { axes: false, boxes: false });
for (let k = 0; k < COUNT; k++) {
  const turn = (4 * Math.PI * k) / COUNT;
  const y = start();
  for (const side of ["AL", "AR"]) {
    y[place(`${side}HandPitch`)] = 0.45 * Math.sin(turn);
    y[place(`${side}HandRoll`)] = 0.35 * Math.sin(2 * turn);
  }
  set(y);
  if (k === 0) {
    const [a, b] = ["ALWristRoll_Link", "ALHandRoll_Link"].map((of) => view.worlds[link(of)]);
    view.target = a.slice(0, 3).map((x, i) => 0.45 * x + 0.55 * b[i]);
    view.distance = 2.2 * distance(a, b);
    view.yaw = YAW;
    view.pitch = 0.25;
  }
  view.draw();
  frames.push([now.status, view.canvas.toDataURL("image/png").split(",")[1]]);
}
const out = document.createElement("pre");
out.id = "frames";
out.textContent = JSON.stringify(frames);
document.body.append(out);
"""


def frames():
    """The pictures, one after the other."""
    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder) / "robot.html"
        subprocess.run(["sarrus", "show", "--robot", "rh5v2_full", "--out", page], check=True)
        style = "#panel,#status{display:none}main{grid-template-columns:1fr!important}"
        script = SCRIPT.replace("COUNT", str(SECONDS * RATE)).replace("YAW", "0.5")
        text = page.read_text(encoding="utf-8").replace("</head>", f"<style>{style}</style></head>")
        # rods as thin as a part of the robot needs them
        text = text.replace("0.008 * view.size", "0.003 * view.size")
        text = text.replace("0.014 * view.size", "0.005 * view.size")
        text = text.replace("</body>", f"<script>{{{script}}}</script></body>")
        page.write_text(text, encoding="utf-8")
        width, height = SIZE
        browser = ["chromium", "--headless=new", "--no-sandbox", "--use-gl=angle", "--dump-dom"]
        browser += ["--use-angle=swiftshader", "--virtual-time-budget=4000", "--hide-scrollbars"]
        browser += [f"--user-data-dir={folder}/profile", f"--window-size={width},{height}"]
        dom = subprocess.run([*browser, page.as_uri()], check=True, capture_output=True, text=True)
        listed = json.loads(dom.stdout.split('<pre id="frames">')[1].split("</pre>")[0])
    for status, picture in listed:
        assert status == "ok", status
        drawn = Image.open(io.BytesIO(base64.b64decode(picture))).convert("RGBA")
        yield Image.alpha_composite(Image.new("RGBA", drawn.size, "#f6f7f9"), drawn).convert("RGB")


def main():
    """Write the animation and print its path and size."""
    pictures = [picture.resize(SIZE, Image.Resampling.LANCZOS) for picture in frames()]
    # one palette for all, so that what stands still costs nothing
    strip = Image.new("RGB", (SIZE[0], SIZE[1] * 6))
    for k in range(6):
        strip.paste(pictures[k * len(pictures) // 6], (0, k * SIZE[1]))
    palette = strip.quantize(COLOURS, dither=Image.Dither.NONE)
    first, *others = [p.quantize(palette=palette, dither=Image.Dither.NONE) for p in pictures]
    path = Path(sys.argv[1])
    first.save(path, save_all=True, append_images=others, duration=1000 / RATE, loop=0)
    print(f"{path}: {len(pictures)} pictures, {path.stat().st_size} bytes")


if __name__ == "__main__":
    main()
