"""SDFormat: links, frames and joints placed in their model or relative to each other; loops are joints like any other.

`sdf_table` lists what becomes of each element and attribute. Models stand alone, in a world, in other models, and in
files that are included (`sdf_scope`); `sdf_joints` reads what joins their links.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..errors import FileFormatError
from ..products import matmul
from . import closings
from .looks import Look, mesh_file
from .reading import Reading, Remark
from .request import Request
from .robot import Array, Link, Robot, inverse
from .sdf_joints import add_joints
from .sdf_scope import Files, Scope, walked
from .xmltree import Element, numbers, refuse

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
    root, version = walked(path, reading)
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
    files = Files(request, [path.resolve()])
    scope = Scope(robot, top, version, files, reading)
    if not scope.inner:
        if scope.missing:
            raise scope.missing[0]
        top.fail("contains 0 models")
    names = [model.element.get("name") for model in scope.inner.values()]
    robot.name = (names[0] if len(names) == 1 else top.get("name")) or path.stem
    if len(names) == 1 and not scope.named.keys() - scope.inner.keys():
        next(iter(scope.inner.values())).prefix = ""  # nothing outside the model names what is in it
    robot.poses = scope.poses
    _links(scope)
    if not scope.count():
        next(iter(scope.inner.values())).element.fail("holds no <link>")
    _check_frames(scope)
    add_joints(scope)
    _ends(scope)
    closings.close(robot)
    reading.used.append(Remark(None, f"{len(robot.links)} links, {len(robot.joints)} joints"))
    return robot


def _links(scope: Scope) -> None:
    for model in scope.all():
        for item in model.element.all("link"):
            _link(model, item)


def _link(scope: Scope, item: Element) -> None:
    name, inertial = scope.full(item.must("name")), item.first("inertial")
    where = matmul(scope.at, scope.frame(scope.keys[id(item)], item))
    for visual in item.all("visual"):
        try:
            _look(scope, "world" if scope.static else name, where if scope.static else np.eye(4), visual)
        except FileFormatError as error:  # how a robot looks does not decide whether it is read
            scope.note("dropped", visual, error.message, f'link "{name}"', "looks")
    if scope.static:
        return
    mass, pose, inertia = 1.0, np.eye(4), np.eye(3)
    if inertial is not None:
        pose = scope.pose(inertial.first("pose"))
        weight, moments = inertial.first("mass"), inertial.first("inertia")
        mass = 1.0 if weight is None else numbers(weight, "the text", weight.text, 1)[0]
        of = dict.fromkeys(("ixx", "iyy", "izz"), 1.0) | dict.fromkeys(("ixy", "ixz", "iyz"), 0.0)
        for part in moments.children if moments is not None else ():
            if part.tag in of:
                of[part.tag] = numbers(part, "the text", part.text, 1)[0]
        inertia = np.array([[of["ixx"], of["ixy"], of["ixz"]], [of["ixy"], of["iyy"], of["iyz"]],
                            [of["ixz"], of["iyz"], of["izz"]]])  # fmt: skip
        inertia = matmul(matmul(pose[:3, :3], inertia), pose[:3, :3].T)
    if inertial is None or inertial.first("mass") is None or inertial.first("inertia") is None:
        remark = "no mass or no inertia is given; the defaults of the format are 1 kg and 1 kg m^2"
        scope.note("changed", item, remark, f'link "{name}"')
    if name in scope.made.links:
        item.fail(f'has the name "{name}", which is already in use')
    floats = scope.flag(item.first("gravity"))
    scope.made.links[name] = Link(name, mass, pose[:3, 3], 0.5 * (inertia + inertia.T), item, floats)
    scope.poses[name] = where


def _look(scope: Scope, link: str, frame: Array, item: Element) -> None:
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
        file, why = mesh_file(scope.made.request, of.path, named)
        if file is None:
            scope.note("dropped", of, f"the mesh {named}: {why}", f'link "{link}"', "looks")
            return
        scale = read("scale", 3) if of.first("scale") is not None else [1.0, 1.0, 1.0]
        shape = {"kind": "mesh", "file": str(file), "scale": scale}
    if shape is None:
        scope.note("dropped", item, f"a <{of.tag}>", f'link "{link}"', "looks")
        return
    scope.made.looks.append(Look(link, matmul(frame, scope.pose(item.first("pose"))), shape))


def _check_frames(scope: Scope) -> None:
    """Refuse frames that are placed in, or attached to, what does not exist; used or not."""
    for model in scope.all():
        for item in model.element.all("frame"):
            model.frame(model.keys[id(item)], item)
            model.carrier(model.keys[id(item)], item)


def _ends(scope: Scope) -> None:
    """Frames that close loops by their names, where no joint names them; all others, where the caller names a list
    of loops. What is attached to nothing moves, as an end by its name, with the link that its pose is relative to: by
    this, programs mean where they put it."""
    listed = scope.made.request.loops is not None
    for model in scope.all():
        joined = {model.word(item, end) for item in model.element.all("joint") for end in ("parent", "child")}
        for item in model.element.all("frame"):
            name = model.keys[id(item)]
            plain = name.removesuffix(closings.AXIS)
            is_end = closings.is_closing(plain)
            if model.static or not (joined.isdisjoint((name, plain)) if is_end else listed):
                continue
            pose, of = item.first("pose"), name
            if is_end and pose is not None and not item.get("attached_to") and model.base(pose):
                of = model.base(pose)
                remark = f'attached to the model; as the end of a loop it moves with "{of}", where its pose is given'
                model.note("changed", item, remark, f'frame "{model.full(name)}"')
            link = model.carrier(of, item)
            where = np.eye(4) if link == "world" else model.poses[link]
            model.made.frames[model.full(name)] = (
                link,
                matmul(matmul(inverse(where), model.at), model.frame(name, item)),
            )
