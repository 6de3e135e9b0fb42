"""Appearance of the links of a robot, as shapes that `partita.viewer` draws: boxes, cylinders, balls and files of
meshes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import MissingDependencyError
from ..extras import wanted
from ..products import matmul, nearest_rotation
from .reading import Remark
from .request import Request

Array = NDArray[np.float64]

MESHES = (".stl", ".obj", ".glb", ".gltf", ".dae")


@dataclass
class Look:
    """A shape, and its frame in a link."""

    link: str
    pose: Array
    shape: dict[str, Any]


def mesh_file(request: Request, model: Path, name: str) -> tuple[Path | None, str]:
    """The mesh file that a model refers to, or None and the reason; `Request.found` says where it may lie."""
    ending = Path(name).suffix.lower()
    if ending not in MESHES:
        return None, f"meshes are read from {', '.join(MESHES)}, not {ending or 'a file without an ending'}"
    if ending == ".dae":
        try:
            wanted(("collada",), "meshes", "drawing COLLADA")
        except MissingDependencyError as error:  # how a robot looks does not decide whether it is read
            return None, error.message
    found, why = request.found(model, name)
    if found is not None and not found.is_file():
        return None, "it is a folder"
    return found, why


def shapes_of(robot: Any, root: str | None) -> dict[str, list[dict[str, Any]]]:
    """Shapes by the name of their body, in its axes; those of links that became frames, or the ground, are moved
    there."""
    found: dict[str, list[dict[str, Any]]] = {}
    lost: list[str] = []
    for look in robot.looks:
        link, pose = look.link, look.pose
        if not _has_size(look.shape):
            robot.reading.dropped.append(
                Remark(None, f"a {look.shape['kind']} that has no size", f'link "{link}"', "looks")
            )
            continue
        if link not in robot.links and link != root:
            if link not in robot.frames:
                lost.append(link)
                continue
            link, frame = robot.frames[link]
            pose = matmul(frame, pose)
        body = "ground" if link == root else link
        found.setdefault(body, []).append(_placed(look.shape, pose))
    if found:
        robot.reading.used.append(Remark(None, f"{sum(map(len, found.values()))} shapes to draw"))
    if lost:
        gone = (Remark(None, "shapes of a body that is not there", link, "looks") for link in dict.fromkeys(lost))
        robot.reading.dropped += gone
    return found


def _placed(shape: dict[str, Any], pose: Array) -> dict[str, Any]:
    axes = nearest_rotation(pose[:3, :3]).T  # products of many rotations carry some round-off
    center = [float(x) for x in pose[:3, 3]]
    if shape["kind"] == "cylinder":
        return {**shape, "center": center, "axis": axes[2].tolist()}
    return (
        {**shape, "center": center} if shape["kind"] == "ball" else {**shape, "center": center, "axes": axes.tolist()}
    )


def _has_size(shape: dict[str, Any]) -> bool:
    """Whether its size is positive in every direction. A mesh may be mirrored."""
    sizes = [*shape.get("size", ()), *(shape[word] for word in ("radius", "length") if word in shape)]
    return all(size > 0.0 for size in sizes) and 0.0 not in shape.get("scale", ())
