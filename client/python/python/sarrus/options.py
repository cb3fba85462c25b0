"""Options of reading a robot: gravity, its base, locked joints, links to keep."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from sarrus import _native

GRAVITY = (0.0, 0.0, -9.81)


def parts(
    gravity: Sequence[float],
    lenient: bool,
    floating_base: bool | str,
    lock: Mapping[str, float | None] | Sequence[str],
    only: Sequence[str],
) -> _native.Parts:
    """Convert the options for the core."""
    if isinstance(lock, Mapping):
        lock = [name if at is None else f"{name}={float(at)!r}" for name, at in lock.items()]
    if isinstance(lock, str) or isinstance(only, str):
        raise TypeError("`lock` and `only` are lists of names, found a text")
    lock, held = list(lock), set[str]()
    for text in lock:
        joint = text.rpartition("=")[0].strip() if "=" in text else text.strip()
        if joint in held:
            raise ValueError(f"`lock` has `{joint}` twice, expected each joint once")
        held.add(joint)
    x, y, z = (float(number) for number in gravity)
    base = floating_base if isinstance(floating_base, str) else ("" if floating_base else None)
    return ((x, y, z), lenient, base, lock, list(only))


def contents(text: str | bytes) -> bytes:
    """Convert the contents of a file to bytes."""
    return text.encode() if isinstance(text, str) else bytes(text)
