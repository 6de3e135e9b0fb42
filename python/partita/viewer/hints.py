"""Drawing hints given by the user: solids instead of rods, and points whose paths are traced."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from os import PathLike
from typing import Any, NoReturn, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError, FileFormatError, MissingDependencyError, MissingFileError
from ..naming import index_of
from ..numeric import shown
from ..shapes import Shape, drawn
from ..shapes.triangles import FEWEST_TRIANGLES, MOST_TRIANGLES, load, simplified
from ..tolerance import EQUAL_IN_SIX_DIGITS

T = TypeVar("T")
FloatArray = NDArray[np.float64]

ORIGIN, ALONG_Z = (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)
UPRIGHT = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))

SOLIDS: dict[str, dict[str, Any]] = {
    # kind: its words; None where one must be given
    "box": {"size": None, "center": ORIGIN, "axes": UPRIGHT},
    "cylinder": {"radius": None, "length": None, "center": ORIGIN, "axis": ALONG_Z},
    "wheel": {"radius": None, "length": None, "center": ORIGIN, "axis": ALONG_Z},
    "ball": {"radius": None, "center": ORIGIN},
    "plate": {"points": None},
    "rod": {"start": None, "end": None},
    "mesh": {"file": None, "scale": (1.0, 1.0, 1.0), "center": ORIGIN, "axes": UPRIGHT},
}
TRIANGLES: dict[str, Any] = {"points": None, "faces": None, "scale": (1.0, 1.0, 1.0), "center": ORIGIN, "axes": UPRIGHT}
"""Words of a mesh that is given itself."""


def solids(shapes: Any, bodies: Sequence[str]) -> dict[int, list[dict[str, Any]]]:
    """Solids by the number of their body, -1 the ground; for the form of `shapes` see `partita.viewer.html`."""
    if shapes is None:
        return {}
    if not isinstance(shapes, Mapping):
        _fail("shapes", f"must be a mapping from names of bodies to shapes, not {shown(shapes)}")
    found: dict[int, list[dict[str, Any]]] = {}
    for name, given in shapes.items():
        several = given if isinstance(given, list | tuple) else [given]
        if not several:
            _fail("shapes", f"of {name!r} is empty: leave the body out, or give a shape")
        found[_body(name, bodies)] = [part for one in several for part in _parts(name, one)]
    _load_meshes([part for parts in found.values() for part in parts if "file" in part or "scale" in part])
    return found


def looking(
    shapes: Mapping[str, Any] | None, looks: Mapping[str, Any] | None, draw: Callable[[Mapping[str, Any] | None], T]
) -> T:
    """What `draw` makes of the shapes that are given, else of the `looks` of a file; where these cannot be read, of
    none, with a warning."""
    if shapes is not None or not looks:
        return draw(shapes)
    try:
        return draw(looks)
    except (FileFormatError, MissingFileError, MissingDependencyError) as error:
        warnings.warn(f"it is drawn without the looks of its file: {error.message}", stacklevel=4)
        return draw(None)


def stored(bodies: Mapping[int, Any]) -> dict[int, list[dict[str, Any]]]:
    """Solids of bodies as `form` made them, which may be out of a stored run: files are not opened. Raises `ValueError`
    for others."""
    found: dict[int, list[dict[str, Any]]] = {}
    meshes: list[tuple[dict[str, Any], Mapping[str, Any]]] = []
    for body, parts in bodies.items():
        if not isinstance(parts, list) or not all(isinstance(part, Mapping) and "file" not in part for part in parts):
            raise ValueError("a body is drawn as a list of solids, none of them in a file")
        try:
            found[body] = [_solid("a body", {w: x for w, x in part.items() if w not in KEPT}) for part in parts]
        except ArgumentError as error:
            raise ValueError(error.message) from error
        meshes += [both for both in zip(found[body], parts, strict=True) if both[0]["kind"] == "mesh"]
    _load_meshes([part for part, _ in meshes])
    for part, given in meshes:
        whole = given.get("closed") is True and 3 * part["of"] == len(part["faces"])
        part |= {"closed": whole, "of": max(part["of"], int(given.get("of", 0)))}
    return found


KEPT = ("of", "closed")
"""Of a mesh that is drawn: of how many triangles, and whether none is seen from behind."""


def _parts(name: Any, given: Any) -> list[dict[str, Any]]:
    """The solids of a shape, or the one that is given."""
    return form(given) if isinstance(given, Shape) else [_solid(name, given)]


def form(shape: Shape) -> list[dict[str, Any]]:
    """The solids of a shape, with no more triangles than a page can draw."""
    found = drawn(shape)
    for part in found:
        if part["kind"] == "mesh" and len(part["faces"]) > 3 * MOST_TRIANGLES:
            points, faces = np.reshape(part["points"], (-1, 3)), np.reshape(part["faces"], (-1, 3))
            corners, triangles = simplified(points, faces, MOST_TRIANGLES)
            part |= {"points": corners.ravel().tolist(), "faces": triangles.ravel().tolist(), "closed": False}
    return found


def _load_meshes(parts: list[dict[str, Any]]) -> None:
    """Replace the names of mesh files by vertices and triangles, reduced if there are too many to draw in total."""
    whole = [load(part.pop("file"))[:2] if "file" in part else (part["points"], part["faces"]) for part in parts]
    left, most = MOST_TRIANGLES, {}
    for count, n in enumerate(sorted(range(len(whole)), key=lambda n: len(whole[n][1]))):
        # triangles that small meshes do not need are left to large ones
        most[n] = max(FEWEST_TRIANGLES, left // (len(whole) - count))
        left -= min(most[n], len(whole[n][1]))
    for n, (part, (points, faces)) in enumerate(zip(parts, whole, strict=True)):
        corners, triangles = simplified(points, faces, most[n])
        placed = (corners * part.pop("scale")) @ np.array(part.pop("axes")) + part.pop("center")
        part |= {
            "points": [float(f"{x:.6g}") for x in placed.ravel()],
            "faces": triangles.ravel().tolist(),
            "of": len(faces),
        }


def traced(points: Any, bodies: Sequence[str]) -> list[dict[str, Any]]:
    """Points to mark and trace, each with name, body and place in body axes."""
    if points is None:
        return []
    if not isinstance(points, Mapping):
        _fail("points", f"must be a mapping from names to (body, point), not {shown(points)}")
    found = []
    for name, given in points.items():
        if not isinstance(name, str) or not name:
            _fail("points", f"must have names that are text, not {shown(name)}")
        if not isinstance(given, tuple | list) or len(given) != 2:
            _fail("points", f"{name!r} must be (body, point in body axes), not {shown(given)}")
        where = _vector("points", f"{name!r}", given[1])
        found.append({"name": name, "body": _body(given[0], bodies), "at": where})
    return found


def _body(name: Any, bodies: Sequence[str]) -> int:
    name = getattr(name, "name", name)
    known = [*bodies, "ground"]
    i = index_of(name, known, "body")
    return -1 if i == len(bodies) else i


def _solid(name: Any, given: Any) -> dict[str, Any]:
    of = f"of {name!r}"
    if not isinstance(given, Mapping) or given.get("kind") not in SOLIDS:
        _fail(
            "shapes",
            f'{of} must be a value of partita.shapes, or {{"kind": ...}} with one of {", ".join(SOLIDS)}, not '
            f"{shown(given)}",
        )
    words = TRIANGLES if given["kind"] == "mesh" and "points" in given else SOLIDS[given["kind"]]
    unknown = [str(word) for word in given if word != "kind" and word not in words]
    if unknown:
        _fail("shapes", f"{of}: {', '.join(unknown)} is no word of a {given['kind']}; known: {', '.join(words)}")
    found: dict[str, Any] = {"kind": given["kind"]}
    for word, usual in words.items():
        value = given.get(word, usual)
        what = f"{of}: {word}"
        if value is None:
            _fail("shapes", f"{what} is missing; a {given['kind']} has {', '.join(words)}")
        if word in ("radius", "length"):
            found[word] = _positive(what, value)
        elif word == "file":
            if not isinstance(value, str | PathLike):
                _fail("shapes", f"{what} must be the name of a file, not {shown(value)}")
            found[word] = value
        elif word == "scale":
            found[word] = _vector("shapes", what, np.broadcast_to(value, 3) if np.ndim(value) == 0 else value)
            if 0.0 in found[word]:
                _fail("shapes", f"{what} must not be 0")
        elif word == "axes":
            found[word] = _axes(what, value)
        elif word == "points":
            found[word] = _corners(what, value) if given["kind"] == "mesh" else _ring(what, value)
        elif word == "faces":
            found[word] = _triangles(what, value, len(found["points"]))
        else:
            found[word] = _vector("shapes", what, value)
    if given["kind"] == "box" and min(found["size"]) <= 0.0:
        _fail("shapes", f"{of}: size must be three positive lengths [m], not {shown(given['size'])}")
    if "axis" in found:
        size = float(np.linalg.norm(found["axis"]))
        if size == 0.0:
            _fail("shapes", f"{of}: axis must have a length")
        found["axis"] = [x / size for x in found["axis"]]
    return found


def _positive(what: str, value: Any) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = np.nan
    if isinstance(value, bool) or not np.isfinite(number) or number <= 0.0:
        _fail("shapes", f"{what} must be a positive length [m], not {shown(value)}")
    return number


def _numbers(value: Any) -> FloatArray:
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        return np.full(0, np.nan)
    return array


def _vector(argument: str, what: str, value: Any) -> list[float]:
    array = _numbers(value)
    if array.shape != (3,) or not np.isfinite(array).all():
        _fail(argument, f"{what} must be three finite numbers in body axes [m], not {shown(value)}")
    return [float(x) for x in array]


def _axes(what: str, value: Any) -> list[list[float]]:
    """Directions x, y, z of a box or a mesh, in body axes."""
    array = _numbers(value)
    known = array.shape == (3, 3) and np.isfinite(array).all()
    if not known or np.abs(array @ array.T - np.eye(3)).max() > EQUAL_IN_SIX_DIGITS:
        wanted = "three unit vectors perpendicular to each other, in body axes"
        _fail("shapes", f"{what} must be {wanted}, not {shown(value)}")
    return [[float(x) for x in direction] for direction in array]


def _ring(what: str, value: Any) -> list[list[float]]:
    array = _numbers(value)
    if array.ndim != 2 or array.shape[1] != 3 or len(array) < 3 or not np.isfinite(array).all():
        _fail("shapes", f"{what} must be three or more points of three finite numbers, around the plate")
    return [[float(x) for x in point] for point in array]


def _corners(what: str, value: Any) -> FloatArray:
    """Of a mesh: (n, 3), or one number after the other."""
    array = _numbers(value)
    array = array.reshape(-1, 3) if array.ndim == 1 and len(array) % 3 == 0 else array
    if array.ndim != 2 or array.shape[1] != 3 or len(array) < 3 or not np.isfinite(array).all():
        _fail("shapes", f"{what} must be three or more points of three finite numbers")
    return array


def _triangles(what: str, value: Any, count: int) -> NDArray[np.int_]:
    """Of a mesh with so many points: (m, 3), or one number after the other."""
    array = _numbers(value)
    array = array.reshape(-1, 3) if array.ndim == 1 and len(array) % 3 == 0 else array
    if array.ndim != 2 or array.shape[1] != 3 or len(array) < 1 or not ((array >= 0) & (array < count)).all():
        _fail("shapes", f"{what} must be triangles, each of three numbers of points, from 0 to {count - 1}")
    return array.astype(int)


def _fail(argument: str, why: str) -> NoReturn:
    raise ArgumentError(f"{argument} {why}", argument=argument)
