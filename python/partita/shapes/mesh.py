"""Closed meshes out of files: the polyhedron that their triangles enclose."""

from __future__ import annotations

import os
import warnings
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..errors import ChangedFileWarning, FileFormatError
from ..files import place
from ..tolerance import SINGLE
from ..units import Quantity
from . import given
from .shape import Array, Moments, Shape, Skin
from .surface import Surface, components, enclosed, moments_of, near, open_edges, welded
from .triangles import load


@dataclass(frozen=True)
class Mesh(Shape):
    """The solid inside a closed mesh of a file: STL, OBJ, glTF, COLLADA or STEP; its origin and axes are those of the
    file.

    `scale` is the length of one unit of the file: "1 mm" for most STL files, 1 for glTF, COLLADA and STEP, which are in
    metres here. Curved faces of STEP become triangles that turn by 0.03 rad: masses are right to four digits.

    The mesh is checked for being closed, its triangles for being in order around the outward normal; one inside out as
    a whole is turned. Volume, centroid and inertia are exact for the polyhedron. What its parts have in common counts
    twice. Two meshes are equal where their files and scales are. `sha256` is that of the file as it was; where it has
    changed a `ChangedFileWarning` says so. Needs the extra "meshes", for STEP "step".

    Raises `FileFormatError` for a mesh that is open or encloses nothing, with the number of open edges and what to
    try; `MissingFileError`, `ArgumentError` for another kind of file, and `DescriptionError` for a scale that is not
    positive.

    >>> import tempfile
    >>> from pathlib import Path
    >>> import partita as pt
    >>> corners, faces = ["0 0 0", "30 0 0", "0 20 0", "0 0 10"], ["1 3 2", "1 2 4", "1 4 3", "2 3 4"]    # tetrahedron
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder, "part.obj")
    ...     size = file.write_text("".join([f"v {x}{chr(10)}" for x in corners] + [f"f {x}{chr(10)}" for x in faces]))
    ...     part = pt.shapes.Mesh(file, scale="1 mm")
    >>> print(f"{part.volume * 1e9:.9f} mm^3")
    1000.000000000 mm^3
    """

    word: ClassVar[str] = "mesh"
    file: str = field(compare=False)
    scale: float = 1.0
    sha256: str | None = field(default=None, repr=False)

    if TYPE_CHECKING:

        def __init__(self, file: str | os.PathLike[str], scale: Quantity = 1.0, sha256: str | None = None) -> None: ...

    def __post_init__(self) -> None:
        where = place(self.file, "file")
        scale = given.length("Mesh", "scale", self.scale)
        points, faces, digest = load(where, "file")
        if self.sha256 not in (None, digest):
            warnings.warn(
                f'the mesh "{where}" has changed since the model was saved (its SHA-256 is another one): mass, centre '
                "of mass and inertia are those of the present mesh; save the model again to keep them",
                ChangedFileWarning,
                stacklevel=4,
            )
        for word, value in (
            ("file", os.fspath(self.file)),
            ("scale", scale),
            ("sha256", digest),
            ("_found", (where.absolute(), _closed(where, scale * points, faces))),
        ):
            object.__setattr__(self, word, value)

    @property
    def where(self) -> Path:
        """The file, wherever the working folder is."""
        return Path(self._found[0])  # type: ignore[attr-defined]

    @property
    def _surface(self) -> Surface:
        return Surface(*self._found[1])  # type: ignore[attr-defined]

    def _moments(self) -> Moments:
        return Moments(*moments_of(self._surface))

    def _skin(self) -> Skin:
        return Skin(*self._surface)

    @property
    def samples(self) -> Array:  # type: ignore[override]
        """Points (n, 3) on the surface: corners and middles of edges."""
        points, faces = self._surface
        return np.concatenate([points, 0.5 * (points[faces] + points[np.roll(faces, -1, axis=1)]).reshape(-1, 3)])

    def contains(self, points: Array, margin: float = 0.0) -> NDArray[np.bool_]:
        """Whether points (n, 3) lie inside, or outside by less than `margin` [m]."""
        inside = enclosed(points, self._surface)
        if margin == 0.0:
            return inside
        beside = near(points, self._surface, abs(margin))
        return inside | beside if margin > 0.0 else inside & ~beside


def _closed(where: Path, points: Array, faces: NDArray[np.int_]) -> Surface:
    """The surface, of which each edge has a triangle on both sides that runs the other way, outwards."""

    def refuse(sentence: str) -> None:
        raise FileFormatError(f'the mesh "{where}" {sentence}', path=str(where), line=None)

    extent = float(np.ptp(points, axis=0).max())
    if not extent > 0.0:
        refuse("encloses nothing: all its corners are in one place")
    surface = welded(points, faces, 0.0)
    if sum(open_edges(surface.faces)):
        surface = welded(points, faces, SINGLE * extent)  # corners that single precision rounded apart
    ends, turned = open_edges(surface.faces)
    if ends:
        refuse(
            f"is not closed: {ends} of its edges have no triangle on the other side, so it encloses no volume. Export "
            "the part as a solid body, not as a surface, with a finer tolerance; or close its holes in MeshLab (Close "
            "Holes) or Blender (3D Print Toolbox, Make Manifold); or give add_body the mass and inertia of the CAD "
            "program"
        )
    if turned:
        refuse(
            f"has triangles that face both ways: at {turned} of its edges the two beside run in the same direction, so "
            "inside and outside are not told apart. Recalculate its normals outwards in Blender (Mesh, Normals) or "
            "MeshLab (Re-Orient all faces coherently), and export it again"
        )
    volume = moments_of(surface)[0]
    if abs(volume) <= SINGLE * extent**3 * SINGLE:
        refuse(
            "encloses no volume: its triangles are in one plane, or upon each other. Give a sheet its thickness before "
            "it is exported"
        )
    if volume < 0.0:
        surface = Surface(surface.points, surface.faces[:, ::-1])
    parts = components(surface)
    boxes = [(own.points[own.faces].min(axis=(0, 1)), own.points[own.faces].max(axis=(0, 1))) for own in parts]
    solid = [moments_of(own)[0] > 0.0 for own in parts]
    lost = [
        not any(
            other and (low <= boxes[i][0]).all() and (high >= boxes[i][1]).all()
            for other, (low, high) in zip(solid, boxes, strict=True)
        )
        for i in range(len(parts))
        if not solid[i]
    ]
    if any(lost):
        refuse(
            f"has {sum(lost)} of its {len(parts)} parts inside out, and not as hollows in others. Recalculate its "
            "normals outwards in Blender (Mesh, Normals), and export it again"
        )
    return surface
