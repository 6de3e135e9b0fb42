"""Meshes from STL, OBJ and glTF files, reduced to as many triangles as a page can draw."""

from __future__ import annotations

import io
import os
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError, FileFormatError
from ..extras import extra
from ..files import get
from ..tolerance import SINGLE

FloatArray = NDArray[np.float64]

ENDINGS = (".stl", ".obj", ".glb", ".gltf")
MOST_TRIANGLES = 6000
"""For all meshes of a page together: the number a browser can draw between two frames without a graphics card."""
FEWEST_TRIANGLES = 200


def load(path: str | os.PathLike[str]) -> tuple[FloatArray, NDArray[np.int_]]:
    """Vertices (n, 3) and triangles (m, 3) of a mesh file, all parts in their positions, in units of the file.

    Nothing but the file is read, and of glTF with its data beside it those files of the same folder and below.

    Raises `MissingFileError` for a file that is not there, `FileFormatError` for one that holds no mesh,
    `ArgumentError` for another ending, `MissingDependencyError` without `trimesh`.
    """
    where = Path(path)
    ending = where.suffix.lower()
    if ending not in ENDINGS:
        raise ArgumentError(f'the mesh "{where}" must end in one of {", ".join(ENDINGS)}', argument="shapes")
    content = get(where, "mesh_bytes")
    trimesh = extra("trimesh", "meshes", "drawing a mesh")
    options: dict[str, Any] = {"skip_materials": True} if ending in (".obj", ".gltf", ".glb") else {}
    beside = _resolver(trimesh, where.parent)
    try:
        scene = trimesh.load_scene(io.BytesIO(content), file_type=ending[1:], resolver=beside, **options)
        mesh = scene.to_mesh()
        points, faces = np.asarray(mesh.vertices, dtype=float), np.asarray(mesh.faces, dtype=int)
    except (FileFormatError, MemoryError):
        raise
    except Exception as error:  # the parser raises different exceptions for different formats
        raise FileFormatError(
            f'the mesh "{where}" cannot be read: {error or type(error).__name__}', path=str(where)
        ) from error
    if len(faces) == 0 or not np.isfinite(points).all():
        raise FileFormatError(f'the mesh "{where}" contains no triangle with finite vertices', path=str(where))
    return points, faces


def _resolver(trimesh: Any, folder: Path) -> Any:
    """Provides the files that a glTF refers to, if they are in its folder or below."""

    class Beside(trimesh.resolvers.Resolver):  # type: ignore[misc]
        def __init__(self) -> None:
            pass

        def get(self, name: str) -> bytes:
            return get(inside(folder, name), "mesh_bytes")

        def namespaced(self, namespace: str) -> Any:
            return self

        def keys(self) -> list[str]:
            return []

        def write(self, name: str, data: Any) -> None:
            raise FileFormatError(f'"{name}" is not written: only the mesh itself is read', path=name)

    return Beside()


def inside(folder: Path, name: str) -> Path:
    """A file in a folder or below, named by an untrusted file; files elsewhere are refused."""
    root = folder.resolve()
    found = (root / name).resolve()
    if not found.is_relative_to(root):
        raise FileFormatError(f'"{name}" lies outside the folder "{folder}"; it is not read', path=str(folder))
    return found


def simplified(points: FloatArray, faces: NDArray[np.int_], most: int) -> tuple[FloatArray, NDArray[np.int_]]:
    """The same with at most `most` triangles: vertices in one cell of a grid are merged at their centroid."""
    points, faces = _clustered(points, faces, SINGLE)
    cells = 4.0 * np.sqrt(most)
    while len(faces) > most:
        points_, faces_ = _clustered(points, faces, 1.0 / cells)
        if len(faces_) <= most:
            return points_, faces_
        cells *= 0.85
    return points, faces


def _clustered(points: FloatArray, faces: NDArray[np.int_], cell: float) -> tuple[FloatArray, NDArray[np.int_]]:
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
