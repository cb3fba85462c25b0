#!/usr/bin/env python3
"""Prints the sources of the header as one file for cbindgen, which expands no macro.

Each file is a module. The enums of `wire_enum!`, the flags and the bits of the wire, whose numbers
stand in `proto/src`, become plain enums. The statuses are those of answers, then those of calls.
"""

import re
from pathlib import Path

OWN = Path(__file__).resolve().parent / "src"
PROTO = OWN.parent.parent.parent / "proto/src"

WIRE = re.compile(
    r"^wire_enum! \{\n((?: +///[^\n]*\n)+) +(\w+): \w+ \{\n(.*?)^    \}\n\}\n", re.M | re.S
)
FLAGS = re.compile(
    r"^((?:///[^\n]*\n)+)pub mod flag \{\n    flags! \{\n(.*?)^    \}\n.*?^\}\n", re.M | re.S
)
BITS = re.compile(
    r"^((?:///[^\n]*\n)+)(?:#[^\n]*\n)+pub struct (\w+)s\(pub \w+\);\n\nimpl \2s \{\n(.*?)^\}\n",
    re.M | re.S,
)
# the documentation, the name and the number of a variant, flag or bit
DOC = r"((?: +///[^\n]*\n)+) +"
VARIANT = re.compile(DOC + r'(\w+) = (\d+), "')
BIT = re.compile(DOC + r"pub const (\w+): (\w+) = \3\((\d+)\);")
STATUS = re.compile(r"((?:///[^\n]*\n)+)(?:#[^\n]*\n)+pub struct StatusCode\(")


def read(path):
    return path.read_text(encoding="utf-8")


def enum(doc, name, variants, number="u32"):
    body = "".join(f"{doc}    {variant} = {value},\n" for doc, variant, value in variants)
    return f"{doc}#[repr({number})]\npub enum {name} {{\n{body}}}\n"


def camel(name):
    """`EffortLimited` of `EFFORT_LIMITED`."""
    return "".join(word.capitalize() for word in name.split("_"))


def wire_enum(found):
    doc, name, body = found.groups()
    return enum(doc, name, VARIANT.findall(body))


def flags(found):
    doc, body = found.groups()
    bits = VARIANT.findall(body)
    return enum(doc, "Flag", [(doc, camel(name), f"1 << {bit}") for doc, name, bit in bits])


def bits(found):
    """The bits of a set such as `TaskParts`, in the singular."""
    doc, name, body = found.groups()
    found = [(doc, camel(name), value) for doc, name, _, value in BIT.findall(body)]
    return enum(doc, name, [bit for bit in found if bit[2] != "0"])


def statuses():
    """The statuses of answers and those of calls, as one enum."""
    text = read(PROTO / "status.rs") + read(OWN / "status.rs")
    variants = {name: VARIANT.findall(body) for _, name, body in WIRE.findall(text)}
    (doc,) = STATUS.findall(text)
    return enum(doc, "StatusCode", variants["Status"] + variants["OwnStatus"], "i32")


def parts():
    yield statuses()
    for name in ("status", "request", "query"):
        text = read(PROTO / f"{name}.rs")
        yield from (wire_enum(found) for found in WIRE.finditer(text) if found[2] != "Status")
        yield from (bits(found) for found in BITS.finditer(text) if found[2] != "Warning")
    for name in ("names", "options", "robot", "model", "plan", "direct"):
        yield read(OWN / f"{name}.rs")
    yield FLAGS.sub(flags, WIRE.sub(wire_enum, read(PROTO / "actuators.rs")))
    yield read(OWN / "bridge.rs")


for number, part in enumerate(parts()):
    print(f"mod part{number} {{\n{part}}}")
