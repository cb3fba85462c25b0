"""Output on stdout and stderr that survives a missing reader."""

from __future__ import annotations

import os
import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from typing import TextIO


class WrongFlags(Exception):
    """Flags that contradict the configuration or each other."""


def say(text: object, *, out: bool = False) -> None:
    """Print a line on stderr or stdout and flush it."""
    stream = sys.stdout if out else sys.stderr
    # Python has no stream for a descriptor that was closed at start-up
    if stream is not None:
        try:
            print(text, file=stream, flush=True)
        except OSError:
            hush(stream)


def hush(stream: TextIO) -> None:
    """Discard the buffered and all later output of a stream that has lost its reader."""
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, stream.fileno())
    os.close(null)
