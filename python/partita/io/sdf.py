"""SDFormat: links, frames and joints placed in their model or relative to each other; loops are joints like any other.

Frames follow `relative_to`, `attached_to` and `expressed_in`, or the rules of older versions. `sdf_table` lists what
becomes of each element and attribute; nested models and `<include>` are refused, since they would lead to other files.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..errors import FileFormatError
from .format_table import number as as_version
from .looks import Look, mesh_file
from .reading import Reading, Remark
from .request import Request
from .robot import Array, Effort, Joint, Link, Robot, Tie, placed, turned
from .sdf_table import SDF, VERSIONS
from .xmltree import Element, numbers, parse

_KINDS = {
    "revolute": "revolute",
    "continuous": "revolute",
    "prismatic": "prismatic",
    "ball": "spherical",
    "universal": "universal",
    "fixed": "fixed",
    "screw": "screw",
}
_IN_MODEL = "use_parent_model_frame"
GRAVITY = (0.0, 0.0, -9.8)
"""Gravity of worlds that give none [m/s^2]."""


def read(path: Path, request: Request) -> Robot:
    """The model in a file. Raises `FileFormatError` with the line of what is wrong."""
    root = parse(path)
    if root.tag != "sdf":
        root.fail("is not <sdf>: this is not SDFormat")
    reading = Reading(path, "SDFormat")
    version = root.get("version")
    if version not in ("", *VERSIONS):
        root.fail(f'has the version "{version}"; {VERSIONS[0]} to {VERSIONS[-1]} are read')
    if not version:
        version = VERSIONS[-1]
        reading.changed.append(Remark(root.line, f"no version is given, so the rules of {version} are used"))
    SDF.walk(root, reading, as_version(version))
    world = root.first("world")
    models = list((world or root).all("model"))
    if len(models) != 1:
        (world or root).fail(f"contains {len(models)} models; one is read")
    model = models[0]
    robot = Robot(model.get("name") or path.stem, reading, request)
    physics = None if world is None else world.first("physics")
    given = [place.first("gravity") for place in (world, physics) if place is not None]
    gravity = next((found for found in given if found is not None), None)
    robot.gravity = GRAVITY if gravity is None else numbers(gravity, "the text", gravity.text, 3)
    if gravity is None:
        reading.changed.append(Remark(model.line, "gravity is the format's own, 9.8 m/s^2 along -z"))
    for tag in ("model", "include"):
        if (inner := model.first(tag)) is not None:
            inner.fail("is nested in a model; nested models are not read: put all links and joints into one model")
    return _Reader(robot, model, as_version(version)).robot()


class _Reader:
    def __init__(self, robot: Robot, model: Element, version: tuple[int, ...]) -> None:
        self.made, self.model, self.version = robot, model, version
        self.poses: dict[str, Array] = {}
        robot.poses = self.poses
        self.named: dict[str, Element] = {}
        self.known: dict[str, Array] = {"__model__": np.eye(4), "world": np.eye(4)}
        for item in model.all("link", "joint", "frame"):
            name = item.must("name")
            if name in self.named or name in self.known:
                item.fail("has a name that is already in use")
            self.named[name] = item
        self.place()

    def place(self) -> None:
        """Put the model into the world, by its own frame or by the one that it names."""
        own = self.model.first("pose")
        base = "" if own is None else self.base(own)
        if own is not None and base not in ("", "world"):
            own.fail(f'is given relative to "{base}", a frame of the world, which is not read')
        pose, name = self.pose(own), self.model.get("placement_frame")
        if name:
            inside = self.frame(name, self.model)
            back = inside[:3, :3].T
            pose = pose @ placed(-back @ inside[:3, 3], back)
        self.known = {"__model__": pose, "world": np.eye(4)}

    def base(self, pose: Element) -> str:
        """The frame that a pose names: by `relative_to`, up to 1.6 by `frame`."""
        return pose.get("relative_to") or pose.get("frame")

    def robot(self) -> Robot:
        robot, model = self.made, self.model
        for item in model.all("link"):
            self.link(item)
        if not robot.links:
            model.fail("holds no <link>")
        for item in model.all("joint"):
            self.joint(item)
        if (static := model.first("static")) is not None and static.text.strip() in ("true", "1"):
            static.fail("declares this model static")
        for item in model.all("joint"):
            self.mimic(item)
        robot.reading.used.append(Remark(None, f"{len(robot.links)} links, {len(robot.joints)} joints"))
        return robot

    def pose(self, item: Element | None) -> Array:
        """The transform given by a `<pose>`, relative to its frame."""
        if item is None or not item.text.strip():
            return np.eye(4)
        if item.get("rotation_format", "euler_rpy") == "quat_xyzw":
            x, y, z, *quaternion = numbers(item, "the text", item.text, 7)
            a, b, c, w = np.array(quaternion) / np.linalg.norm(quaternion)
            cross = np.array([[0, -c, b], [c, 0, -a], [-b, a, 0]])
            return placed((x, y, z), np.eye(3) + 2 * w * cross + 2 * cross @ cross)
        values = numbers(item, "the text", item.text, 6)
        rpy = np.array(values[3:])
        return placed(values[:3], turned(np.radians(rpy) if item.get("degrees") in ("true", "1") else rpy))

    def frame(self, name: str, by: Element, asked: tuple[str, ...] = ()) -> Array:
        """A frame in the model."""
        if name in self.known:
            return self.known[name]
        if name in asked:
            by.fail(f"is placed relative to itself: {' -> '.join((*asked, name))}")
        if name not in self.named:
            by.fail(f'names the frame "{name}", which does not exist')
        item = self.named[name]
        own = item.first("pose")
        otherwise = {"joint": self.child(item), "frame": item.get("attached_to")}.get(item.tag, "") or "__model__"
        base = (self.base(own) if own is not None else "") or otherwise
        self.known[name] = self.frame(base, item, (*asked, name)) @ self.pose(own)
        return self.known[name]

    def carrier(self, name: str, by: Element, asked: tuple[str, ...] = ()) -> str:
        """The link that a frame moves with."""
        if name == "__model__":
            return self.model.get("canonical_link") or next(iter(self.made.links))
        if name == "world" or name in self.made.links:
            return name
        if name not in self.named or name in asked:
            by.fail(f'names the frame "{name}", which moves with no link')
        item = self.named[name]
        of = self.child(item) if item.tag == "joint" else item.get("attached_to") or "__model__"
        return self.carrier(of, by, (*asked, name))

    def flag(self, item: Element | None, otherwise: bool = True) -> bool:
        """What a flag says."""
        said = "" if item is None else item.text.strip().lower()
        if item is not None and said not in ("true", "false", "1", "0"):
            item.fail(f'says "{said}"; it takes true or false')
        return said in ("true", "1") if item is not None else otherwise

    def mimic(self, item: Element) -> None:
        """A coordinate that follows another: multiplier x (the other - reference) + offset."""
        axis = item.first("axis")
        mimic = None if axis is None else axis.first("mimic")
        if mimic is None:
            return
        name, other = item.must("name"), mimic.must("joint")
        for joint in (name, other):
            if joint not in self.made.joints or self.made.joints[joint].kind not in ("revolute", "prismatic"):
                mimic.fail(f'couples joint "{joint}", which does not have exactly one coordinate')
        if mimic.get("axis", "axis") != "axis":
            mimic.fail(f'follows the axis "{mimic.get("axis")}" of joint "{other}", which has one axis, "axis"')
        values: dict[str, float] = {}
        for tag in ("multiplier", "offset", "reference"):
            found = mimic.the(tag)
            values[tag] = numbers(found, "the text", found.text, 1)[0]
        factor, offset = values["multiplier"], values["offset"] - values["multiplier"] * values["reference"]
        if factor == 0.0:
            mimic.fail("has the multiplier 0; fix the joint instead")
        self.made.ties.append(Tie(f"{name} follows {other}", [name, other], [1.0, -factor], offset, mimic))
        said = f"joint {name} = {factor:g} x {other} + {offset:g}, a coupler"
        self.made.reading.used.append(Remark(mimic.line, said))

    def child(self, item: Element) -> str:
        return self.word(item, "child") if item.tag == "joint" else ""

    def word(self, item: Element, tag: str) -> str:
        found = item.the(tag)
        return found.text.strip() or found.fail("says nothing")

    def look(self, link: str, item: Element) -> None:
        """Appearance of a link; shapes that cannot be drawn are omitted and reported."""
        geometry = item.first("geometry")
        of = geometry.children[0] if geometry is not None and geometry.children else item

        def read(tag: str, count: int = 1) -> list[float]:
            inner = of.the(tag)
            return list(numbers(inner, "the text", inner.text, count))

        shape: dict[str, Any] | None = None
        if of.tag == "box":
            shape = {"kind": "box", "size": read("size", 3)}
        elif of.tag == "cylinder":
            shape = {"kind": "cylinder", "radius": read("radius")[0], "length": read("length")[0]}
        elif of.tag == "sphere":
            shape = {"kind": "ball", "radius": read("radius")[0]}
        elif of.tag == "mesh":
            named = of.the("uri").text.strip()
            file, why = mesh_file(self.made.request, of.path, named)
            if file is None:
                self.made.reading.dropped.append(Remark(of.line, f"the mesh {named}: {why}", f'link "{link}"', "looks"))
                return
            scale = read("scale", 3) if of.first("scale") is not None else [1.0, 1.0, 1.0]
            shape = {"kind": "mesh", "file": str(file), "scale": scale}
        if shape is None:
            self.made.reading.dropped.append(Remark(item.line, f"a <{of.tag}>", f'link "{link}"', "looks"))
            return
        self.made.looks.append(Look(link, self.pose(item.first("pose")), shape))

    def link(self, item: Element) -> None:
        name, inertial = item.must("name"), item.first("inertial")
        for visual in item.all("visual"):
            try:
                self.look(name, visual)
            except FileFormatError as error:  # how a robot looks does not decide whether it is read
                self.made.reading.dropped.append(Remark(visual.line, error.message, f'link "{name}"', "looks"))
        mass, pose, inertia = 1.0, np.eye(4), np.eye(3)
        if inertial is not None:
            pose = self.pose(inertial.first("pose"))
            weight, moments = inertial.first("mass"), inertial.first("inertia")
            mass = 1.0 if weight is None else numbers(weight, "the text", weight.text, 1)[0]
            of = dict.fromkeys(("ixx", "iyy", "izz"), 1.0) | dict.fromkeys(("ixy", "ixz", "iyz"), 0.0)
            for part in moments.children if moments is not None else ():
                if part.tag in of:
                    of[part.tag] = numbers(part, "the text", part.text, 1)[0]
            inertia = np.array([[of["ixx"], of["ixy"], of["ixz"]], [of["ixy"], of["iyy"], of["iyz"]],
                                [of["ixz"], of["iyz"], of["izz"]]])  # fmt: skip
            inertia = pose[:3, :3] @ inertia @ pose[:3, :3].T
        if inertial is None or inertial.first("mass") is None or inertial.first("inertia") is None:
            remark = "no mass or no inertia is given; the defaults of the format are 1 kg and 1 kg m^2"
            self.made.reading.changed.append(Remark(item.line, remark, f'link "{name}"'))
        floats = self.flag(item.first("gravity"))
        self.made.links[name] = Link(name, mass, pose[:3, 3], 0.5 * (inertia + inertia.T), item, floats)
        self.poses[name] = self.frame(name, item)

    def joint(self, item: Element) -> None:
        name, kind = item.must("name"), item.must("type")
        if kind not in _KINDS:
            item.fail(f'has the type "{kind}"; known: {", ".join(_KINDS)}')
        ends = []
        for tag in ("parent", "child"):
            link = self.carrier(self.word(item, tag), item)
            if link not in self.made.links and link != "world":
                item.fail(f"has a {tag} that is attached to no link")
            ends.append(link)
        where, dropped = self.frame(name, item), self.made.reading.dropped
        axes = [self.axis(item, tag, where) for tag in ("axis", "axis2") if item.first(tag) is not None]
        if not axes and _KINDS[kind] not in ("fixed", "spherical"):
            item.fail("holds no <axis>")
        if kind == "universal" and len(axes) != 2:
            item.fail("is universal and needs <axis> and <axis2>")
        axis = axes[0] if axes else np.array([1.0, 0.0, 0.0])
        made = Joint(name, _KINDS[kind], ends[0], ends[1], where, axis, item, second=axes[1] if len(axes) > 1 else None)
        if kind == "screw":
            advance, old = item.first("screw_thread_pitch"), item.first("thread_pitch")
            if advance is not None:
                made.pitch = numbers(advance, "the text", advance.text, 1)[0]
            elif old is not None:  # radians per metre, the other way round
                made.pitch = -2 * np.pi / (numbers(old, "the text", old.text, 1)[0] or old.fail("is 0"))
            else:
                item.fail("is a screw and needs <screw_thread_pitch>")
        for number, tag in enumerate(("axis", "axis2")):
            found = item.first(tag)
            if found is None:
                continue
            dynamics = found.first("dynamics")
            of = {x.tag: numbers(x, "the text", x.text, 1)[0] for x in (dynamics.children if dynamics else ())}
            if made.kind == "universal" or (number == 0 and made.kind in ("revolute", "prismatic")):
                called = f"spring of {name}" + (f" {tag}" if made.kind == "universal" else "")
                stiffness, damping = of.pop("spring_stiffness", 0.0), of.pop("damping", 0.0)
                law = Effort(stiffness, damping, of.pop("spring_reference", 0.0), number, called)
                made.efforts += [law] if stiffness != 0.0 or damping != 0.0 else []
            text = f"springs and dampers do not act along the coordinate of a {kind} joint: add_torsion_spring"
            left = (f'joint "{name}" {key} {value:g}' for key, value in of.items() if value != 0.0)
            dropped += [Remark(found.line, text, called) for called in left]
        self.made.joints[name] = made

    def axis(self, item: Element, tag: str, where: Array) -> Array:
        """An axis in the joint's own frame."""
        found = item.the(tag).first("xyz")
        axis = np.array([0.0, 0.0, 1.0] if found is None else numbers(found, "the text", found.text, 3))
        other = "" if found is None else found.get("expressed_in")
        if self.version < (1, 5) or (self.version < (1, 7) and self.flag(item.the(tag).first(_IN_MODEL), False)):
            other = "__model__"
        if other:
            axis = where[:3, :3].T @ self.frame(other, item)[:3, :3] @ axis
        length = float(np.linalg.norm(axis))
        return axis / length if length > 0.0 else item.fail("has an axis of length 0")
