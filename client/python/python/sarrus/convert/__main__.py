"""Print the URDF of a robot of Lua or USD."""

import argparse
import os
import resource
import sys
from pathlib import Path

from sarrus.convert import convert
from sarrus.errors import Error

# memory of a conversion [bytes], and its processor time [s]
MEMORY = 4 << 30
SECONDS = 60
# most notes, and letters of one, that are printed
NOTES = 1000
LETTERS = 20_000


def limit() -> None:
    """Bound memory and time of a hostile file, and leave no dump after a crash."""
    used = int(Path("/proc/self/statm").read_text().split()[5]) * resource.getpagesize()
    for kind, most in (
        (resource.RLIMIT_DATA, used + MEMORY),
        (resource.RLIMIT_CPU, SECONDS),
        (resource.RLIMIT_CORE, 0),
    ):
        hard = resource.getrlimit(kind)[1]
        most = most if hard == resource.RLIM_INFINITY else min(most, hard)
        resource.setrlimit(kind, (most, hard))
    os.environ.setdefault("PXR_WORK_THREAD_LIMIT", "1")


def shown(message: object) -> str:
    """A message on one line, which moves no cursor."""
    text = str(message)
    text = text if len(text) <= LETTERS else f"{text[:LETTERS]} …"
    text = "".join(of if of.isprintable() else "\N{REPLACEMENT CHARACTER}" for of in text)
    return text.encode(errors="replace").decode()


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
    limit()
    try:
        robot = convert(of.file, of.include_dir, lenient=of.lenient)
        text = robot.text()
    except (Error, OSError, ModuleNotFoundError) as error:
        print(f"error: {shown(error)}", file=sys.stderr)
        return 1 if isinstance(error, Error) else 2
    except MemoryError:
        print(f"error: {shown(of.file)}: it needs more memory than it may", file=sys.stderr)
        return 1
    for note in robot.notes[:NOTES]:
        print(shown(f"{of.file}: note: {note}"), file=sys.stderr)
    if len(robot.notes) > NOTES:
        print(f"{len(robot.notes) - NOTES} more notes", file=sys.stderr)
    sys.stdout.buffer.write(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
