"""Triangles of STL, OBJ, glTF, COLLADA and STEP files, reduced to as many as a page can draw."""

from __future__ import annotations

import hashlib
import io
import os
import warnings
from pathlib import Path
from typing import Any
from xml.parsers import expat

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError, FileFormatError, PartitaError
from ..extras import extra
from ..files import get
from ..limits import exceeded
from ..tolerance import SINGLE

FloatArray = NDArray[np.float64]
Faces = NDArray[np.int_]

ENDINGS = (".stl", ".obj", ".glb", ".gltf", ".dae", ".step", ".stp")
_CAD = (".iges", ".igs", ".sldprt", ".ipt", ".catpart", ".prt", ".fcstd", ".x_t", ".x_b", ".3dm")
"""Other files of CAD programs, whose surfaces are no triangles."""
_TURN = 0.03
"""Triangles on curved faces of STEP turn by no more from one to the next. Scale: rad. Reason: the volume of a shaft
is right to 4e-5."""
_SAG = 1e-3
"""They deviate from edges by no more. Scale: fraction of the length of an edge. Reason: less than by their turn."""
MOST_TRIANGLES = 6000
"""For all meshes of a page together: the number a browser can draw between two frames without a graphics card."""
FEWEST_TRIANGLES = 200


def load(path: str | os.PathLike[str], argument: str = "shapes") -> tuple[FloatArray, Faces, str]:
    """Vertices (n, 3) and triangles (m, 3) of a mesh file as it has them, all parts in their positions, in units of the
    file, those of COLLADA and STEP in metres; and the SHA-256 of what was read.

    Nothing but the file is read, and of glTF with its data beside it those files of the same folder and below.

    Raises `MissingFileError` for a file that is not there, `FileFormatError` for one that holds no mesh,
    `ArgumentError` for another ending, `MissingDependencyError` without `trimesh`, for COLLADA without `pycollada`,
    for STEP without `cascadio`.
    """
    where = Path(path)
    ending = where.suffix.lower()
    if ending not in ENDINGS:
        about = f'the mesh "{where}" must end in one of {", ".join(ENDINGS)}'
        if ending in _CAD:
            about += f"; {ending} has surfaces of a CAD program: export the part as STEP or STL there"
        raise ArgumentError(about, argument=argument)
    content = get(where, "mesh_bytes")
    kept = hashlib.sha256(content)
    read = {".dae": _collada, ".step": _step, ".stp": _step}.get(ending, _by_trimesh)
    try:
        points, faces = read(where, content, kept)
    except (PartitaError, MemoryError):
        raise
    except Exception as error:  # the parsers raise different exceptions for different formats
        raise FileFormatError(
            f'the mesh "{where}" cannot be read: {error or type(error).__name__}', path=str(where)
        ) from error
    if len(faces) == 0 or not np.isfinite(points).all():
        raise FileFormatError(f'the mesh "{where}" contains no triangle with finite vertices', path=str(where))
    return points, faces, kept.hexdigest()


def _by_trimesh(where: Path, content: bytes, kept: Any) -> tuple[FloatArray, Faces]:
    trimesh, ending = extra("trimesh", "meshes", "reading a mesh"), where.suffix.lower()
    options: dict[str, Any] = {} if ending == ".stl" else {"skip_materials": True}
    beside = _resolver(trimesh, where.parent, kept)
    scene = trimesh.load_scene(io.BytesIO(content), file_type=ending[1:], resolver=beside, process=False, **options)
    mesh = scene.to_mesh()
    return np.asarray(mesh.vertices, dtype=float), np.asarray(mesh.faces, dtype=int)


def _resolver(trimesh: Any, folder: Path, kept: Any) -> Any:
    """Provides the files that a glTF refers to, if they are in its folder or below."""

    class Beside(trimesh.resolvers.Resolver):  # type: ignore[misc]
        def __init__(self) -> None:
            pass

        def get(self, name: str) -> bytes:
            content = get(inside(folder, name), "mesh_bytes")
            kept.update(content)
            return content

        def namespaced(self, namespace: str) -> Any:
            return self

        def keys(self) -> list[str]:
            return []

        def write(self, name: str, data: Any) -> None:
            raise FileFormatError(f'"{name}" is not written: only the mesh itself is read', path=name)

    return Beside()


def _step(where: Path, content: bytes, kept: Any) -> tuple[FloatArray, Faces]:
    """The solids of a STEP file in metres; OpenCASCADE makes triangles of them, and names no other file."""
    cascadio = extra("cascadio", "step", "reading STEP")
    made = cascadio.to_glb_bytes(content, tol_linear=_SAG, tol_angular=_TURN, tol_relative=True)
    if not made:
        raise FileFormatError(f'the file "{where}" is not STEP, or contains no solid', path=str(where))
    return _by_trimesh(where.with_suffix(".glb"), made, kept)


