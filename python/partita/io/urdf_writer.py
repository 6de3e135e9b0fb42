"""A mechanism as URDF; a YAML file beside it lists its loop closures, in the form that `sidecar` reads.

Springs, dampers other than those of hinges and slides, links without gravity and the drawing tolerance are written to
that file too: URDF cannot represent them, and other programs ignore them.

A joint of more than one degree of freedom is a chain of translations and rotations through massless links, which the
reader combines into one joint again. So is a joint that closes a loop: it carries a massless link that is welded to a
frame of its child.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..builder import Builder
from ..builder.checks import Array
from ..builder.records import DRAWING_TOLERANCE, GROUND, LoadRecord, RotorRecord
from ..files import put
from ..limits import limit
from ..products import matmul
from . import writing_table
from .closings import is_closing
from .robot import inverse, massless_of
from .skeleton import (
    Branch,
    Closure,
    Motion,
    Names,
    quoted,
    skeleton,
    text,
    ties,
    words,
)
from .writing import Writing

GRAVITY = (0.0, 0.0, -9.81)
"""Default of readers of URDF, which defines none."""
DRAKE = "http://drake.mit.edu"
"""Namespace of Drake's elements."""
UNLIMITED = 1e9
"""Limits [m] of a slide without limits: URDF requires them."""
_GIMBAL = (
    ("turn", np.array([1.0, 0.0, 0.0])),
    ("turn", np.array([0.0, 1.0, 0.0])),
    ("turn", np.array([0.0, 0.0, 1.0])),
)


def write(mechanism: Builder, path: Path, strict: bool) -> Writing:
    """Write the file and, where it is needed, the sidecar; the report lists the differences."""
    writer = _Writer(mechanism, Writing(path, "URDF"))
    robot, beside = writer.text(), writer.sidecar()
    report = writer.report
    report.judge(strict)
    if beside is not None:
        report.files.append(put(path.with_suffix(".yaml"), beside.encode("utf-8")))
    report.files.insert(0, put(path, robot.encode("utf-8")))
    return report


