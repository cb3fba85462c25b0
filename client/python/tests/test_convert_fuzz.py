"""Damaged and hostile files of Lua and USD: each ends as a robot or as an error of the reader.

`SARRUS_FUZZ=100000 python -m unittest test_convert_fuzz` tries as many of each format, from seed
`SARRUS_FUZZ_SEED` on. Inputs are tried in a process that is started again where a reader in C ends
it by a signal or takes too long, which `convert.text` must report as an error. Only damaged binary
stages do so.
"""

import importlib.util
import json
import os
import random
import re
import resource
import signal
import subprocess
import sys
import tempfile
import traceback
import unittest
import warnings
from collections import Counter
from pathlib import Path
from xml.etree import ElementTree

import sarrus
from sarrus import _native, convert
from test_convert import RRPR, SIX
from test_convert_usd import HEAD, PAIR, STAGE

COUNT = int(os.environ.get("SARRUS_FUZZ", "250"))
SEED = int(os.environ.get("SARRUS_FUZZ_SEED", "1"))
# longest processor time of an input [s], and memory of all [bytes]
LONGEST = 20
MEMORY = 4 << 30

NUMBERS = ["0", "-1", "1", "2", "0.5", "1e308", "-1e-320", "1e400", "nan", "inf", "-inf", "1e18"]
LUA_WORDS = ["nil", "{}", "{{}}", "true", "'ROOT'", "''", "'\\0'", "'\\255'", "0/0", "1/0", "print"]
LUA_WORDS += ["math.huge", "-0.0", "function() end", "('x'):rep(1e5)", "_G", "'JointTypeSpherical'"]
LUA_WORDS += ["{'JointTypeFloatingBase'}", "{ [true] = 1 }", "while true do end", "error({})"]
LUA_WORDS += ["name = {},", "joint = {{1, 0, 0, 0, 0, 0.1}},", "axis_sets = {{}},", "goto x ::x::"]
LUA_WORDS += ["frames[1].parent = frames", "t = {} t.t = t return t", "return", "return model, 1"]
USD_WORDS = ["(", ")", "{", "}", "[", "]", "None", '"x"', "</four>", "</four/crank>", "</>", "@a@"]
USD_WORDS += ["(0, 0, 0)", "(nan, 0, 0)", "(0, 0, 0, 0)", "over", "class", "active = false", "@@"]
USD_WORDS += ["bool physics:rigidBodyEnabled = 0", "bool physics:kinematicEnabled = 1", "string"]
USD_WORDS += [
    "rel newton:mimicJoint = </four/a>",
    "float newton:armature = 1",
    "instanceable = true",
]
USD_WORDS += ["references = </four>", "inherits = </four/base>", "clips = {}", "double", "token"]
USD_WORDS += ["float physics:mass.timeSamples = {0: 1}", "rel physics:body0", ".connect = </a.b>"]
USD_WORDS += ["references = @f.usda@", "float physics:mass.spline = { held 1: 2, }", "'\x00'", "é"]


def damaged(text: bytes, words: list[str], of: random.Random) -> bytes:
    """A text with a few of its parts changed, moved, doubled or removed."""
    for _ in range(of.choice((1, 1, 1, 2, 3, 8))):
        parts = re.findall(rb"[\w.:]+|\s+|.", text, re.DOTALL) or [b""]
        at = of.randrange(len(parts))
        numbers = [k for k, part in enumerate(parts) if re.fullmatch(rb"-?[\d.]+", part)]
        match of.randrange(8):
            case 0 | 1 if numbers:
                parts[of.choice(numbers)] = of.choice(NUMBERS).encode()
            case 2:
                parts[at] = of.choice(words).encode()
            case 3:
                parts[at] = parts[of.randrange(len(parts))]
            case 4:
                del parts[at : at + of.choice((1, 1, 5, 50))]
            case 5:
                parts[at:at] = parts[at : at + of.choice((1, 5, 50))]
            case 6:
                parts.insert(at, of.choice(words).encode())
            case _:
                whole = bytearray(text)
                if whole:
                    whole[of.randrange(len(whole))] = of.randrange(256)
                parts = [bytes(whole[: of.randrange(len(whole) + 1)] if at % 9 == 0 else whole)]
        text = b"".join(parts)
    return text


def broken(whole: bytes, of: random.Random) -> bytes:
    """A binary file with a few of its bytes changed, or without its end."""
    data = bytearray(whole)
    for _ in range(of.choice((1, 1, 2, 4, 30))):
        at = of.randrange(len(data))
        match of.randrange(4):
            case 0:
                data[at] ^= 1 << of.randrange(8)
            case 1:
                data[at] = of.choice((0, 1, 127, 128, 255))
            case 2:
                size = of.choice((2, 4, 8))
                data[at : at + size] = of.choice((b"\xff", b"\0", b"\x7f")) * size
            case _:
                start = of.randrange(len(data))
                data[at : at + 8] = data[start : start + 8]
    return bytes(data[: of.randrange(len(data))] if of.random() < 0.05 else data)


