"""USD physics: joints between the same two bodies, which hold all at once; or one after the other, as converters from
formats mean them in which a body has several joints.

In a series each joint carries the next one, in the order of the file; massless links are between them.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from ..products import matmul, norm
from ..tolerance import EQUAL_IN_SIX_DIGITS
from .robot import Array, Link, placed
from .usd_bodies import GROUND, rotation
from .usd_joints import Frames, Kind, apart, kind_of
from .usd_stage import Prim
from .usd_table import OWN
from .usd_ties import Ties

_AT_ONCE = (
    "joints between the same two bodies hold all at once, as USD has it, each with the directions that it locks; where "
    'they are meant one after the other, as converters from MJCF write them: serial_joints="auto" in partita.load'
)
_SERIES = "joints between the same two bodies are read one after the other, in this order"
_AWAY = (
    "stands in a series of joints between two bodies that are drawn away from where all its coordinates are zero, so "
    'their order does not say where each stands: draw them there, or serial_joints="stated" in partita.load'
)


class Series(Ties):
    """Bodies, the ends of joints on them, and which joints stand in a series."""

    size = 0.0
    """Distance of the farthest body from the origin [m]."""

    def end(self, prim: Prim, side: int) -> tuple[str, Array]:
        """The link on one side of a joint, and the frame of the joint in the world."""
        key = f"physics:body{side}"
        targets = prim.value(key) or []
        if len(targets) > 1:
            prim.fail(f"has {len(targets)} targets of {key}; a joint has one body on each side")
        point = self.precise(prim, f"physics:localPos{side}", (0.0,) * 3)
        word = f"physics:localRot{side}"
        turn = rotation(prim, word, self.precise(prim, word, (1.0, 0.0, 0.0, 0.0)))
        if not targets:
            return GROUND, placed(self.length * point, turn)
        at = self.stage.prims.get(targets[0])
        if at is None:
            prim.fail(f"joins {targets[0]} ({key}), which is not there")
        carrier = self.carried[targets[0]]
        frame = matmul(self.frame(at), placed(self.length * self.scale(at) * point, turn))
        return (GROUND if carrier == GROUND else self.bodies[carrier].name), frame

    def series(self, joints: list[Prim], names: dict[str, str]) -> dict[str, tuple[str, str]]:
        """The links that joints in series are between, by the paths of their prims; adds the massless ones."""
        groups: dict[tuple[str, str], list[Prim]] = {}
        for prim in joints:
            if prim.flag("physics:jointEnabled", True) and not prim.flag("physics:excludeFromArticulation", False):
                ends = (self.end(prim, 0)[0], self.end(prim, 1)[0])
                if ends[0] != ends[1]:
                    groups.setdefault(ends, []).append(prim)
        adding = self.adding(joints)
        found: dict[str, tuple[str, str]] = {}
        for ends, group in groups.items():
            if len(group) < 2 or not self.is_series(group):
                continue
            stated = all(prim.get("name") in adding for prim in group)
            called = ", ".join(f'{prim.tag} "{prim.get("name")}"' for prim in group)
            if stated or self.made.request.serial_joints == "auto":
                self.remark(self.stage.root, _SERIES, called, "changed")
                found |= self.chain(ends, group, names)
            else:
                self.remark(self.stage.root, _AT_ONCE, called)
        return found

    def is_series(self, group: list[Prim]) -> bool:
        """Whether joints of two bodies can be a series: each frees what the others lock."""
        kinds = [kind_of(prim) for prim in group]
        single = all(kind.word in ("revolute", "prismatic", "spherical") for kind in kinds)
        if not single or sum(kind.word == "spherical" for kind in kinds) > 1:
            return False
        if any(schema.startswith((f"{OWN}:", "MjcEqualityConnect", "MjcEqualityWeld"))
               for prim in group for schema in prim.attributes):  # fmt: skip
            return False
        lines = [(kind, self.end(prim, 0)[1]) for prim, kind in zip(group, kinds, strict=True)]
        return not any(_one(*pair, self.size) for pair in combinations(lines, 2))

    def chain(self, ends: tuple[str, str], group: list[Prim], names: dict[str, str]) -> dict[str, tuple[str, str]]:
        """The links that each joint of a series is between."""
        robot = self.made
        assert robot.poses is not None
        for prim in group:
            if max(apart(Frames(self.end(prim, 0)[1], self.end(prim, 1)[1]), self.size)) > EQUAL_IN_SIX_DIGITS:
                prim.fail(_AWAY)
        found, before = {}, ends[0]
        body = ends[1] if ends[1] != GROUND else ends[0]
        for prim, follows in zip(group, [*group[1:], None], strict=True):
            after = ends[1]
            if follows is not None:
                after = f"{body} before {names[follows.get('name')]}"
                while after in robot.links:
                    after += "_"
                robot.links[after] = Link(after, 0.0, np.zeros(3), np.zeros((3, 3)), prim)
                robot.poses[after] = robot.poses[body]
            found[prim.get("name")] = (before, after)
            before = after
        return found

    def adding(self, joints: list[Prim]) -> set[str]:
        """Paths of joints of articulations whose joints add mobility, as the file states (Newton)."""
        roots = [p.get("name") for p in self.prims if p.flag("newton:jointsAddMobility", False)]
        if not roots:
            return set()
        ends = {prim.get("name"): {self.end(prim, 0)[0], self.end(prim, 1)[0]} - {GROUND} for prim in joints}

        def within(path: str) -> bool:
            return any(path == root or path.startswith(f"{root}/") for root in roots)

        found = {path for path in ends if within(path)}
        bodies = {body.name for path, body in self.bodies.items() if within(path)}
        while True:
            bodies |= {name for path in found for name in ends[path]}
            more = {path for path, names in ends.items() if path not in found and names & bodies}
            if not more:
                return found
            found |= more


def _one(first: tuple[Kind, Array], second: tuple[Kind, Array], size: float) -> bool:
    """Whether two joints free the same motion: hinges on one line, or slides along one direction."""
    (kind, here), (other, there) = first, second
    if kind.word != other.word or kind.axis is None or other.axis is None:
        return False
    along, beside = matmul(here[:3, :3], kind.axis), matmul(there[:3, :3], other.axis)
    if float(norm(np.cross(along, beside))) > EQUAL_IN_SIX_DIGITS:
        return False
    between = there[:3, 3] - here[:3, 3]
    far = size + float(norm(here[:3, 3]))
    return kind.word == "prismatic" or float(norm(np.cross(along, between))) <= EQUAL_IN_SIX_DIGITS * far