@dataclass
class _Writer:
    mechanism: Builder
    report: Writing
    links: list[str] = field(default_factory=list)
    joints: list[str] = field(default_factory=list)
    pairs: list[tuple[str, str]] = field(default_factory=list)
    kinds: list[str] = field(default_factory=list)
    loops: list[str] = field(default_factory=list)
    beside: list[str] = field(default_factory=list)
    springs: dict[tuple[str, int], list[LoadRecord]] = field(default_factory=dict)
    rotors: dict[tuple[str, int], list[RotorRecord]] = field(default_factory=dict)
    transmissions: list[str] = field(default_factory=list)

    def text(self) -> str:
        """The URDF."""
        d, report = self.mechanism._description, self.report
        tree = skeleton(self.mechanism, report)
        self.names: Names = tree.names
        self.world = "world" if "world" not in d.bodies else self.names.new("world of the robot")
        for force in d.loads("torsion_spring"):
            self.springs.setdefault((force["joint"], force["coordinate"]), []).append(force)
        for rotor in d.rotors.values():
            self.rotors.setdefault((rotor.joint, rotor.coordinate), []).append(rotor)
        self.mimics: dict[str, tuple[str, float, float]] = {}
        self.ties(ties(d, tree, report))
        self.frames = {GROUND: np.eye(4)}  # of links in their bodies
        self.links.append(f"  <link name={quoted(self.world)}/>")
        shifted = []
        for branch in tree.branches:
            own = np.eye(4)
            if branch.motions or branch.floats:
                own[:3, 3] = branch.point
            if np.any(own[:3, 3]):
                shifted.append(branch.body)
            self.frames[branch.body] = own
            self.body(branch.body)
            self.branch(branch)
        if shifted:
            remark = f"so it has changed in {', '.join(shifted)}"
            report.changed.append(f"a link's frame coincides with that of its joint, {remark}")
        for closure in tree.closures:
            self.closure(closure)
        for joint, coordinate in self.springs:
            report.dropped.append(
                f"spring of coordinate {coordinate} of joint {joint}, which is neither a hinge nor a slide"
            )
        for joint, coordinate in self.rotors:
            report.dropped.append(f"rotor on coordinate {coordinate} of joint {joint}, neither a hinge nor a slide")
        for force in d.loads("spring"):
            self.spring(force)
        writing_table.visit(d, report)
        self.weightless = [name for name, body in d.bodies.items() if not body.gravity]
        if self.weightless:
            remark = f"that gravity does not act on {', '.join(self.weightless)} is written to the sidecar file"
            report.changed.append(f"{remark}; other programs apply it to all bodies")
        if d.drawing_tolerance != DRAWING_TOLERANCE:
            report.changed.append(f"the drawing tolerance {d.drawing_tolerance:g} is written to the sidecar file")
        dialect = f' xmlns:drake="{DRAKE}"' if self.transmissions else ""
        head = ['<?xml version="1.0" encoding="utf-8"?>', f"<robot name={quoted(d.name)}{dialect}>"]
        return "\n".join([*head, *self.links, *self.joints, *self.transmissions, "</robot>", ""])

    def turned(self, joint: str, rotors: Iterable[RotorRecord]) -> None:
        """Rotors as Drake reads them: of motors that turn with a joint of the file."""
        for rotor in rotors:
            inertia = f'<drake:rotor_inertia value="{text(rotor.inertia)}"/>'
            motor = f'{inertia}<drake:gear_ratio value="{text(rotor.ratio)}"/>'
            self.transmissions += [
                f"  <transmission name={quoted(rotor.name)}>",
                "    <type>transmission_interface/SimpleTransmission</type>",
                f"    <joint name={quoted(joint)}/>",
                f"    <actuator name={quoted(rotor.name)}>{motor}</actuator>",
                "  </transmission>",
            ]

    def ties(self, found: list[tuple[str, str, str, float, float]]) -> None:
        """Couplers as mimics: a joint mimics one other joint."""
        for name, follower, leader, factor, offset in found:
            if follower in self.mimics:
                follower, leader, factor, offset = leader, follower, 1.0 / factor, -offset / factor
            if follower in self.mimics:
                self.report.dropped.append(f"coupler {name}: both joints mimic another one already")
            else:
                self.mimics[follower] = (leader, factor, offset)
                self.report.changed.append(f"coupler {name} has no name: joint {follower} mimics {leader}")

    def link(self, name: str, inside: str = "") -> None:
        """A link, massless if it has no body."""
        self.links.append(f"  <link name={quoted(name)}{f'>{inside}' if inside else '/>'}")

    def body(self, name: str) -> None:
        """A body with its inertia."""
        body = self.mechanism._description.bodies[name]
        com, j = body.com - self.frames[name][:3, 3], body.inertia
        if body.mass == 0.0 and not np.any(j):
            self.link(self.of(name))
            return
        if body.mass <= massless_of(one.mass for one in self.mechanism._description.bodies.values()):
            self.report.changed.append(f'body "{name}" of {body.mass:g} kg: readers may treat it as a frame')
        moments = zip(("xx", "xy", "xz", "yy", "yz", "zz"), j[np.triu_indices(3)], strict=True)
        inertia = " ".join(f'i{axes}="{text(value)}"' for axes, value in moments)
        self.link(
            self.of(name),
            f'\n    <inertial>\n      <origin xyz="{words(com)}" rpy="0 0 0"/>\n'
            f'      <mass value="{text(body.mass)}"/>\n'
            f"      <inertia {inertia}/>\n    </inertial>\n  </link>",
        )

    def of(self, body: str) -> str:
        """The link of a body."""
        return self.world if body == GROUND else body

    def branch(self, branch: Branch) -> None:
        pose = matmul(matmul(inverse(self.frames[branch.parent]), branch.pose), self.frames[branch.body])
        ends = self.of(branch.parent), self.of(branch.body)
        if not branch.motions:
            self.joint(branch.name, "floating" if branch.floats else "fixed", ends, pose)
            return
        assert branch.joint is not None
        self.chain(branch.joint.name, branch.joint.kind, branch.motions, ends, pose)

    def chain(
        self,
        name: str,
        kind: str,
        motions: tuple[Motion, ...],
        ends: tuple[str, str],
        pose: Array,
    ) -> None:
        """Translations and rotations, one after the other, through massless links."""
        bound = {*self.springs, *self.rotors}
        if kind == "planar" and not any((name, m.coordinate) in bound or m.name in self.mimics for m in motions):
            normal = next(m.axis for m in motions if m.kind == "turn")
            if not any(leader in {m.name for m in motions} for leader, _, _ in self.mimics.values()):
                self.joint(name, "planar", ends, pose, normal)
                return
        steps: list[tuple[str, Array, str, int]] = []
        for motion in motions:
            if motion.kind != "ball":
                steps.append((motion.kind, motion.axis, motion.name, motion.coordinate))
                continue
            for i, (turn, axis) in enumerate(_GIMBAL):
                last = motion is motions[-1] and i == 2
                steps.append((turn, axis, name if last else self.names.new(f"{name} turn {i}"), -1))
        if len(steps) > 1:
            links = f"{len(steps)} joints with massless links between them"
            self.report.changed.append(f"{kind} joint {name} is {links}")
        here = ends[0]
        for i, (motion_kind, axis, step, coordinate) in enumerate(steps):
            there = ends[1] if i == len(steps) - 1 else self.names.new(f"{name} link {i}")
            if there != ends[1]:
                self.link(there)
            found = self.springs.pop((name, coordinate), [])
            kind_word = "prismatic" if motion_kind == "slide" else "continuous"
            self.joint(step, kind_word, (here, there), pose if i == 0 else np.eye(4), axis, found)
            self.turned(step, self.rotors.pop((name, coordinate), []))
            here = there

    def joint(
        self,
        name: str,
        kind: str,
        ends: tuple[str, str],
        pose: Array,
        axis: Array | None = None,
        found: Iterable[LoadRecord] = (),
    ) -> None:
        """One joint of the file, with the springs at it."""
        lines = [
            f"  <joint name={quoted(name)} type={quoted(kind)}>",
            f'    <origin xyz="{words(pose[:3, 3])}" rpy="{words(rpy(pose[:3, :3]))}"/>',
            f"    <parent link={quoted(ends[0])}/>",
            f"    <child link={quoted(ends[1])}/>",
        ]
        if axis is not None:
            lines.append(f'    <axis xyz="{words(axis)}"/>')
        if kind == "prismatic":
            far = f"{UNLIMITED:g}"
            lines.append(f'    <limit lower="-{far}" upper="{far}" effort="{far}" velocity="{far}"/>')
        found = list(found)
        damping = sum(record["damping"] for record in found)
        if damping > 0.0:
            lines.append(f'    <dynamics damping="{text(damping)}"/>')
        if len(found) > 1 or any(record["stiffness"] != 0.0 or record["damping"] < 0.0 for record in found):
            for record in found:
                law = _law(record["stiffness"], record["damping"], "angle", record["angle"])
                self.beside.append(f"{{name: {_scalar(record.name)}, joint: {_scalar(name)}, {law}}}")
                other = "take its damping alone" if damping > 0.0 else "do not know it"
                remark = f"spring {record.name} of joint {name} is written to the sidecar file"
                self.report.changed.append(f"{remark}; other programs {other}")
        if name in self.mimics:
            leader, factor, offset = self.mimics[name]
            attributes = f'joint={quoted(leader)} multiplier="{text(factor)}" offset="{text(offset)}"'
            lines.append(f"    <mimic {attributes}/>")
        self.joints += [*lines, "  </joint>"]

    def closure(self, closure: Closure) -> None:
        """Two frames to be joined: on the parent, or at the end of a chain from it, and on the child."""
        joint = closure.joint
        parent, child = self.of(joint.parent), self.of(joint.child)
        here = matmul(inverse(self.frames[joint.parent]), closure.here)
        there = matmul(inverse(self.frames[joint.child]), closure.there)
        kind = "3d" if joint.kind == "spherical" else "6d"
        # the names say how the loop is closed to who reads the URDF without its sidecar
        first, second = (self.names.new(f"closing {joint.name} {side}_{kind.upper()}") for side in "12")
        self.mark(second, child, there)
        if joint.kind in ("fixed", "spherical"):
            self.mark(first, parent, here)
        else:
            self.link(first)
            self.chain(joint.name, joint.kind, closure.motions, (parent, first), here)
        self.pairs.append((first, second))
        self.kinds.append(kind)
        self.loops.append(joint.name)

    def spring(self, record: LoadRecord) -> None:
        """A spring between two points, in the sidecar file."""
        ends = []
        for word, i in (("from", 1), ("to", 2)):
            body = record[f"body{i}"]
            pose = record[f"point{i}"] - self.frames[body][:3, 3]
            ends.append(f"{word}: {_listed([_scalar(self.of(body)), *map(_float, pose)])}")
        law = _law(record["stiffness"], record["damping"], "length", record["length"])
        self.beside.append(f"{{name: {_scalar(record.name)}, {', '.join(ends)}, {law}}}")
        remark = f"spring {record.name} between two points is written to the sidecar file"
        self.report.changed.append(f"{remark}; other programs ignore it")

    def mark(self, name: str, link: str, pose: Array) -> None:
        """A frame of a link."""
        self.link(name)
        self.joint(self.names.new(f"{name} on {link}"), "fixed", (link, name), pose)

    def sidecar(self) -> str | None:
        """The sidecar in YAML; None where it would be empty and no existing file would be read with the URDF."""
        d = self.mechanism._description
        driven = [d.measure["joint"] for d in d.drives.values() if d.measure.get("of") == "joint"]
        motors = list(dict.fromkeys(map(str, driven)))
        gravity = tuple(d.gravity.tolist())
        beside = any(_closes(self.report.path.with_suffix(end)) for end in (".yaml", ".yml"))
        misread = any(map(is_closing, d.bodies))
        tolerance = d.drawing_tolerance != DRAWING_TOLERANCE
        more = self.beside or self.weightless or tolerance
        if not (self.pairs or motors or gravity != GRAVITY or beside or misread or more):
            return None
        lines = [
            f"closed_loop: {_listed([_listed(map(_scalar, pair)) for pair in self.pairs])}",
            f"type: {_listed(map(_scalar, self.kinds))}",
            f"name: {_listed(map(_scalar, self.loops))}",
            f"name_mot: {_listed(map(_scalar, motors))}",
        ]
        if gravity != GRAVITY:
            lines.append(f"gravity: {_listed(_float(x) for x in gravity)}")
            remark = f"gravity ({', '.join(f'{x:g}' for x in gravity)}) is written to the sidecar file"
            self.report.changed.append(f"{remark}; other programs take (0, 0, -9.81)")
        if self.beside:
            lines += ["springs:", *(f"  - {spring}" for spring in self.beside)]
        if self.weightless:
            lines.append(f"weightless: {_listed(_scalar(self.of(name)) for name in self.weightless)}")
        if tolerance:
            lines.append(f"drawing_tolerance: {_float(d.drawing_tolerance)}")
        return "\n".join([*lines, ""])


