"""SDFormat: links, frames and joints placed in their model or relative to each other; loops are joints like any other.

Frames follow `relative_to`, `attached_to` and `expressed_in`, or the rules of older versions. `sdf_table` lists what
becomes of each element and attribute. Models stand alone, in a world, in other models, and in files that are included;
a name in a nested model is that of the model, ::, and its own.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import FileFormatError
from . import closings
from .format_table import content, remark
from .format_table import number as as_version
from .looks import Look, mesh_file
from .reading import Reading, Remark
from .request import Request
from .robot import Array, Effort, Joint, Link, Robot, Tie, inverse, placed, turned, unit
from .sdf_table import SDF, VERSIONS
from .xmltree import Element, is_zero, numbers, parse, refuse

_KINDS = {
    "revolute": "revolute",
    "continuous": "revolute",
    "prismatic": "prismatic",
    "ball": "spherical",
    "universal": "universal",
    "fixed": "fixed",
    "screw": "screw",
}
GEARBOX = "gearbox"
"""Type of a joint that couples two hinges."""
_PARALLEL = 1e-6
"""Sine of the angle between axes that are one: files have six digits."""
_INCLUDES = 64
"""Files included in each other, at most."""
_RESERVED = (1, 7)
"""Version from which names are different, and no link may be called "world"."""
_IN_MODEL = "use_parent_model_frame"
GRAVITY = (0.0, 0.0, -9.8)
"""Gravity of worlds that give none [m/s^2]."""


def read(path: Path, request: Request) -> Robot:
    """The models in a file, alone or in a world. Raises `FileFormatError` with the line of what is wrong."""
    try:
        return _read(path, request)
    except RecursionError:
        refuse(path, None, "models nest, or frames are attached to each other, by hundreds; no mechanism needs so many")


def _read(path: Path, request: Request) -> Robot:
    reading = Reading(path, "SDFormat")
    root, version = _walked(path, reading)
    worlds = list(root.all("world"))
    if len(worlds) > 1:
        root.fail(f"contains {len(worlds)} worlds; one is read")
    world = worlds[0] if worlds else None
    top = root if world is None else world
    robot = Robot(path.stem, reading, request)
    physics = None if world is None else world.first("physics")
    given = [place.first("gravity") for place in (world, physics) if place is not None]
    gravity = next((found for found in given if found is not None), None)
    robot.gravity = GRAVITY if gravity is None else numbers(gravity, "the text", gravity.text, 3)
    if gravity is None:
        reading.changed.append(Remark(top.line, "gravity is the format's own, 9.8 m/s^2 along -z"))
    files = _Files(request, [path.resolve()])
    scope = _Scope(robot, top, version, files, reading)
    if not scope.inner:
        top.fail("contains 0 models")
    names = [model.element.get("name") for model in scope.inner.values()]
    robot.name = (names[0] if len(names) == 1 else top.get("name")) or path.stem
    if len(names) == 1 and not scope.named.keys() - scope.inner.keys():
        next(iter(scope.inner.values())).prefix = ""  # nothing outside the model names what is in it
    robot.poses = scope.poses
    scope.links()
    if not scope.count():
        next(iter(scope.inner.values())).element.fail("holds no <link>")
    scope.frames()
    scope.joints()
    scope.mimics()
    scope.gearboxes()
    scope.ends()
    closings.close_named(robot)
    reading.used.append(Remark(None, f"{len(robot.links)} links, {len(robot.joints)} joints"))
    return robot


def _walked(path: Path, reading: Reading) -> tuple[Element, tuple[int, ...]]:
    """The root of a file, what is not read being reported, and its version."""
    root = parse(path)
    if root.tag != "sdf":
        root.fail("is not <sdf>: this is not SDFormat")
    version = root.get("version")
    if version not in ("", *VERSIONS):
        root.fail(f'has the version "{version}"; {VERSIONS[0]} to {VERSIONS[-1]} are read')
    if not version:
        version = VERSIONS[-1]
        reading.changed.append(Remark(root.line, f"no version is given, so the rules of {version} are used"))
    _motorless(root, reading)
    SDF.visit(root, reading, as_version(version))
    return root, as_version(version)


def _motorless(root: Element, reading: Reading) -> None:
    """Take out rotors of joints whose effort is 0: Drake puts no motors there."""
    waiting = [root]
    while waiting:
        item = waiting.pop()
        waiting += item.children
        axis = item.first("axis") if item.tag == "joint" else None
        limit = None if axis is None else axis.first("limit")
        effort = None if limit is None else limit.first("effort")
        if effort is None or not is_zero(effort.text):
            continue
        for rotor in item.all("drake:rotor_inertia"):
            text = "the joint has an effort of 0: no motor, and no rotor"
            reading.dropped.append(remark(reading, rotor, text, content(rotor, f'joint "{item.get("name")}"'), "other"))
        item.children = [child for child in item.children if not child.tag.startswith("drake:")]


@dataclass
class _Files:
    """Files that include each other, and how many more may be."""

    request: Request
    chain: list[Path]
    left: int = _INCLUDES

    def model(self, item: Element, reading: Reading) -> tuple[Element, tuple[int, ...], _Files]:
        """The model that an <include> names, with what the include says otherwise, and the version of its file."""
        where = item.the("uri").text.strip()
        bare = "/" not in where and not Path(where).suffix
        found, why = self.request.found(item.path, f"model://{where}" if bare else where)
        if found is None:
            item.fail(f'includes "{where}": {why}')
        file = _file_of(found) if found.is_dir() else found
        self.left -= 1
        if file in self.chain or self.left < 0:
            item.fail(f'includes "{where}", which includes this file, or more than {_INCLUDES} files')
        own = Reading(file, reading.kind)
        root, version = _walked(file, own)
        models = list(root.all("model"))
        if len(models) != 1:
            item.fail(f'includes "{where}", which contains {len(models)} models; one is included')
        for remarks, more in ((reading.changed, own.changed), (reading.dropped, own.dropped)):
            remarks += [replace(x, line=None, name=f"{x.name} in {file.name}".strip()) for x in more]
        model = models[0]
        for tag in ("name", "placement_frame"):
            if (text := item.first(tag)) is not None:
                model.attributes[tag] = text.text.strip()
        for tag in ("pose", "static"):
            if (text := item.first(tag)) is not None:
                model.children = [text, *(child for child in model.children if child.tag != tag)]
        inner = _Files(self.request, [*self.chain, file], self.left)
        return model, version, inner


def _file_of(folder: Path) -> Path:
    """The file of a model in its folder: that of the highest version in its model.config, else model.sdf."""
    config = folder / "model.config"
    listed: list[tuple[tuple[int, ...], str]] = []
    if config.is_file():
        for item in parse(config).all("sdf"):
            version = item.get("version") or VERSIONS[0]
            if version in VERSIONS:
                listed.append((as_version(version), item.text.strip()))
    name = max(listed)[1] if listed else "model.sdf"
    file = (folder / name).resolve()
    if not file.is_relative_to(folder.resolve()):
        refuse(config, None, f'names the file "{name}", which leads out of its folder')
    return file


class _Scope:
    """A model or the world: names in it, frames relative to its own, and the models nested in it."""

    def __init__(
        self,
        robot: Robot,
        element: Element,
        version: tuple[int, ...],
        files: _Files,
        reading: Reading,
        outer: _Scope | None = None,
    ) -> None:
        self.made, self.element, self.version, self.reading, self.outer = robot, element, version, reading, outer
        self.prefix = ""
        self.named: dict[str, Element] = {}
        self.inner: dict[str, _Scope] = {}
        self.merged: list[_Scope] = []
        self.known: dict[str, Array] = {"__model__": np.eye(4)}
        self.poses: dict[str, Array] = {} if outer is None else outer.poses
        self.placed: Array | None = None
        self.placing = False
        static = self.flag(element.first("static"), False)
        self.static: bool = static or (outer is not None and outer.static)
        self.keys: dict[int, str] = {}
        for item in sorted(element.children, key=lambda item: item.tag != "link"):
            if item.tag == "include":
                try:
                    model, its_version, its_files = files.model(item, reading)
                except FileFormatError as error:
                    if outer is not None:
                        raise  # part of a model would be missing
                    self.note("dropped", item, f"a model of the world is missing: {error.message}", "", "motion")
                    continue
                self.nest(_Scope(robot, model, its_version, its_files, reading, self), item)
                files.left = its_files.left
            elif item.tag == "model":
                self.nest(_Scope(robot, item, version, files, reading, self), item)
            elif item.tag in ("link", "joint", "frame"):
                self.name(item.must("name"), item)
        if static and not (outer is not None and outer.static):
            text = "the model is static: its links are the ground, and its joints do not move"
            self.note("changed", element, text, f'model "{element.get("name")}"')

    def name(self, name: str, item: Element) -> None:
        old = name == "world" and item.tag == "link" and self.version < _RESERVED
        if self.version < _RESERVED and name in self.named and self.named[name].tag != item.tag:
            name = f"{name} ({item.tag})"  # old versions know what is meant by where it is named
        if name in self.named or (name in ("__model__", "world") and not old):
            item.fail(f'has the name "{name}", which is already in use')
        if old:
            self.note("changed", item, f'is called "{self.full(name)}" here, and is not the world', 'link "world"')
        self.named[name] = item
        self.keys[id(item)] = name

    def nest(self, scope: _Scope, item: Element) -> None:
        """A model inside this one; the names of a merged one are those of this one too."""
        if item.tag == "include" and item.get("merge") in ("true", "1"):
            self.merged.append(scope)
            return
        self.name(scope.element.must("name"), item)
        self.inner[scope.element.must("name")] = scope
        scope.prefix = f"{scope.element.must('name')}::"

    def full(self, name: str) -> str:
        """A name in this scope as one of the mechanism."""
        own = f"{name} link" if name == "world" else name
        return (self.outer.full("") if self.outer is not None else "") + self.prefix + own

    def all(self) -> Iterator[_Scope]:
        """This and all models inside it."""
        yield self
        for scope in (*self.inner.values(), *self.merged):
            yield from scope.all()

    def has(self, name: str) -> bool:
        """Whether a name, or the model that it begins with, stands here or in a model merged into this one."""
        return not self.named.keys().isdisjoint((name, name.partition("::")[0])) or self.from_merged(name) is not None

    def from_merged(self, name: str) -> _Scope | None:
        """The merged model from which this one has a name."""
        return next((scope for scope in self.merged if scope.has(name)), None)

    def count(self) -> int:
        return sum(item.tag == "link" for scope in self.all() for item in scope.named.values())

    def note(self, remarks: str, at: Element, text: str, name: str = "", kind: str = "") -> None:
        """A remark; one on an included file says so instead of the line."""
        own = at.path == self.reading.path
        named = name if own else f"{name} in {at.path.name}".strip()
        getattr(self.reading, remarks).append(Remark(at.line if own else None, text, named, kind))

    def links(self) -> None:
        for scope in self.all():
            for item in scope.element.all("link"):
                scope.link(item)

    def frames(self) -> None:
        """Refuse frames that are placed in, or attached to, what does not exist; used or not."""
        for scope in self.all():
            for item in scope.element.all("frame"):
                scope.frame(scope.keys[id(item)], item)
                scope.carrier(scope.keys[id(item)], item)

    def joints(self) -> None:
        for scope in self.all():
            for item in () if scope.static else scope.element.all("joint"):
                scope.joint(item)

    def mimics(self) -> None:
        for scope in self.all():
            for item in () if scope.static else scope.element.all("joint"):
                scope.mimic(item)

    def ends(self) -> None:
        """Frames that close loops by their names, where no joint names them. What is attached to nothing moves with
        the link that its pose is relative to: by this, programs mean where they put it."""
        for scope in self.all():
            joined = {scope.word(item, end) for item in scope.element.all("joint") for end in ("parent", "child")}
            for item in scope.element.all("frame"):
                name = scope.keys[id(item)]
                plain = name.removesuffix(closings.AXIS)
                if scope.static or not closings.is_closing(plain) or not joined.isdisjoint((name, plain)):
                    continue
                pose, of = item.first("pose"), name
                if pose is not None and not item.get("attached_to") and scope.base(pose):
                    of = scope.base(pose)
                    remark = (
                        f'attached to the model; as the end of a loop it moves with "{of}", where its pose is given'
                    )
                    scope.note("changed", item, remark, f'frame "{scope.full(name)}"')
                link = scope.carrier(of, item)
                where = np.eye(4) if link == "world" else scope.poses[link]
                scope.made.frames[scope.full(name)] = link, inverse(where) @ scope.at @ scope.frame(name, item)

    def place(self, asked: tuple[str, ...] = ()) -> Array:
        """The frame of this model in that of the scope around it: by its own frame, or by the one that it names."""
        if self.outer is None or self.placed is not None:
            return np.eye(4) if self.placed is None else self.placed
        if self.placing:
            self.element.fail(f"is placed relative to itself: {' -> '.join((*asked, self.element.get('name')))}")
        self.placing = True
        own, name = self.element.first("pose"), self.element.get("placement_frame")
        base = self.outer.frame((self.base(own) if own is not None else "") or "__model__", self.element, asked)
        self.placed = base @ self.pose(own)
        if name:
            self.placed = self.placed @ inverse(self.frame(name, self.element))
        return self.placed

    @property
    def at(self) -> Array:
        """The frame of this model in the world."""
        return self.place() if self.outer is None else self.outer.at @ self.place()

    def base(self, pose: Element) -> str:
        """The frame that a pose names: by `relative_to`, up to 1.6 by `frame`."""
        return pose.get("relative_to") or pose.get("frame")

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
        """A frame, relative to that of this model."""
        if name in self.known:
            return self.known[name]
        if name == "world" and name not in self.named:
            return inverse(self.at)
        if name in asked:
            by.fail(f"is placed relative to itself: {' -> '.join((*asked, name))}")
        if (merged := self.from_merged(name)) is not None:
            return merged.place() @ merged.frame(name, by)
        first, _, rest = name.partition("::")
        if first in self.inner:
            inside = self.inner[first]
            return inside.place((*asked, name)) @ (inside.frame(rest, by) if rest else np.eye(4))
        if name not in self.named:
            by.fail(f'names the frame "{name}", which does not exist')
        item = self.named[name]
        own = item.first("pose")
        otherwise = {"joint": self.child(item), "frame": item.get("attached_to")}.get(item.tag, "") or "__model__"
        base = (self.base(own) if own is not None else "") or otherwise
        self.known[name] = self.frame(base, item, (*asked, name)) @ self.pose(own)
        return self.known[name]

    def carrier(self, name: str, by: Element, asked: tuple[str, ...] = ()) -> str:
        """The link that a frame moves with, by its name in the mechanism; "world" for one of a static model."""
        if self.static or (name == "world" and name not in self.named) or (name == "__model__" and self.outer is None):
            return "world"
        if name == "__model__":
            return self.carrier(self.canonical(by), by, (*asked, name))
        if (merged := self.from_merged(name)) is not None:
            return merged.carrier(name, by)
        first, _, rest = name.partition("::")
        if first in self.inner:
            return self.inner[first].carrier(rest or "__model__", by)
        if name not in self.named or name in asked:
            by.fail(f'names the frame "{name}", which moves with no link')
        item = self.named[name]
        if item.tag == "link":
            return self.full(name)
        of = self.child(item) if item.tag == "joint" else item.get("attached_to") or "__model__"
        return self.carrier(of, by, (*asked, name))

    def canonical(self, by: Element) -> str:
        """The link that the frame of this model moves with: the one that it names, else its first."""
        named = self.element.get("canonical_link")
        if named:
            return named
        links = [item.must("name") for item in self.element.all("link")]
        links += [name for name, scope in self.inner.items() if scope.count()]
        links += [scope.canonical(by) for scope in self.merged if scope.count()]
        return links[0] if links else by.fail("is attached to a model without links")

    def flag(self, item: Element | None, otherwise: bool = True) -> bool:
        """What a flag says."""
        text = "" if item is None else item.text.strip().lower()
        if item is not None and text not in ("true", "false", "1", "0"):
            item.fail(f'says "{text}"; it takes true or false')
        return text in ("true", "1") if item is not None else otherwise

    def mimic(self, item: Element) -> None:
        """A coordinate that follows another: multiplier x (the other - reference) + offset."""
        axis = item.first("axis")
        mimic = None if axis is None else axis.first("mimic")
        if mimic is None:
            return
        name, other = self.full(item.must("name")), self.full(mimic.must("joint"))
        for joint in (name, other):
            if joint not in self.made.joints or self.made.joints[joint].kind not in ("revolute", "prismatic"):
                mimic.fail(f'couples joint "{joint}", which does not have exactly one coordinate')
        if mimic.get("axis", "axis") != "axis":
            mimic.fail(f'follows the axis "{mimic.get("axis")}" of joint "{other}", which has one axis, "axis"')
        values = {"multiplier": 1.0, "offset": 0.0, "reference": 0.0}
        for tag in values:
            found = mimic.first(tag)
            if found is not None:
                values[tag] = numbers(found, "the text", found.text, 1)[0]
        factor, offset = values["multiplier"], values["offset"] - values["multiplier"] * values["reference"]
        if factor == 0.0:
            mimic.fail("has the multiplier 0; fix the joint instead")
        self.made.ties.append(Tie(f"{name} follows {other}", [name, other], [1.0, -factor], offset, mimic))
        text = f"joint {name} = {factor:g} x {other} + {offset:g}, a coupler"
        self.note("used", mimic, text)

    def gearboxes(self) -> None:
        for scope in self.all():
            for item in () if scope.static else scope.element.all("joint"):
                if item.get("type") == GEARBOX:
                    scope.gearbox(item)

    def gearbox(self, item: Element) -> None:
        """theta_2 = -ratio theta_1: angles of parent and child from the reference body, about the two axes."""
        name, ratio = self.full(item.must("name")), 1.0
        if (given := item.first("gearbox_ratio")) is not None:
            ratio = numbers(given, "the text", given.text, 1)[0] or given.fail("is 0; fix the joint instead")
        where = self.at @ self.frame(self.keys[id(item)], item)
        base = self.carrier(self.word(item, "gearbox_reference_body"), item)
        axes = [where[:3, :3] @ self.axis(item, tag, where) for tag in ("axis", "axis2")]
        links = [self.carrier(self.word(item, end), item) for end in ("parent", "child")]
        hinges = [self.hinge(base, link, axis) for link, axis in zip(links, axes, strict=True)]
        if hinges[0] is None or hinges[1] is None:
            text = f'it would gear hinges on "{base}" about these axes, which are not there: add_gear, add_coupler'
            self.note("dropped", item, text, content(item))
            return
        (first, one), (second, other) = hinges[0], hinges[1]
        self.made.ties.append(Tie(name, [second, first], [other, ratio * one], 0.0, item))
        self.note("used", item, f"a gear: {second} turns {-ratio * one * other:g} times as far as {first}")

    def hinge(self, base: str, link: str, axis: Array) -> tuple[str, float] | None:
        """The hinge between two links about an axis, and 1 where its coordinate is the angle of the link, else -1."""
        for joint in self.made.joints.values():
            about = joint.pose[:3, :3] @ joint.axis
            along = float(about @ axis)
            parallel = joint.kind == "revolute" and float(np.linalg.norm(np.cross(about, axis))) <= _PARALLEL
            if parallel and (joint.parent, joint.child) in ((base, link), (link, base)):
                return joint.name, float(np.sign(along)) * (1.0 if joint.parent == base else -1.0)
        return None

    def child(self, item: Element) -> str:
        return self.word(item, "child") if item.tag == "joint" else ""

    def word(self, item: Element, tag: str) -> str:
        found = item.the(tag)
        return found.text.strip() or found.fail("says nothing")

    def look(self, link: str, frame: Array, item: Element) -> None:
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
                self.note("dropped", of, f"the mesh {named}: {why}", f'link "{link}"', "looks")
                return
            scale = read("scale", 3) if of.first("scale") is not None else [1.0, 1.0, 1.0]
            shape = {"kind": "mesh", "file": str(file), "scale": scale}
        if shape is None:
            self.note("dropped", item, f"a <{of.tag}>", f'link "{link}"', "looks")
            return
        self.made.looks.append(Look(link, frame @ self.pose(item.first("pose")), shape))

    def link(self, item: Element) -> None:
        name, inertial = self.full(item.must("name")), item.first("inertial")
        where = self.at @ self.frame(self.keys[id(item)], item)
        for visual in item.all("visual"):
            try:
                self.look("world" if self.static else name, where if self.static else np.eye(4), visual)
            except FileFormatError as error:  # how a robot looks does not decide whether it is read
                self.note("dropped", visual, error.message, f'link "{name}"', "looks")
        if self.static:
            return
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
            self.note("changed", item, remark, f'link "{name}"')
        if name in self.made.links:
            item.fail(f'has the name "{name}", which is already in use')
        floats = self.flag(item.first("gravity"))
        self.made.links[name] = Link(name, mass, pose[:3, 3], 0.5 * (inertia + inertia.T), item, floats)
        self.poses[name] = where

    def joint(self, item: Element) -> None:
        name, kind = self.full(item.must("name")), item.must("type")
        if name in self.made.joints:
            item.fail(f'has the name "{name}", which is already in use')
        if kind == GEARBOX:
            return
        if kind not in _KINDS:
            item.fail(f'has the type "{kind}"; known: {", ".join((*_KINDS, GEARBOX))}')
        ends = []
        for tag in ("parent", "child"):
            link = self.carrier(self.word(item, tag), item)
            if link not in self.made.links and link != "world":
                item.fail(f"has a {tag} that is attached to no link")
            ends.append(link)
        if ends == ["world", "world"]:
            self.note("dropped", item, "both of its ends are the ground", f'joint "{name}"', "other")
            return
        where = self.at @ self.frame(self.keys[id(item)], item)
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
                made.efforts += [] if law.is_empty else [law]
            text = f"springs and dampers do not act along the coordinate of a {kind} joint: add_torsion_spring"
            for key, value in of.items():
                if value != 0.0:
                    self.note("dropped", found, text, f'joint "{name}" {key} {value:g}')
        rotor = self.values(item, "drake:rotor_inertia", "drake:gear_ratio")
        if inertia := rotor.get("drake:rotor_inertia", 0.0):
            if inertia < 0.0:
                item.fail(f"has a rotor of the inertia {inertia:g}; it must be 0 or more")
            ratio = rotor.get("drake:gear_ratio", 1.0)
            made.efforts += [Effort(rotor=inertia, ratio=ratio)] if ratio != 0.0 else []
            self.note("used", item, f"a rotor of {inertia:g} turns {ratio:g} times as fast", f'joint "{name}"')
        self.made.joints[name] = made

    def values(self, item: Element, *tags: str) -> dict[str, float]:
        """Numbers of elements that are there."""
        return {x.tag: numbers(x, "the text", x.text, 1)[0] for x in item.all(*tags)}

    def axis(self, item: Element, tag: str, where: Array) -> Array:
        """An axis in the joint's own frame."""
        found = item.the(tag).first("xyz")
        axis = np.array([0.0, 0.0, 1.0] if found is None else numbers(found, "the text", found.text, 3))
        other = "" if found is None else found.get("expressed_in")
        if self.version < (1, 5) or (self.version < (1, 7) and self.flag(item.the(tag).first(_IN_MODEL), False)):
            other = "__model__"
        if other:
            axis = where[:3, :3].T @ (self.at @ self.frame(other, item))[:3, :3] @ axis
        direction = unit(axis)
        return direction if direction is not None else item.fail("has an axis of length 0")
