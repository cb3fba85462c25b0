"""A robot of another format as a URDF, with its loops in `<loop>` elements."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from stat import S_ISREG
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from sarrus.errors import LoadError

Array = NDArray[np.float64]
Numbers = Sequence[float] | Array

# largest file [bytes]
MOST = 64 << 20

# characters that XML does not have
NO_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")

# largest |RᵀR − 1| that counts as rounding of a file, which may hold four digits
ROUNDING = 1e-3


@dataclass
class Link:
    """A link; its center of mass [m] and inertia about that [kg m²] in its own axes."""

    name: str
    mass: float = 0.0
    com: Numbers = (0.0, 0.0, 0.0)
    inertia: Array = field(default_factory=lambda: np.zeros((3, 3)))


@dataclass
class Joint:
    """A joint of a type of URDF, or `spherical`; `origin` is its frame (4 x 4) in the parent."""

    name: str
    kind: str
    parent: str
    child: str
    origin: Array = field(default_factory=lambda: np.eye(4))
    axis: Numbers = (0.0, 0.0, 1.0)
    limit: dict[str, float] = field(default_factory=dict)
    dynamics: dict[str, float] = field(default_factory=dict)
    mimic: tuple[str, float, float] | None = None
    is_driven: bool = False


@dataclass
class Loop:
    """A joint that closes a loop between frames (4 x 4) in two links."""

    name: str
    kind: str
    links: tuple[str, str]
    frames: tuple[Array, Array]
    axis: Numbers = (0.0, 0.0, 1.0)


@dataclass
class Robot:
    """Parts of a robot."""

    name: str
    links: list[Link] = field(default_factory=list)
    joints: list[Joint] = field(default_factory=list)
    loops: list[Loop] = field(default_factory=list)
    # no part of a file is left out silently: parts without influence on the dynamics, and with one
    notes: list[str] = field(default_factory=list)
    effects: list[str] = field(default_factory=list)

    def note_gravity(self, gravity: Array) -> None:
        """Note a gravity, in axes of the root, that is not the usual one."""
        if np.abs(gravity - [0.0, 0.0, -9.81]).max() > 1e-6:
            given = ",".join(number(round(of, 9)) for of in gravity)
            self.notes.append(f"`gravity` is no part of a robot; give it as --gravity={given}")

    def check(self, where: str) -> None:
        """Check names and numbers, from where they come."""
        groups: list[list[Any]] = [[*self.links], [*self.joints, *self.loops]]
        for parts in groups:
            known: set[str] = set()
            for part in parts:
                if part.name in known or not part.name or NO_XML.search(part.name):
                    raise LoadError(f"{where}: the name {part.name!r} is not one of its own", [])
                known.add(part.name)
        self.name = NO_XML.sub("_", self.name)
        for part in (*groups[0], *groups[1]):
            held: list[Any] = []
            for of in vars(part).values():
                held += of.values() if isinstance(of, dict) else [of]
                held += of if isinstance(of, tuple) else []
            kinds = (float, np.ndarray)
            if not all(np.isfinite(of).all() for of in held if isinstance(of, kinds)):
                raise LoadError(f"{where}: {part.name}: a number that is not finite", [])

    def text(self) -> bytes:
        """The URDF."""
        root = ElementTree.Element("robot", name=self.name, version="1.2")
        for link in self.links:
            element = ElementTree.SubElement(root, "link", name=link.name)
            if link.mass != 0.0 or np.any(link.inertia):
                inertial = ElementTree.SubElement(element, "inertial")
                ElementTree.SubElement(inertial, "origin", xyz=numbers(link.com))
                ElementTree.SubElement(inertial, "mass", value=number(link.mass))
                pairs = [("xx", 0, 0), ("xy", 0, 1), ("xz", 0, 2)]
                pairs += [("yy", 1, 1), ("yz", 1, 2), ("zz", 2, 2)]
                moments = {f"i{of}": number(link.inertia[i, k]) for of, i, k in pairs}
                ElementTree.SubElement(inertial, "inertia", moments)
        for joint in self.joints:
            element = ElementTree.SubElement(root, "joint", name=joint.name, type=joint.kind)
            ElementTree.SubElement(element, "parent", link=joint.parent)
            ElementTree.SubElement(element, "child", link=joint.child)
            origin(element, joint.origin)
            if joint.kind in ("revolute", "continuous", "prismatic"):
                ElementTree.SubElement(element, "axis", xyz=numbers(joint.axis))
            for name, values in (("limit", joint.limit), ("dynamics", joint.dynamics)):
                # a slide has the element also where it has no limits
                if values or (joint.kind, name) == ("prismatic", "limit"):
                    texts = {key: number(value) for key, value in values.items()}
                    ElementTree.SubElement(element, name, texts)
            if joint.mimic:
                leader, factor, offset = joint.mimic
                terms = {"multiplier": number(factor), "offset": number(offset)}
                ElementTree.SubElement(element, "mimic", {"joint": leader, **terms})
        for loop in self.loops:
            element = ElementTree.SubElement(root, "loop", name=loop.name, type=loop.kind)
            ends = zip(("predecessor", "successor"), loop.links, loop.frames, strict=True)
            for end, link_name, frame in ends:
                origin(ElementTree.SubElement(element, end, link=link_name), frame)
            ElementTree.SubElement(element, "axis", xyz=numbers(loop.axis))
        for joint in self.joints:
            if joint.is_driven:
                element = ElementTree.SubElement(root, "transmission", name=joint.name)
                ElementTree.SubElement(element, "joint", name=joint.name)
                ElementTree.SubElement(element, "actuator", name=joint.name)
        ElementTree.indent(root)
        return ElementTree.tostring(root, encoding="unicode").encode() + b"\n"


def check_file(path: Path) -> None:
    """Check that a path names a file, no pipe or device, and none of the largest."""
    status = path.stat()
    if not S_ISREG(status.st_mode):
        raise LoadError(f"{path}: no file", [])
    if status.st_size > MOST:
        raise LoadError(f"{path}: more than {MOST >> 20} MiB", [])


def number(value: float) -> str:
    """A number that is read again as it is."""
    return repr(float(value) + 0.0)


def numbers(values: Iterable[float] | Array) -> str:
    """Numbers with spaces between them."""
    return " ".join(number(value) for value in values)


def origin(element: ElementTree.Element, frame: Array) -> None:
    """Add a frame to an element."""
    of = {"xyz": numbers(frame[:3, 3]), "rpy": numbers(roll_pitch_yaw(frame[:3, :3]))}
    ElementTree.SubElement(element, "origin", of)


def roll_pitch_yaw(r: Array) -> tuple[float, float, float]:
    """Angles of r = Rz(yaw) Ry(pitch) Rx(roll), to rounding at each pose.

    Near a pitch of ±90° every yaw serves; roll and pitch are those of the remaining rotation.
    """
    yaw = np.arctan2(r[1, 0], r[0, 0])
    c, s = np.cos(yaw), np.sin(yaw)
    pitch = np.arctan2(-r[2, 0], c * r[0, 0] + s * r[1, 0])
    roll = np.arctan2(s * r[0, 2] - c * r[1, 2], c * r[1, 1] - s * r[0, 1])
    return float(roll), float(pitch), float(yaw)


def frame_of(r: Array, p: Numbers, where: str) -> Array:
    """A frame of an orientation, made orthogonal, and a position."""
    u, _, v = np.linalg.svd(r) if np.isfinite(r).all() else (r, 0, r)
    frame = np.eye(4)
    frame[:3, :3] = u @ v
    frame[:3, 3] = p
    is_exact = np.abs(r.T @ r - np.eye(3)).max() <= 1e-14
    if not np.abs(r - frame[:3, :3]).max() <= ROUNDING or np.linalg.det(frame[:3, :3]) < 0.0:
        raise LoadError(f"{where}: an orientation that is no rotation", [])
    if is_exact:
        frame[:3, :3] = r
    if not np.isfinite(frame).all():
        raise LoadError(f"{where}: a number that is not finite", [])
    return frame


def inverse(frame: Array) -> Array:
    """The inverse of a frame."""
    of = np.eye(4)
    of[:3, :3] = frame[:3, :3].T
    of[:3, 3] = -frame[:3, :3].T @ frame[:3, 3]
    return of