def _closes(path: Path) -> bool:
    """Whether there is a file that would be read as a sidecar. Another file of that name is left unchanged."""
    try:
        with path.open("rb") as file:
            content = file.read(limit("sidecar_bytes"))
    except OSError:
        return False
    return b"closed_loop" in content or b"gravity" in content


def _listed(items: Iterable[str]) -> str:
    return f"[{', '.join(items)}]"


def _scalar(name: str) -> str:
    """A text in YAML: quoted as in JSON, which is YAML."""
    return json.dumps(name, ensure_ascii=False)


def _law(stiffness: float, damping: float, word: str, rest: float) -> str:
    return f"stiffness: {_float(stiffness)}, damping: {_float(damping)}, {word}: {_float(rest)}"


def _float(value: float) -> str:
    """A number in YAML, which requires a point before the exponent."""
    written = text(value)
    return written if "e" not in written or "." in written else written.replace("e", ".0e")


def rpy(rotation: Array) -> tuple[float, float, float]:
    """Roll, pitch and yaw about fixed axes that make a rotation."""
    r = rotation
    cosine = math.hypot(r[0, 0], r[1, 0])
    # where x points up or down, roll and yaw rotate about the same line: all of it is assigned to roll
    yaw = math.atan2(r[1, 0], r[0, 0]) if cosine > 0.0 else 0.0
    s, c = math.sin(yaw), math.cos(yaw)
    return math.atan2(r[0, 2] * s - r[1, 2] * c, r[1, 1] * c - r[0, 1] * s), math.atan2(-r[2, 0], cosine), yaw
