"""Print the URDF of a robot of Lua or USD."""

import argparse
import sys
from pathlib import Path

from sarrus.convert import convert
from sarrus.errors import Error


def main() -> int:
    """Convert; the exit code is 1 for a faulty file and 2 for one that cannot be read."""
    parser = argparse.ArgumentParser("python -m sarrus.convert", description=__doc__)
    parser.add_argument("file", type=Path, metavar="FILE", help="a file of Lua (RBDL) or of USD")
    parser.add_argument(
        "--include-dir",
        type=Path,
        action="append",
        default=[],
        metavar="DIR",
        help="a folder whose files FILE may name; those of its own folder it always may",
    )
    parser.add_argument(
        "--lenient", action="store_true", help="leave effects out that are not modelled"
    )
    of = parser.parse_args()
    try:
        robot = convert(of.file, of.include_dir, lenient=of.lenient)
    except (Error, OSError, ModuleNotFoundError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1 if isinstance(error, Error) else 2
    for note in robot.notes:
        print(f"{of.file}: note: {note}", file=sys.stderr)
    sys.stdout.buffer.write(robot.text())
    return 0


if __name__ == "__main__":
    sys.exit(main())
