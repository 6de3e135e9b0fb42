"""Shapes of bodies as values: discs, cylinders, boxes, balls, plates with holes, extrusions, turned parts, hollow
bodies, meshes out of files, and sums of these.

Each has its exact `volume`, `centroid` and `inertia`, closed forms all of them; `Mechanism.add_solid` makes a body of
one, and viewers draw it. Lengths are metres, or texts such as "20 mm".

>>> import partita as pt
>>> wheel = pt.shapes.Disc(radius="60 mm", thickness="8 mm")
>>> hub = pt.shapes.Cylinder(radius="12 mm", length="20 mm", inner_radius="5 mm")
>>> both = wheel - pt.shapes.Disc("12 mm", "8 mm") + hub
>>> round(7850.0 * both.volume, 4)
0.7405
"""

from __future__ import annotations

from .basic import Box, Cylinder, Disc, Sphere
from .drawn import drawn
from .extrusion import Extrusion
from .materials import MATERIALS
from .mesh import Mesh
from .plain import has_mesh, plain_of, shape_of
from .plate import Plate
from .revolution import Revolution
from .shape import Shape, Sum
from .shell import Shell

__all__ = [
    "MATERIALS",
    "Box",
    "Cylinder",
    "Disc",
    "Extrusion",
    "Mesh",
    "Plate",
    "Revolution",
    "Shape",
    "Shell",
    "Sphere",
    "Sum",
    "drawn",
    "has_mesh",
    "plain_of",
    "shape_of",
]
