"""USD physics: joints between the bodies of a stage, which may close loops; drives as springs and dampers.

`usd_stage` composes the stage, `usd_bodies` reads its bodies, `usd_table` lists what becomes of each schema and
attribute. Lengths, masses and angles become metres, kilograms and radians; numbers in single precision are read as the
decimals that they were written as.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from ..products import matmul, norm
from ..tolerance import EQUAL_IN_SIX_DIGITS
from .format_table import remark
from .reading import Reading
from .request import Request
from .robot import Array, Joint, Loop, Robot, inverse
from .usd_bodies import GROUND, short
from .usd_joints import Frames, apart, kind_of, limited, split
from .usd_series import Series
from .usd_stage import Prim, Stage, opened
from .usd_table import LIMITS, OWN, USD
from .usd_ties import Known

EARTH = 9.81
"""Gravity [m/s^2] where a scene gives none: that of the earth."""


def read(path: Path, request: Request) -> Robot:
    """The mechanism in a file. Raises `FileFormatError` with the path of the prim that is wrong."""
    reading = Reading(path, "USD")
    with opened(path, request, reading) as stage:
        USD.visit(stage.root, reading)
        return _Reader(stage, reading, request).robot()


class _Reader(Series):
    """The mechanism of a stage: its bodies, and the joints between them."""

    def __init__(self, stage: Stage, reading: Reading, request: Request) -> None:
        super().__init__(stage, reading, request)
        self.known: dict[str, Known] = {}
        self.between: dict[str, tuple[str, str]] = {}

    def robot(self) -> Robot:
        robot = self.made
        robot.gravity = self.gravity()
        self.find()
        shapes = self.shapes()
        for path, body in self.bodies.items():
            robot.links[body.name] = self.link(body, shapes.get(path, []))
            assert robot.poses is not None
            robot.poses[body.name] = body.frame
            self.size = max(self.size, float(norm(body.frame[:3, 3])))
        joints = [prim for prim in self.prims if prim.tag.startswith("Physics") and prim.tag.endswith("Joint")]
        names = short(joints, set())
        self.between = self.series(joints, names)
        for prim in joints:
            self.joint(prim, names[prim.get("name")])
        for found in self.known.values():
            self.tie(found)
        self.driven()
        count = f"{len(self.bodies)} bodies, {len(robot.joints) + len(robot.loops)} joints"
        self.reading.used.append(remark(self.reading, self.stage.root, count, "", "used"))
        return robot

    def gravity(self) -> tuple[float, ...]:
        """Gravity of the first scene [m/s^2]; without a scene that of the earth."""
        scenes = [prim for prim in self.prims if prim.tag == "PhysicsScene"]
        for other in scenes[1:]:
            self.remark(other, "more than one scene; the gravity of the first acts on all bodies")
        if not scenes:
            self.remark(self.stage.root, f"no scene is given, so gravity is {EARTH} m/s^2 downwards", "", "changed")
            return tuple((-EARTH * self.up).tolist())
        scene = scenes[0]
        along = scene.finite("physics:gravityDirection", (0.0, 0.0, 0.0))
        size = scene.real("physics:gravityMagnitude", -np.inf)
        if not scene.flag("newton:gravityEnabled", scene.flag("mjc:flag:gravity", True)):
            size = 0.0
        if size == np.inf:
            scene.fail("has an infinite physics:gravityMagnitude")
        length = norm(along)
        along = along / length if length > 0.0 else -self.up
        # a negative magnitude is none, whatever its size
        found = along * (size * self.length if size >= 0.0 else EARTH)
        exact = scene.finite(f"{OWN}:gravity", found)
        same = np.allclose(exact, found, rtol=0.0, atol=EQUAL_IN_SIX_DIGITS * float(norm(found)))
        return tuple(self.agreed(scene, f"{OWN}:gravity", exact, found, same).tolist())

    def joint(self, prim: Prim, name: str) -> None:
        """A joint, which may close a loop."""
        if not prim.flag("physics:jointEnabled", True):
            self.remark(prim, "not enabled in the file, so it holds nothing", "", "changed")
            return
        ends = [self.end(prim, i) for i in (0, 1)]
        here, there = (frame for _, frame in ends)
        kind = kind_of(prim)
        first, second = self.between.get(prim.get("name"), (ends[0][0], ends[1][0]))
        if first == second:
            what = "the ground" if first == GROUND else f'one body, "{first}"'
            self.remark(prim, "it joins two frames of the same body, so it holds nothing", f"of {what}", "other")
            return
        if prim.tag == "PhysicsDistanceJoint":
            self.distance(prim, name, (first, second), Frames(here, there))
            return
        frames, drawn = split(prim, kind, Frames(here, there), self.size)
        gap, angle = apart(frames, self.size)
        if max(gap, angle) > EQUAL_IN_SIX_DIGITS:
            words = "not closed as drawn; assembly closes it"
            self.remark(prim, words, f"open by {_length(frames):.2g} m, {np.degrees(angle):.2g} deg", "changed")
        if kind.word == "universal" and prim.value(f"{OWN}:kind") != "universal":
            words = "USD does not say in which order it turns: a universal joint, as PhysX's D6 has it, first about "
            self.remark(prim, words + f"{kind.free[-1][1]} of the frame of body 0", "", "changed")
        for axis, low, high in limited(prim):
            self.remark(prim, LIMITS, f"{axis} {low:g} to {high:g}", "bounds")
        word = "generic" if kind.word == "prismatic" and angle > EQUAL_IN_SIX_DIGITS else kind.word
        efforts, along = self.efforts(prim, name, kind, drawn), kind.axis
        if frames.here is frames.there:
            some = np.array([1.0, 0.0, 0.0]) if along is None else along
            made = Joint(name, word, first, second, frames.here, some, prim, efforts)
            made.second, made.free = kind.second, kind.free
            self.made.joints[name] = made
        else:
            sides = (self.side(first, frames.here), self.side(second, frames.there))
            self.made.loops.append(Loop(name, word, *sides, prim, along, kind.second, efforts, kind.free))
        self.known[prim.get("name")] = Known(name, prim, replace(kind, drawn=tuple(drawn.items())))

    def side(self, link: str, frame: Array) -> tuple[str, Array]:
        """A link, and a frame of the world in it."""
        assert self.made.poses is not None
        return link, frame if link == GROUND else matmul(inverse(self.made.poses[link]), frame)

    def distance(self, prim: Prim, name: str, links: tuple[str, str], frames: Frames) -> None:
        """Two points at a constant distance."""
        least, most = prim.real("physics:minDistance", -1.0), prim.real("physics:maxDistance", -1.0)
        if least != most or least < 0.0:
            if max(least, most) >= 0.0:
                self.remark(prim, LIMITS, f"distance {least:g} to {most:g}", "bounds")
            else:
                self.remark(prim, "a distance joint without distances holds nothing", "", "other")
            return
        if least == 0.0:
            prim.fail("holds two points at the distance 0: use PhysicsSphericalJoint")
        exact = float(prim.finite(f"{OWN}:length", (most,))[0])
        same = np.float32(exact) == np.float32(most)
        length = self.length * float(self.agreed(prim, f"{OWN}:length", exact, most, bool(same)))
        sides = (self.side(links[0], frames.here), self.side(links[1], frames.there))
        self.made.loops.append(Loop(name, "distance", *sides, prim, length=length))


def _length(frames: Frames) -> float:
    return float(norm(frames.here[:3, 3] - frames.there[:3, 3]))