def given(kind: str, seed: int, folder: Path) -> Path:
    """The file of a seed."""
    of = random.Random(seed)
    if kind == "lua":
        data = damaged(of.choice((RRPR, SIX)).encode(), LUA_WORDS, of)
    elif kind == "usda":
        text = of.choice((STAGE, HEAD + PAIR.replace("TERMS", "")))
        data = damaged(text.encode(), USD_WORDS, of)
    else:
        whole = folder / "whole.usdc"
        if not whole.exists():
            from pxr import Usd

            (folder / "whole.usda").write_text(STAGE)
            Usd.Stage.Open(str(folder / "whole.usda")).Export(str(whole))
        data = broken(whole.read_bytes(), of)
    file = folder / f"f.{kind}"
    file.write_bytes(data)
    return file


def outcome(file: Path, lenient: bool) -> str:
    """The end of an input: `robot`, `refused` later, `fault`, or the words of another exception."""
    try:
        text = convert.convert(file, lenient=lenient).text()
    except (sarrus.LoadError, MemoryError):
        return "fault"
    except Exception:
        return traceback.format_exc()
    ElementTree.fromstring(text)
    try:
        _native.imported(file, text, lenient)
    except sarrus.LoadError:
        return "refused"
    except BaseException:
        return traceback.format_exc()
    return "robot"


def work(kind: str, seeds: range, folder: Path) -> None:
    """Try inputs; a line of JSON before and after each."""
    hard = resource.getrlimit(resource.RLIMIT_DATA)[1]
    resource.setrlimit(resource.RLIMIT_DATA, (MEMORY, hard))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    warnings.simplefilter("error")
    for seed in seeds:
        file = given(kind, seed, folder)
        print(json.dumps([seed, "started"]), flush=True)
        signal.setitimer(signal.ITIMER_PROF, LONGEST)
        print(json.dumps([seed, outcome(file, seed % 2 == 0)]), flush=True)


class Fuzz(unittest.TestCase):
    def try_all(self, kind: str) -> None:
        counts: Counter[str] = Counter()
        with tempfile.TemporaryDirectory() as name:
            folder, first = Path(name), SEED
            while first < SEED + COUNT:
                arguments = [kind, str(first), str(SEED + COUNT), name]
                done = subprocess.run(
                    [sys.executable, "-W", "error", __file__, *arguments],
                    stdout=subprocess.PIPE,
                    stderr=subprocess.DEVNULL,
                    check=False,
                )
                lines = [json.loads(line) for line in done.stdout.splitlines()]
                self.assertTrue(lines, f"{kind}: ended with {done.returncode} at once")
                ends = {seed: end for seed, end in lines if end != "started"}
                for seed, end in ends.items():
                    message = f"{kind}, seed {seed}:\n{end}"
                    self.assertIn(end, ("robot", "refused", "fault"), message)
                counts.update(ends.values())
                first = lines[-1][0] + 1
                if lines[-1][1] == "started":
                    seed = lines[-1][0]
                    end = f"ended with {done.returncode}"
                    self.assertEqual(kind, "usdc", f"{kind}, seed {seed}: {end}")
                    # the first of a kind, since it takes the longest time that is allowed
                    if not counts[end]:
                        with self.assertRaises(sarrus.LoadError):
                            convert.text(given(kind, seed, folder), lenient=seed % 2 == 0)
                    counts[end] += 1
        print(f"{kind}: {COUNT} inputs from seed {SEED}: {dict(counts)}")
        self.assertEqual(counts.total(), COUNT)

    @unittest.skipUnless(importlib.util.find_spec("lupa"), "not run: pip install lupa")
    def test_damaged_lua_ends_as_a_robot_or_an_error(self):
        self.try_all("lua")

    @unittest.skipUnless(importlib.util.find_spec("pxr"), "not run: pip install usd-core")
    def test_damaged_text_of_usd_ends_as_a_robot_or_an_error(self):
        self.try_all("usda")

    @unittest.skipUnless(importlib.util.find_spec("pxr"), "not run: pip install usd-core")
    def test_damaged_binary_usd_ends_as_a_robot_or_an_error(self):
        self.try_all("usdc")


if __name__ == "__main__":
    if len(sys.argv) == 5:
        work(sys.argv[1], range(int(sys.argv[2]), int(sys.argv[3])), Path(sys.argv[4]))
    else:
        unittest.main()
