"""A planar drawing as the page sends it: points, bars, slides, motors and springs, read as data and checked."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ..errors import ArgumentError
from ..numeric import shown

MOST = 100
"""Elements of one kind in a drawing."""
LARGEST_DRAWN = 1e6
"""Numbers of a drawing are not larger. Scale: SI units. Reason: a page shows a thousand kilometres."""
NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9 _-]{0,39}")


@dataclass(frozen=True)
class Node:
    """A point of the drawing [m]: bars that meet in it are pinned, to the ground where it is `ground`."""

    id: int
    name: str
    x: float
    y: float
    ground: bool


@dataclass(frozen=True)
class Bar:
    """A rigid rod from node `a` to node `b`, with further nodes `more` on it. `length` [m]: its own, where it is to
    differ from the distance drawn."""

    id: int
    name: str
    a: int
    b: int
    more: tuple[int, ...]
    mass: float
    length: float | None


@dataclass(frozen=True)
class Slide:
    """A block at a node that slides on the ground along `angle` [rad], or along a bar."""

    id: int
    name: str
    node: int
    along: int | None
    angle: float
    mass: float


@dataclass(frozen=True)
class Motor:
    """A constant rate of the joint of `bar` at a node [rad/s], or of the slide there [m/s]."""

    id: int
    name: str
    node: int
    bar: int | None
    rate: float


@dataclass(frozen=True)
class Spring:
    """A spring with a damper between two nodes; `length` [m]: None where it is unloaded as drawn."""

    id: int
    name: str
    a: int
    b: int
    stiffness: float
    damping: float
    length: float | None


@dataclass(frozen=True)
class Drawing:
    """A planar mechanism in the x-y plane; `gravity` [m/s^2] acts along -y."""

    gravity: float
    nodes: tuple[Node, ...]
    bars: tuple[Bar, ...]
    slides: tuple[Slide, ...]
    motors: tuple[Motor, ...]
    springs: tuple[Spring, ...]


EMPTY: dict[str, Any] = {"gravity": 9.81, "nodes": [], "bars": [], "slides": [], "motors": [], "springs": []}


def drawing_of(data: Any) -> Drawing:
    """A drawing from plain data, as JSON carrying it.

    Raises `ArgumentError` with the element and what is wrong with it: nothing is taken that does not fit.
    """
    top = _Table("drawing", data, EMPTY)
    nodes = tuple(
        Node(x.id(), x.name(), x.number("x"), x.number("y"), x.flag("ground"))
        for x in _list(top, "nodes", ("id", "name", "x", "y", "ground"))
    )
    points = {node.id for node in nodes}
    bars = tuple(
        Bar(
            x.id(),
            x.name(),
            x.one_of("a", points),
            x.one_of("b", points),
            x.some_of("more", points),
            x.number("mass", above=0.0),
            x.maybe("length", above=0.0),
        )
        for x in _list(top, "bars", ("id", "name", "a", "b", "more", "mass", "length"))
    )
    rods = {bar.id for bar in bars}
    slides = tuple(
        Slide(
            x.id(),
            x.name(),
            x.one_of("node", points),
            x.one_of("along", rods) if x["along"] is not None else None,
            x.number("angle"),
            x.number("mass", above=0.0),
        )
        for x in _list(top, "slides", ("id", "name", "node", "along", "angle", "mass"))
    )
    motors = tuple(
        Motor(
            x.id(),
            x.name(),
            x.one_of("node", points),
            x.one_of("bar", rods) if x["bar"] is not None else None,
            x.number("rate"),
        )
        for x in _list(top, "motors", ("id", "name", "node", "bar", "rate"))
    )
    springs = tuple(
        Spring(
            x.id(),
            x.name(),
            x.one_of("a", points),
            x.one_of("b", points),
            x.number("stiffness", least=0.0),
            x.number("damping", least=0.0),
            x.maybe("length", least=0.0),
        )
        for x in _list(top, "springs", ("id", "name", "a", "b", "stiffness", "damping", "length"))
    )
    made = Drawing(top.number("gravity"), nodes, bars, slides, motors, springs)
    elements = [element for table in (nodes, bars, slides, motors, springs) for element in table]
    for what in ("id", "name"):
        seen = set[Any]()
        for element in elements:
            key = getattr(element, what)
            if key in seen:
                raise ArgumentError(f"drawing: two elements have the {what} {shown(key)}", argument="drawing")
            seen.add(key)
    return made


class _Table:
    """An object of JSON that has exactly the keys that it may have."""

    def __init__(self, where: str, data: Any, keys: Any) -> None:
        self.where, self.data = where, data
        if not isinstance(data, Mapping) or set(data) != set(keys):
            self.fail(f"must be an object with the keys {', '.join(keys)}")

    def fail(self, why: str) -> Any:
        raise ArgumentError(f"{self.where}: {why}", argument="drawing")

    def __getitem__(self, key: str) -> Any:
        return self.data[key]

    def id(self) -> int:
        found = self.data["id"]
        if isinstance(found, bool) or not isinstance(found, int) or not 0 < found < 10**9:
            self.fail(f"id is {shown(found)}; it must be a positive integer")
        return int(found)

    def name(self) -> str:
        found = self.data["name"]
        if not isinstance(found, str) or not NAME.fullmatch(found) or found.strip() != found or found == "ground":
            self.fail(
                f"name is {shown(found)}; it must be 1 to 40 letters, digits, spaces, hyphens or underscores, and not "
                '"ground"'
            )
        return str(found)

    def flag(self, key: str) -> bool:
        if not isinstance(self.data[key], bool):
            self.fail(f"{key} is {shown(self.data[key])}; it must be true or false")
        return bool(self.data[key])

    def number(self, key: str, above: float = -math.inf, least: float = -math.inf) -> float:
        found = self.data[key]
        if isinstance(found, bool) or not isinstance(found, int | float) or not abs(found) <= LARGEST_DRAWN:
            self.fail(f"{key} is {shown(found)}; it must be a number of at most {LARGEST_DRAWN:g}")
        if not (found > above and found >= least):
            low = f"above {above:g}" if above > least else f"at least {least:g}"
            self.fail(f"{key} is {shown(found)}; it must be {low}")
        return float(found)

    def maybe(self, key: str, above: float = -math.inf, least: float = -math.inf) -> float | None:
        return None if self.data[key] is None else self.number(key, above, least)

    def one_of(self, key: str, known: set[int]) -> int:
        found = self.data[key]
        if isinstance(found, bool) or not isinstance(found, int) or found not in known:
            self.fail(f"{key} is {shown(found)}, which is no element of this drawing")
        return int(found)

    def some_of(self, key: str, known: set[int]) -> tuple[int, ...]:
        found = self.data[key]
        if not isinstance(found, list) or len(found) > MOST or not all(type(x) is int and x in known for x in found):
            self.fail(f"{key} must list elements of this drawing")
        return tuple(found)


def _list(top: _Table, key: str, keys: tuple[str, ...]) -> list[_Table]:
    found = top[key]
    if not isinstance(found, list) or len(found) > MOST:
        top.fail(f"{key} must be a list of at most {MOST}")
    return [_Table(f"{key.removesuffix('s')} {i + 1}", data, keys) for i, data in enumerate(found)]
