"""SDFormat: files that include each other, the names in their models, and the frames that these place.

Frames follow `relative_to` and `attached_to`, or the rules of older versions. A name in a nested model is that of the
model, ::, and its own.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..errors import FileFormatError
from ..products import matmul, norm
from .format_table import content, remark
from .format_table import number as as_version
from .reading import Reading, Remark
from .request import Request
from .robot import Array, Robot, inverse, placed, turned
from .sdf_table import SDF, VERSIONS
from .xmltree import Element, is_zero, numbers, parse, refuse

_INCLUDES = 64
"""Files included in each other, at most."""
_RESERVED = (1, 7)


def walked(path: Path, reading: Reading) -> tuple[Element, tuple[int, ...]]:
    """The root of a file, what is not read being reported, and its version."""
    root = parse(path)
    if root.tag == "gazebo":
        root.fail(
            f"is the root of SDFormat up to 1.2; {VERSIONS[0]} to {VERSIONS[-1]} are read, to which gz sdf converts"
        )
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
class Files:
    """Files that include each other, and how many more may be."""

    request: Request
    chain: list[Path]
    left: int = _INCLUDES

    def model(self, item: Element, reading: Reading) -> tuple[Element, tuple[int, ...], Files]:
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
        root, version = walked(file, own)
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
        inner = Files(self.request, [*self.chain, file], self.left)
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


class Scope:
    """A model or the world: names in it, frames relative to its own, and the models nested in it."""

    def __init__(
        self,
        robot: Robot,
        element: Element,
        version: tuple[int, ...],
        files: Files,
        reading: Reading,
        outer: Scope | None = None,
    ) -> None:
        self.made, self.element, self.version, self.reading, self.outer = robot, element, version, reading, outer
        self.prefix = ""
        self.named: dict[str, Element] = {}
        self.inner: dict[str, Scope] = {}
        self.merged: list[Scope] = []
        self.missing: list[FileFormatError] = []
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
                    self.missing.append(error)
                    self.note("dropped", item, f"a model of the world is missing: {error.message}", "", "motion")
                    continue
                self.nest(Scope(robot, model, its_version, its_files, reading, self), item)
                files.left = its_files.left
            elif item.tag == "model":
                self.nest(Scope(robot, item, version, files, reading, self), item)
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

    def nest(self, scope: Scope, item: Element) -> None:
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

    def all(self) -> Iterator[Scope]:
        """This and all models inside it."""
        yield self
        for scope in (*self.inner.values(), *self.merged):
            yield from scope.all()

    def has(self, name: str) -> bool:
        """Whether a name, or the model that it begins with, stands here or in a model merged into this one."""
        return not self.named.keys().isdisjoint((name, name.partition("::")[0])) or self.from_merged(name) is not None

    def from_merged(self, name: str) -> Scope | None:
        """The merged model from which this one has a name."""
        return next((scope for scope in self.merged if scope.has(name)), None)

    def count(self) -> int:
        return sum(item.tag == "link" for scope in self.all() for item in scope.named.values())

    def note(self, remarks: str, at: Element, text: str, name: str = "", kind: str = "") -> None:
        """A remark; one on an included file says so instead of the line."""
        own = at.path == self.reading.path
        named = name if own else f"{name} in {at.path.name}".strip()
        getattr(self.reading, remarks).append(Remark(at.line if own else None, text, named, kind))

    def place(self, asked: tuple[str, ...] = ()) -> Array:
        """The frame of this model in that of the scope around it: by its own frame, or by the one that it names."""
        if self.outer is None or self.placed is not None:
            return np.eye(4) if self.placed is None else self.placed
        if self.placing:
            self.element.fail(f"is placed relative to itself: {' -> '.join((*asked, self.element.get('name')))}")
        self.placing = True
        own, name = self.element.first("pose"), self.element.get("placement_frame")
        base = self.outer.frame((self.base(own) if own is not None else "") or "__model__", self.element, asked)
        self.placed = matmul(base, self.pose(own))
        if name:
            self.placed = matmul(self.placed, inverse(self.frame(name, self.element)))
        return self.placed

    @property
    def at(self) -> Array:
        """The frame of this model in the world."""
        return self.place() if self.outer is None else matmul(self.outer.at, self.place())

    def base(self, pose: Element) -> str:
        """The frame that a pose names: by `relative_to`, up to 1.6 by `frame`."""
        return pose.get("relative_to") or pose.get("frame")

    def pose(self, item: Element | None) -> Array:
        """The transform given by a `<pose>`, relative to its frame."""
        if item is None or not item.text.strip():
            return np.eye(4)
        if item.get("rotation_format", "euler_rpy") == "quat_xyzw":
            x, y, z, *quaternion = numbers(item, "the text", item.text, 7)
            a, b, c, w = np.array(quaternion) / norm(quaternion)
            cross = np.array([[0, -c, b], [c, 0, -a], [-b, a, 0]])
            return placed((x, y, z), np.eye(3) + 2 * w * cross + matmul(2 * cross, cross))
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
            return matmul(merged.place(), merged.frame(name, by))
        first, _, rest = name.partition("::")
        if first in self.inner:
            inside = self.inner[first]
            return matmul(inside.place((*asked, name)), inside.frame(rest, by) if rest else np.eye(4))
        if name not in self.named:
            by.fail(f'names the frame "{name}", which does not exist')
        item = self.named[name]
        own = item.first("pose")
        otherwise = {"joint": self.child(item), "frame": item.get("attached_to")}.get(item.tag, "") or "__model__"
        base = (self.base(own) if own is not None else "") or otherwise
        self.known[name] = matmul(self.frame(base, item, (*asked, name)), self.pose(own))
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

    def child(self, item: Element) -> str:
        return self.word(item, "child") if item.tag == "joint" else ""

    def word(self, item: Element, tag: str) -> str:
        found = item.the(tag)
        return found.text.strip() or found.fail("says nothing")
