"""Runs the code cells of a notebook in one namespace, `cells.py FILE`, without Jupyter: all but
those that are tagged as pictures. Prints how many it ran.
"""

import json
import sys
from pathlib import Path


def main():
    notebook = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    names = {"__name__": "__main__"}
    count = 0
    for cell in notebook["cells"]:
        if cell["cell_type"] != "code" or "picture" in cell["metadata"].get("tags", ()):
            continue
        exec(compile("".join(cell["source"]), cell["id"], "exec"), names)
        count += 1
    print(f"{count} cells")


if __name__ == "__main__":
    main()
