"""Geoms of MJCF as shapes to draw, as MuJoCo compiled them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np

from ..products import matmul
from ..shapes import Sphere
from .looks import Look
from .robot import Array, placed, rotation_of

SHOWN = 3
"""MuJoCo's own viewer shows geoms of the groups below this; the others are forms for contacts, usually."""


def looks_of(mujoco: Any, model: Any, link: Callable[[int], str]) -> tuple[list[Look], Counter[str]]:
    """Shapes of the geoms that are seen, of a body without any those of all its geoms; and by their kind how many have
    no shape. `link` names a body."""
    found: list[Look] = []
    lost: Counter[str] = Counter()
    bodies = np.asarray(model.geom_bodyid)
    seen = np.array([_is_seen(model, i) for i in range(model.ngeom)], dtype=bool)
    for body in np.unique(bodies):
        own = np.flatnonzero(bodies == body)
        own = own[seen[own]] if seen[own].any() else own
        for i in own.tolist():
            kind = str(mujoco.mjtGeom(int(model.geom_type[i])).name).rpartition("_")[2].lower()
            pose = placed(model.geom_pos[i], rotation_of(model.geom_quat[i]))
            shapes = _shapes(kind, model, i)
            lost.update([kind] if not shapes else [])
            found += [Look(link(int(body)), matmul(pose, placed(at, np.eye(3))), shape) for at, shape in shapes]
    return found, lost


def _is_seen(model: Any, i: int) -> bool:
    """Whether its group is shown and it is not transparent altogether."""
    material = int(model.geom_matid[i])
    alpha = model.geom_rgba[i, 3] if material < 0 else model.mat_rgba[material, 3]
    return bool(model.geom_group[i] < SHOWN and alpha > 0.0)


def _shapes(kind: str, model: Any, i: int) -> list[tuple[Array, dict[str, Any]]]:
    """Solids, each with the place of its centre in the frame of the geom."""
    radius, half, _ = size = model.geom_size[i].tolist()
    middle = np.zeros(3)
    if kind == "sphere":
        return [(middle, {"kind": "ball", "radius": radius})]
    if kind == "box":
        return [(middle, {"kind": "box", "size": [2.0 * x for x in size]})]
    if kind in ("cylinder", "capsule"):
        ends = [np.array([0.0, 0.0, z]) for z in (-half, half)] if kind == "capsule" else []
        tube = [(middle, {"kind": "cylinder", "radius": radius, "length": 2.0 * half})]
        return tube + [(end, {"kind": "ball", "radius": radius}) for end in ends]
    if kind == "ellipsoid":
        points, faces = Sphere(1.0).skin
        return [(middle, {"kind": "mesh", "points": points * size, "faces": faces})]
    mesh = int(model.geom_dataid[i])
    if kind not in ("mesh", "sdf") or mesh < 0:
        return []  # planes and height fields
    first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    start, number = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
    points, faces = model.mesh_vert[first : first + count], model.mesh_face[start : start + number]
    return [(middle, {"kind": "mesh", "points": points.astype(float), "faces": faces.astype(int)})]
