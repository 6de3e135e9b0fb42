"""A mechanism as MJCF. Joints of several degrees of freedom are several joints of a body; loop closures are equalities.

A common point is a `connect`, a hinge two of them, a weld is a `weld`. Any other joint that closes a loop carries half
of its body: the body is split into two halves of half the mass, one of them on the joint, and these are welded.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..builder import Builder
from ..builder.checks import Array
from ..builder.records import GROUND, BodyRecord, LoadRecord
from ..errors import FileFormatError
from ..files import put
from ..numeric import quaternion
from ..products import det, matmul
from ..tolerance import LEAST_DIVISOR, ROUNDING
from . import writing_table
from .robot import inverse
from .skeleton import (
    Branch,
    Closure,
    Motion,
    Spring,
    quoted,
    skeleton,
    springs,
    text,
    ties,
    words,
)
from .writing import Writing

LEAST_MASS = 2e-15
"""MuJoCo refuses a body that moves with less. Scale: kg, kg m^2. Reason: twice its own bound."""
SLIGHT = 1e-9
"""A moment of inertia may be raised by this without a remark. Scale: fraction of the largest one. Reason: inertias
are not known so precisely."""
DEEP = 500
"""Maximum nesting depth of bodies: readers of XML have limits."""


def write(mechanism: Builder, path: Path, strict: bool) -> Writing:
    """Write the file; the report lists the differences."""
    writer = _Writer(mechanism, Writing(path, "MJCF"))
    model = writer.text()
    writer.report.judge(strict)
    writer.report.files.append(put(path, model.encode("utf-8")))
    return writer.report


@dataclass
class _Writer:
    mechanism: Builder
    report: Writing
    sites: dict[str, list[str]] = field(default_factory=dict)
    equalities: list[str] = field(default_factory=list)
    halves: set[str] = field(default_factory=set)
    cuts: list[str] = field(default_factory=list)

    def text(self) -> str:
        """The MJCF."""
        d, report = self.mechanism._description, self.report
        tree = skeleton(self.mechanism, report)
        self.names, self.springs = tree.names, springs(d, report)
        self.rotors: dict[tuple[str, int], float] = {}
        for rotor in d.rotors.values():
            key = (rotor.joint, rotor.coordinate)
            self.rotors[key] = self.rotors.get(key, 0.0) + rotor.ratio**2 * rotor.inertia
        self.called = {name: name for name in d.bodies}
        if "world" in d.bodies:
            self.called["world"] = self.names.new("body world")
            report.changed.append(f'body "world" is called "{self.called["world"]}": the ground has that name')
        self.size = self.extent()
        children: dict[str, list[Branch]] = {}
        for branch in tree.branches:
            children.setdefault(branch.parent, []).append(branch)
        for closure in tree.closures:
            self.closure(closure, children)
        tied = ties(d, tree, report)
        for name, follower, leader, factor, offset in tied:
            ends = f"joint1={quoted(follower)} joint2={quoted(leader)}"
            coefficients = f'polycoef="{words((offset, factor, 0.0, 0.0, 0.0))}"'
            self.equalities.append(f"    <joint name={quoted(name)} {ends} {coefficients}/>")
        tendons = [line for f in d.loads("spring") for line in self.spring(f)]
        bodies = self.bodies(children)
        for joint, coordinate in self.springs:
            report.dropped.append(f"spring of coordinate {coordinate} of joint {joint}, which joins points")
        for joint, coordinate in self.rotors:
            report.dropped.append(f"rotor on coordinate {coordinate} of joint {joint}, which joins points")
        writing_table.visit(d, report)
        parts = [
            f"<mujoco model={quoted(d.name)}>",
            '  <compiler angle="radian" inertiafromgeom="false"/>',
            f'  <option gravity="{words(d.gravity)}"/>',
            "  <worldbody>",
            *self.sites.get(GROUND, []),
            *bodies,
            "  </worldbody>",
        ]
        for tag, lines in (("tendon", tendons), ("equality", self.equalities)):
            if lines:
                parts += [f"  <{tag}>", *lines, f"  </{tag}>"]
        return "\n".join([*parts, "</mujoco>", ""])

    def extent(self) -> float:
        """Extent of the drawing [m]."""
        positions = np.array([body.position for body in self.mechanism._description.bodies.values()] or [np.zeros(3)])
        found = float(np.linalg.norm(np.max(positions, axis=0) - np.min(positions, axis=0)))
        return found if found > 0.0 else 1.0

    def bodies(self, children: dict[str, list[Branch]]) -> list[str]:
        """Bodies nested in their parents."""
        lines: list[str] = []
        waiting: list[tuple[Branch | None, int]] = [(b, 2) for b in reversed(children.get(GROUND, []))]
        while waiting:
            branch, depth = waiting.pop()
            if branch is None:
                lines.append(f"{'  ' * depth}</body>")
                continue
            if depth > DEEP:
                raise FileFormatError(
                    f'"{self.report.path}": more than {DEEP} bodies are nested, which XML readers refuse; '
                    "save as .toml or .urdf",
                    path=str(self.report.path),
                    line=None,
                )
            lines += ["  " * depth + line for line in self.body(branch)]
            waiting.append((None, depth))
            if branch.name not in self.halves:
                lines += self.sites.get(branch.body, [])
                waiting += [(other, depth + 1) for other in reversed(children.get(branch.body, []))]
            else:
                lines += self.sites.get(branch.name, [])
        return lines

    def body(self, branch: Branch) -> list[str]:
        """The element of a body, without its end."""
        body = self.mechanism._description.bodies[branch.body]
        half = branch.name in self.halves
        name = branch.name if half else self.called[branch.body]
        pose = f'pos="{words(branch.pose[:3, 3])}" quat="{words(quaternion(branch.pose[:3, :3]))}"'
        held = "" if body.gravity else ' gravcomp="1"'
        moves = bool(branch.motions) or branch.floats
        parts = 1 + self.cuts.count(branch.body)
        lines = [f"<body name={quoted(name)} {pose}{held}>", f"  {self.inertial(body, parts, moves)}"]
        if branch.floats:
            if np.any(branch.point):
                origin = f'the origin of "{branch.body}", not its own point'
                self.report.changed.append(f"free joint {branch.name} gives the position of {origin}")
            if branch.parent == GROUND:
                lines.append(f"  <freejoint name={quoted(branch.name)}/>")
            else:
                lines += self.floating(branch)
        elif not branch.motions and branch.joint is not None:
            self.report.changed.append(f"weld {branch.name} loses its name: nested bodies are welded")
        if len(branch.motions) > 1 and branch.joint is not None:
            what = f"{branch.joint.kind} joint {branch.joint.name}"
            self.report.changed.append(f"{what} is written as the joints {', '.join(m.name for m in branch.motions)}")
        at = f'pos="{words(branch.point)}"'
        for motion in branch.motions:
            lines.append(f"  {self.joint(branch, motion, at)}")
        return lines

    def floating(self, branch: Branch) -> list[str]:
        """A free joint between two bodies that move."""
        self.report.changed.append(f"free joint {branch.name} is three slides and a ball: one end is not the ground")
        names = [*(self.names.new(f"{branch.name} {x}") for x in "xyz"), branch.name]
        slides = [
            f'  <joint name={quoted(name)} type="slide" axis="{words(axis)}"/>'
            for name, axis in zip(names, np.eye(3), strict=False)
        ]
        return [*slides, f'  <joint name={quoted(branch.name)} type="ball"/>']

    def joint(self, branch: Branch, motion: Motion, at: str) -> str:
        """One joint of a body."""
        name = quoted(motion.name)
        if motion.kind == "ball":
            return f'<joint name={name} type="ball" {at}/>'
        kind = "slide" if motion.kind == "slide" else "hinge"
        spring: Spring | None = None
        if branch.joint is not None:
            spring = self.springs.pop((branch.joint.name, motion.coordinate), None)
        moved = self.rotors.pop((branch.joint.name, motion.coordinate), None) if branch.joint is not None else None
        force = "" if moved is None else f' armature="{text(moved)}"'
        if spring is not None:
            force += f' damping="{text(spring.damping)}"' if spring.damping > 0.0 else ""
            if spring.stiffness > 0.0:
                force += f' stiffness="{text(spring.stiffness)}" springref="{text(spring.rest)}"'
        return f'<joint name={name} type="{kind}" {at} axis="{words(motion.axis)}"{force}/>'

    def inertial(self, body: BodyRecord, parts: int, moves: bool) -> str:
        """Mass and inertia of a body, or of a part of it; MuJoCo requires both to be positive."""
        mass, inertia = body.mass / parts, body.inertia / parts
        diagonal = np.array_equal(inertia, np.diag(np.diag(inertia)))
        moments, axes = (np.diag(inertia), np.eye(3)) if diagonal else np.linalg.eigh(inertia)
        if det(axes) < 0.0:
            axes[:, 0] *= -1.0
        least = LEAST_MASS if moves else 0.0
        given = np.array(moments)
        moments = np.maximum(given, least)
        small, middle, large = sorted(moments)
        if small + middle < large:  # by rounding, or as published with few digits
            moments[int(np.argmin(moments))] = (large - middle) * (1.0 + ROUNDING) + LEAST_DIVISOR
        if mass < least or np.any(moments != given):
            asked = f"mass {max(mass, least):g} kg, moments {words(moments)} kg m^2"
            remark = f'body "{body.name}" has {asked}: MuJoCo requires positive values, and a + b >= c'
            slight = mass >= least and float(np.max(np.abs(moments - given))) <= SLIGHT * float(np.max(np.abs(given)))
            (self.report.changed if slight else self.report.dropped).append(remark)
        turned = "" if diagonal else f' quat="{words(quaternion(axes))}"'
        attributes = f'mass="{text(max(mass, least))}" diaginertia="{words(moments)}"'
        return f'<inertial pos="{words(body.com)}"{turned} {attributes}/>'

    def site(self, body: str, name: str, pose: Array) -> str:
        """A frame on a body, or on a part of one."""
        called = self.names.new(name)
        frame = f'pos="{words(pose[:3, 3])}" quat="{words(quaternion(pose[:3, :3]))}"'
        self.sites.setdefault(body, []).append(f"    <site name={quoted(called)} {frame}/>")
        return called

    def closure(self, closure: Closure, children: dict[str, list[Branch]]) -> None:
        """A loop closure."""
        joint, name = closure.joint, closure.joint.name
        bound = any((name, m.coordinate) in {*self.springs, *self.rotors} for m in closure.motions)
        bound |= any(
            term.get("joint") == name for c in self.mechanism._description.couplings.values() for term in c.terms
        )
        if joint.kind == "fixed":
            self.hold("weld", name, joint.parent, closure.here, joint.child, closure.there)
        elif joint.kind in ("spherical", "revolute") and not bound:
            self.hold("connect", name, joint.parent, closure.here, joint.child, closure.there)
            if joint.kind == "revolute":
                along = np.eye(4)
                along[:3, 3] = self.size * closure.motions[0].axis
                frames = matmul(closure.here, along), matmul(closure.there, along)
                beside = self.names.new(f"{name} axis")
                self.hold("connect", beside, joint.parent, frames[0], joint.child, frames[1])
                self.report.changed.append(f"hinge {name} closes a loop: two points on its axis are connected")
        else:
            self.cut(closure, children)

    def hold(self, tag: str, name: str, parent: str, here: Array, child: str, there: Array) -> None:
        """Two frames become one."""
        sites = self.site(parent, f"{name} parent", here), self.site(child, f"{name} child", there)
        ends = f"site1={quoted(sites[0])} site2={quoted(sites[1])}"
        self.equalities.append(f"    <{tag} name={quoted(name)} {ends}/>")

    def cut(self, closure: Closure, children: dict[str, list[Branch]]) -> None:
        """Half of the child belongs to the joint and is welded to the other half."""
        joint = closure.joint
        reverse = joint.child == GROUND
        body, parent = (joint.parent, GROUND) if reverse else (joint.child, joint.parent)
        here, there = (closure.there, closure.here) if reverse else (closure.here, closure.there)
        half = self.names.new(f"{body} half at {joint.name}")
        sign = -1.0 if reverse else 1.0
        # axes are given in the frames of the joint, which agree where its coordinates are zero
        motions = [Motion(m.kind, matmul(there[:3, :3], sign * m.axis), m.name, m.coordinate) for m in closure.motions]
        motions = motions[::-1] if reverse else motions
        self.halves.add(half)
        self.cuts.append(body)
        pose = matmul(here, inverse(there))
        branch = Branch(body, parent, joint, pose, there[:3, 3], tuple(motions), name=half)
        children.setdefault(parent, []).append(branch)
        weld = self.names.new(f"{joint.name} closes")
        sites = self.site(half, f"{weld} half", np.eye(4)), self.site(body, f"{weld} body", np.eye(4))
        ends = f"site1={quoted(sites[0])} site2={quoted(sites[1])}"
        self.equalities.append(f"    <weld name={quoted(weld)} {ends}/>")
        self.report.changed.append(
            f'{joint.kind} joint {joint.name} closes a loop: it carries a part of "{body}", which is split into '
            f"parts of equal mass that {weld} welds together"
        )

    def spring(self, record: LoadRecord) -> list[str]:
        """A tendon between two sites."""
        stiffness, damping, length = record["stiffness"], record["damping"], record["length"]
        if stiffness < 0.0 or damping < 0.0:
            self.report.dropped.append(f"spring {record.name}, whose stiffness or damping is negative")
            return []
        ends = []
        if length < 0.0:
            self.report.dropped.append(f"spring {record.name}, whose free length is negative")
            return []
        for i in (1, 2):
            pose = np.eye(4)
            pose[:3, 3] = record[f"point{i}"]
            ends.append(self.site(record[f"body{i}"], f"{record.name} end {i}", pose))
        law = f'stiffness="{text(stiffness)}" damping="{text(damping)}" springlength="{text(length)}"'
        sites = [f"      <site site={quoted(end)}/>" for end in ends]
        return [f"    <spatial name={quoted(record.name)} {law}>", *sites, "    </spatial>"]
