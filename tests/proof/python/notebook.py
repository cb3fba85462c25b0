"""Executes a notebook, `notebook.py FILE [EXECUTED]`: the file has no outputs, no cell raises, and
the outputs have a table and pictures. EXECUTED gets the notebook with its outputs.
"""

import os
import sys
import tempfile
from pathlib import Path

import nbformat
from nbclient import NotebookClient


def main():
    # keeps the files of Jupyter and matplotlib out of the user's home
    folder = tempfile.TemporaryDirectory()
    for name in ("JUPYTER_RUNTIME_DIR", "JUPYTER_CONFIG_DIR", "IPYTHONDIR", "MPLCONFIGDIR"):
        os.environ[name] = folder.name
    path = Path(sys.argv[1])
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    for cell in code:
        assert not cell.outputs and cell.execution_count is None, f"{path}: outputs in `{cell.id}`"

    # an exception of a cell is raised here
    where = {"metadata": {"path": str(path.parent)}}
    client = NotebookClient(notebook, timeout=None, startup_timeout=600, resources=where)
    client.execute()
    shown = [kind for cell in code for output in cell.outputs for kind in output.get("data", ())]
    assert "text/html" in shown and "image/png" in shown, shown
    # warnings and faults go there
    for cell in code:
        for output in cell.outputs:
            assert output.get("name") != "stderr", f"`{cell.id}`: {output.text}"
    for place in sys.argv[2:]:
        nbformat.write(notebook, place)
    folder.cleanup()


if __name__ == "__main__":
    main()
