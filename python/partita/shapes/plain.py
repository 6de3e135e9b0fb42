"""Shapes as plain data, as files have them, and back."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from ..numeric import shown
from . import given
from .basic import Box, Cylinder, Disc, Sphere
from .extrusion import Extrusion
from .mesh import Mesh
from .plate import Plate
from .revolution import Revolution
from .shape import Part, Shape, Sum
from .shell import Shell

KINDS: dict[str, type[Shape]] = {
    kind.word: kind for kind in (Disc, Cylinder, Box, Sphere, Plate, Extrusion, Revolution, Shell, Mesh)
}
"""By their word in files; sums beside them."""


def plain_of(shape: Shape, called: Callable[[Path], str] = lambda path: path.name) -> dict[str, Any]:
    """A shape as texts, numbers, lists and mappings; what has its default is left out. `called` gives the name that the
    file of a mesh has there.

    >>> from partita import shapes
    >>> shapes.plain_of(shapes.Disc(0.1, 0.01))
    {'type': 'disc', 'radius': 0.1, 'thickness': 0.01}
    """
    match shape:
        case Sum(parts):
            return {"type": "sum", "parts": [_part(part, called) for part in parts]}
        case Cylinder(radius, length, inner):
            bore = {"inner_radius": inner} if inner else {}
            return {"type": "cylinder", "radius": radius, "length": length, **bore}
        case Plate(outline, along, holes) | Extrusion(outline, along, holes):
            listed = {"holes": [_figure(hole) for hole in holes]} if holes else {}
            size = "thickness" if isinstance(shape, Plate) else "length"
            return {"type": shape.word, "outline": _figure(outline), size: along, **listed}
        case Shell(inner_shape, thickness):
            return {"type": "shell", "shape": plain_of(inner_shape, called), "thickness": thickness}
        case Mesh():
            scale = {} if shape.scale == 1.0 else {"scale": shape.scale}
            return {"type": "mesh", "file": called(shape.where), **scale, "sha256": shape.sha256}
    return {"type": shape.word, **{word: _listed(getattr(shape, word)) for word in sizes_of(shape)}}


def shape_of(plain: Mapping[str, Any], opened: Callable[[str], Path] | None = None) -> Shape:
    """The shape of plain data. `opened` gives the file of a mesh of some name; without it none is opened. Raises
    `DescriptionError` where there is none.

    >>> from partita import shapes
    >>> shapes.shape_of({"type": "box", "size": [1, 2, 3]})
    Box(size=(1.0, 2.0, 3.0))
    """
    sizes = dict(plain)
    word = sizes.pop("type", None)
    if word == "sum":
        return Sum(tuple(part for item in sizes["parts"] for part in _parts(item, opened)))
    if word not in KINDS:
        given.fail(shown(word), f"there is no such shape; it is one of {', '.join([*KINDS, 'sum'])}")
    if word in ("plate", "extrusion"):
        sizes["outline"] = _pair(sizes["outline"])
        sizes["holes"] = [_pair(hole) for hole in sizes.get("holes", ())]
    if word == "shell":
        sizes["shape"] = shape_of(sizes["shape"], opened)
    if word == "mesh":
        if opened is None:
            given.fail("Mesh", f"its file {shown(sizes['file'])} is opened only where a model file names it")
        sizes["file"] = opened(sizes["file"])
    return KINDS[word](**sizes)


def has_mesh(shape: Shape) -> bool:
    """Whether a file is needed to make it again."""
    parts = [part.shape for part in shape.parts] if isinstance(shape, Sum) else [shape]
    return any(isinstance(part, Mesh) for part in parts)


def sizes_of(shape: Any) -> tuple[str, ...]:
    """Names of its sizes."""
    return tuple(field.name for field in fields(shape))


def _part(part: Part, called: Callable[[Path], str]) -> dict[str, Any]:
    found: dict[str, Any] = {"shape": plain_of(part.shape, called)}
    if any(part.position):
        found["position"] = list(part.position)
    if not np.array_equal(part.orientation, np.eye(3)):
        found["orientation"] = _listed(part.orientation)
    return found | ({"hole": True} if part.hole else {})


def _parts(item: Mapping[str, Any], opened: Callable[[str], Path] | None) -> tuple[Part, ...]:
    """One part, as its shape is no sum."""
    placed = shape_of(item["shape"], opened).at(item.get("position", (0.0, 0.0, 0.0)), item.get("orientation"))
    hole = bool(item.get("hole", False))
    return tuple(Part(part.shape, part.position, part.orientation, part.hole != hole) for part in placed.parts)


def _figure(figure: Any) -> Any:
    """A circle as a mapping, a polygon as a list."""
    if isinstance(figure[1], float):
        return {"center": list(figure[0]), "radius": figure[1]}
    return _listed(figure)


def _pair(figure: Any) -> Any:
    return (figure["center"], figure["radius"]) if isinstance(figure, Mapping) else figure


def _listed(value: Any) -> Any:
    return [_listed(item) for item in value] if isinstance(value, tuple) else value