def _collada(where: Path, content: bytes, kept: Any) -> tuple[FloatArray, Faces]:
    """The triangles of the scene in metres, its axes as they are: URDF and SDFormat take no notice of `up_axis`."""
    collada = extra("collada", "meshes", "reading COLLADA")
    _plain_xml(where, content)
    points, faces, count = [], [], 0
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PendingDeprecationWarning)  # it uses NumPy's matrices
        # what else is in the file, its materials and images, decides nothing
        document = collada.Collada(io.BytesIO(content), ignore=[collada.DaeError])
        if document.scene is None:
            raise FileFormatError(f'the mesh "{where}" has no scene', path=str(where))
        for part in (one for found in document.scene.objects("geometry") for one in found.primitives()):
            if hasattr(part, "triangleset"):
                part = part.triangleset()
            if not hasattr(part, "ntriangles") or part.vertex is None:
                continue  # lines and points
            points.append(np.asarray(part.vertex, dtype=float))
            faces.append(np.asarray(part.vertex_index, dtype=int).reshape(-1, 3) + count)
            count += len(points[-1])
    if not faces:
        return np.zeros((0, 3)), np.zeros((0, 3), dtype=int)
    unit = document.assetInfo.unitmeter
    return np.concatenate(points) * (1.0 if unit is None else float(unit)), np.concatenate(faces)


class _Refused(Exception):
    """Why a text is not passed on."""


def _plain_xml(where: Path, content: bytes) -> None:
    """Refuse what is not plain XML of bounded size: archives, document types, trees too deep or too large."""
    parser = expat.ParserCreate()
    count = depth = 0

    def begin(*_: object) -> None:
        nonlocal count, depth
        count, depth = count + 1, depth + 1
        for limit, found in (("elements", count), ("depth", depth)):
            if (words := exceeded(limit, found)) is not None:
                raise _Refused(f"it has {words}")

    def end(_: object) -> None:
        nonlocal depth
        depth -= 1

    def doctype(*_: object) -> None:
        raise _Refused("a document type (<!DOCTYPE ...>) is not read: it may define entities")

    parser.StartElementHandler, parser.EndElementHandler = begin, end
    parser.StartDoctypeDeclHandler = doctype
    try:
        content.decode("utf-8")
        parser.Parse(content, True)
    except UnicodeDecodeError as error:
        raise FileFormatError(f'the mesh "{where}" is not UTF-8: {error.reason}', path=str(where)) from error
    except expat.ExpatError as error:
        what = f"not well-formed XML: {expat.ErrorString(error.code)}, line {error.lineno}"
        raise FileFormatError(f'the mesh "{where}" is {what}', path=str(where)) from error
    except _Refused as error:
        raise FileFormatError(f'the mesh "{where}" cannot be read: {error}', path=str(where)) from error


def inside(folder: Path, name: str) -> Path:
    """A file in a folder or below, named by an untrusted file; files elsewhere are refused."""
    root = folder.resolve()
    found = (root / name).resolve()
    if not found.is_relative_to(root):
        raise FileFormatError(f'"{name}" lies outside the folder "{folder}"; it is not read', path=str(folder))
    return found


def simplified(points: FloatArray, faces: Faces, most: int) -> tuple[FloatArray, Faces]:
    """The same with at most `most` triangles: vertices in one cell of a grid are merged at their centroid."""
    points, faces = _clustered(points, faces, SINGLE)
    cells = 4.0 * np.sqrt(most)
    while len(faces) > most:
        points_, faces_ = _clustered(points, faces, 1.0 / cells)
        if len(faces_) <= most:
            return points_, faces_
        cells *= 0.85
    return points, faces


def _clustered(points: FloatArray, faces: Faces, cell: float) -> tuple[FloatArray, Faces]:
    """Vertices merged by cells of a grid, `cell` relative to the extent; triangles that become lines, or duplicates,
    are removed."""
    extent = float(np.ptp(points, axis=0).max()) or 1.0
    keys = np.floor((points - points.min(axis=0)) / (cell * extent)).astype(np.int64)
    _, of = np.unique(keys, axis=0, return_inverse=True)
    of = of.ravel()
    count = np.bincount(of)
    middle = np.stack([np.bincount(of, points[:, k]) / count for k in range(3)], axis=1)
    corners = of[faces]
    whole = (corners[:, 0] != corners[:, 1]) & (corners[:, 1] != corners[:, 2]) & (corners[:, 2] != corners[:, 0])
    corners = corners[whole]
    _, once = np.unique(np.sort(corners, axis=1), axis=0, return_index=True)
    corners = corners[np.sort(once)]
    used, renumbered = np.unique(corners, return_inverse=True)
    return middle[used], renumbered.reshape(corners.shape)
