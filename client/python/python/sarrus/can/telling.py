"""Words for those who started a program. Nobody may be there to read them: that ends nothing."""

from __future__ import annotations

import os
import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from typing import TextIO


class WrongFlags(Exception):
    """What was asked for cannot be meant."""


def say(text: object, *, out: bool = False) -> None:
    """Say something at once, on stderr or on stdout."""
    stream = sys.stdout if out else sys.stderr
    # a stream that was closed at the start is none
    if stream is not None:
        try:
            print(text, file=stream, flush=True)
        except OSError:
            hush(stream)


def hush(stream: TextIO) -> None:
    """Nobody reads a stream any more: what it still holds, and what follows, goes nowhere."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, stream.fileno())
    os.close(nowhere)
