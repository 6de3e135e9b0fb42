"""Goals of a position, by name: coordinates of joints, positions of points, positions with orientations of bodies."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..builder.checks import Element
from ..builder.compiled import CompiledModel
from ..builder.frames import as_pair, is_rotation, rotation, transform
from ..builder.measures import Coordinate
from ..errors import ArgumentError, DescriptionError, UnknownNameError
from ..naming import Names, coordinate_axes, coordinate_units, joint_units
from ..numeric import floats, shown
from ..options import si
from ..units.door import bare

Array = NDArray[np.float64]
Goal = tuple[str, str, int, int, tuple[float, ...]]
"""Name, kind, number of the coordinate, joint or body, that of the coordinate or axis in it, and numbers: the point in
body axes, or the reference of an orientation."""

Framed = Callable[[str, Any, Any], tuple[list[Goal], Any]]
"""Goals and values of a position with an orientation: `what`, key and value."""

_NOWHERE = (0.0, 0.0, 0.0)
_AXES = "xyz"


def goals_of(what: str, key: Any, model: CompiledModel) -> list[Goal]:
    """The numbers to which `key` refers: coordinates of a joint, one of them, one of the state, or those of a point."""
    if isinstance(key, tuple):
        return _point(what, key, model)
    name = named(what, key, model)
    joints = model.summary["joints"]
    for j, joint in enumerate(joints):
        if joint["name"] == name:
            count = joint["q"][1]
            if count == 0:
                raise ArgumentError(f"{what}: joint {name!r} has no coordinate: it allows no motion", argument=what)
            labels = [name] if count == 1 else [f"{name}.{axis}" for axis in coordinate_axes(joint)]
            return [(label, "joint", j, i, _NOWHERE) for i, label in enumerate(labels)]
    for j, joint in enumerate(joints):
        if joint["q"][1] > 1 and name.startswith(joint["name"] + "."):
            labels = [f"{joint['name']}.{axis}" for axis in coordinate_axes(joint)]
            if name in labels:
                return [(name, "joint", j, labels.index(name), _NOWHERE)]
    if name in model.names:
        return [(name, "own", model.names.index(name), 0, _NOWHERE)]
    known = sorted({joint["name"] for joint in joints if joint["q"][1]} | set(model.names))
    near = difflib.get_close_matches(name, known, n=1)
    hint = f'did you mean "{near[0]}"?' if near else f"known: {', '.join(known)}"
    raise UnknownNameError(
        f"{what}: {name!r} is neither a joint nor a coordinate; {hint}; a point is given as (body, (x, y, z))",
        name=name,
        known=known,
    )


def named(what: str, key: Any, model: CompiledModel) -> str:
    """Name of a joint or of a coordinate: of a handle, its own; of `pt.Coordinate(joint, 1)`, as in "plane.y"."""
    if not isinstance(key, Coordinate):
        return str(key)
    name = str(key.joint)
    own = next((joint for joint in model.summary["joints"] if joint["name"] == name), None)
    if own is None:
        return name
    axes: list[str] = list(own["axes"]) if what == "rates" else coordinate_axes(own)
    if len(axes) == 1 and key.coordinate == 0:
        return name
    if key.coordinate not in range(len(axes)):
        raise ArgumentError(
            f"{what}: {shown(key)} does not exist: joint {name!r} has {len(axes)} coordinates, counted from 0: "
            f"{', '.join(f'{name}.{axis}' for axis in axes)}",
            argument=what,
        )
    return f"{name}.{axes[key.coordinate]}"


def units_of(goals: list[Goal], model: CompiledModel) -> list[str]:
    """SI unit of each; "" of the numbers of a quaternion."""
    own: list[str] = []
    units = []
    for _, kind, i, coordinate, _ in goals:
        if kind == "joint":
            units.append(joint_units(model.summary["joints"][i])[0][coordinate])
        elif kind == "own":
            own = own or state_units(model)[0]
            units.append(own[i])
        else:
            units.append("m" if kind == "point" else "rad")
    return ["" if unit == "1" else unit for unit in units]


def state_units(model: CompiledModel) -> tuple[list[str], list[str]]:
    """Units of the coordinates and of the velocities of a state; "" of the numbers of a quaternion."""
    names = Names.from_summary(model.summary, model.core.nq, model.core.nv, 0)
    q, v = coordinate_units(model.summary, names)
    return ["" if unit == "1" else unit for unit in q], v


def _by_rows(value: Any, units: list[str]) -> Any:
    """Units of values for many poses: one for all, or one for each number of a row."""
    if len(set(units)) == 1:
        return units[0]
    shape = np.shape(bare(value))
    return units if len(shape) < 2 else [units] * shape[0]


def _point(what: str, key: tuple[Any, ...], model: CompiledModel) -> list[Goal]:
    """The world coordinates of a point of a body: ("coupler", (0.6, 0, 0)), or some: ("coupler", (0.6, 0, 0), "xy")."""
    if not 2 <= len(key) <= 3:
        raise ArgumentError(
            f"{what}: a point is given as (body, (x, y, z)) or (body, (x, y, z), axes) with axes such as 'xy', not "
            f"{shown(key)}",
            argument=what,
        )
    if is_turn(key):
        raise ArgumentError(
            f"{what}: the rotation of a body is a target of assemble, assemble_many and kinematics, whose value is an "
            f"orientation; here give joints, or points as (body, (x, y, z)), not {shown(key)}",
            argument=what,
        )
    bodies = [body["name"] for body in model.summary["bodies"]]
    name = str(key[0])
    if name not in bodies:
        raise UnknownNameError(
            f"{what}: there is no body {name!r}; known: {', '.join(bodies)}", name=name, known=bodies
        )
    try:
        point = floats(si(what, key[1], "m"))
    except TypeError:
        point = np.empty(0)
    if point.shape != (3,) or not np.all(np.isfinite(point)):
        raise ArgumentError(
            f"{what}: the point of {name!r} must be three finite numbers in body axes, not {shown(key[1])}",
            argument=what,
        )
    axes = key[2] if len(key) == 3 else _AXES
    if not isinstance(axes, str) or not axes or len(set(axes)) != len(axes) or set(axes) - set(_AXES):
        raise ArgumentError(
            f"{what}: the axes of a point are letters of 'xyz', each once, such as 'xy', not {shown(axes)}",
            argument=what,
        )
    local = (float(point[0]), float(point[1]), float(point[2]))
    words = f"point ({', '.join(f'{x:g}' for x in local)}) of {name}"
    return [(f"{words} in {axis}", "point", bodies.index(name), _AXES.index(axis), local) for axis in axes]


def is_framed(key: Any, value: Any) -> bool:
    """Whether a target is a pose: a point of a body, and (position, orientation)."""
    value = as_pair(value)
    if not (isinstance(key, tuple) and len(key) == 2 and isinstance(value, tuple | list) and len(value) == 2):
        return False
    shape = np.shape(value[1]) if not is_rotation(value[1]) else (3, 3)
    return shape in ((3, 3), (4,)) or (len(shape) == 3 and shape[1:] == (3, 3)) or (len(shape) == 2 and shape[1] == 4)


def is_turn(key: Any) -> bool:
    """Whether a target is the orientation of a body alone: ("tool", "rotation")."""
    return isinstance(key, tuple) and len(key) == 2 and isinstance(key[1], str) and key[1] == "rotation"


def orientation_goals(what: str, key: Any, model: CompiledModel, reference: Array) -> list[Goal]:
    """The components of the rotation vector of a body relative to a reference orientation (3, 3)."""
    (_, _, body, _, _), *_ = _point(what, key, model)
    numbers = tuple(float(x) for x in reference.ravel())
    name = model.summary["bodies"][body]["name"]
    return [(f"orientation of {name} about {axis}", "turn", body, i, numbers) for i, axis in enumerate(_AXES)]


def orientations(what: str, key: Any, value: Any) -> Array:
    """Rotation matrices (n, 3, 3), or (3, 3) for one, from matrices, quaternions (w, x, y, z) or a SciPy Rotation."""
    try:
        if is_rotation(value) and not value.single:
            return np.asarray(value.as_matrix(), dtype=float)
        shape = (3, 3) if is_rotation(value) else np.shape(value)
        element = Element("target", str(key[0]))
        many = len(shape) == 3 or (len(shape) == 2 and shape != (3, 3))
        if many:
            return np.array([rotation(element, "the orientation", one) for one in value]).reshape(-1, 3, 3)
        return rotation(element, "the orientation", value)
    except DescriptionError as error:
        raise ArgumentError(f"{what}: {error.message}", argument=what) from error


def _at_target(model: CompiledModel) -> Framed:
    """For one position: the orientation relative to the one that is asked for, so that its target is zero."""

    def framed(what: str, key: Any, value: Any) -> tuple[list[Goal], Any]:
        position, turned = as_pair(value)
        reference = orientations(what, key, turned)
        if reference.shape != (3, 3):
            message = f"{what}[{shown(key)}] has {len(reference)} orientations; give one, or use assemble_many"
            raise ArgumentError(message, argument=what)
        points = _point(what, key, model)
        place = _numbers_of(what, key, position, "m", 3)
        if place.ndim != 1:
            raise ArgumentError(f"{what}[{shown(key)}] needs one position of three numbers", argument=what)
        return [*points, *orientation_goals(what, key, model, reference)], [*place.tolist(), 0.0, 0.0, 0.0]

    return framed


def relative_to(references: Callable[[int], Array], model: CompiledModel) -> Framed:
    """For many poses: rotation vectors relative to the orientation `references(body)` of the state of the branch."""

    def framed(what: str, key: Any, value: Any) -> tuple[list[Goal], Any]:
        points = _point(what, key, model)
        reference = references(points[0][2])
        positions, turned = as_pair(value)
        matrices = orientations(what, key, turned).reshape(-1, 3, 3)
        vectors = transform().Rotation.from_matrix(reference.T @ matrices).as_rotvec()
        return [*points, *orientation_goals(what, key, model, reference)], _rows(what, key, positions, vectors, "m")

    return framed


def rates_of_frames(framed_keys: Mapping[Any, list[Goal]], unit: str) -> Framed:
    """For rates of such targets: (velocity, angular velocity) along the axes of the world."""

    def framed(what: str, key: Any, value: Any) -> tuple[list[Goal], Any]:
        if is_turn(key):
            return framed_keys[key], _numbers_of(what, key, value, f"rad{unit}", 3)
        turned = np.atleast_2d(_numbers_of(what, key, value[1], f"rad{unit}", 3))
        return framed_keys[key], _rows(what, key, value[0], turned, f"m{unit}")

    return framed


def _rows(what: str, key: Any, positions: Any, vectors: Array, unit: str) -> Array:
    """Positions and rotation vectors side by side: (n, 6), or (6,) for one."""
    rows = np.atleast_2d(_numbers_of(what, key, positions, unit, 3))
    if len({len(rows), len(vectors)} - {1}) > 1:
        raise ArgumentError(
            f"{what}[{shown(key)}] has {len(vectors)} rotations and {len(rows)} positions; give as many of both, or "
            "one for all",
            argument=what,
        )
    count = max(len(rows), len(vectors))
    found = np.hstack([np.broadcast_to(part, (count, 3)) for part in (rows, vectors)])
    return found[0] if count == 1 else found


def _numbers_of(what: str, key: Any, value: Any, unit: str, width: int) -> Array:
    """Finite numbers (width,) or (n, width), in SI units."""
    try:
        array = floats(si(f"{what}[{shown(key)}]", value, unit))
    except TypeError as error:
        sentence = f"{what}[{shown(key)}] must be made of numbers, not {shown(value)}"
        raise ArgumentError(sentence, argument=what) from error
    if array.ndim not in (1, 2) or array.shape[-1] != width or not np.isfinite(array).all():
        raise ArgumentError(
            f"{what}[{shown(key)}] must be {width} finite numbers, or a row of them for each pose, not of shape "
            f"{array.shape}: {shown(value)}",
            argument=what,
        )
    return array


def asked(
    what: str, wanted: Any, model: CompiledModel, framed: Framed | None = None, frames: Mapping[Any, Any] | None = None
) -> list[tuple[Any, list[Goal], Any]]:
    """Key, goals and value of each entry of a dict of targets; every number at most once.

    `framed` takes positions with orientations, by default those of one position; `frames` are keys that are such.
    """
    if not isinstance(wanted, Mapping):
        raise ArgumentError(f"{what} must be a dict such as {{'A': 1.0}}, not {shown(wanted)}", argument=what)
    framed = framed or _at_target(model)
    found, seen = [], set[tuple[Any, ...]]()
    for key, value in wanted.items():
        with_orientation = is_framed(key, value) if frames is None else key in frames
        if frames is None and is_turn(key):
            goals, six = framed(what, (key[0], _NOWHERE), (_NOWHERE, value))
            goals, value = goals[3:], np.asarray(six)[..., 3:]  # at any position
        elif with_orientation:
            goals, value = framed(what, key, value)
        elif frames is None and is_framed(key, value[::-1] if isinstance(value, tuple | list) else value):
            raise ArgumentError(
                f"{what}[{shown(key)}]: give the position first, then the orientation: (position, orientation)",
                argument=what,
            )
        else:
            goals = goals_of(what, key, model)
        for goal in goals:
            same = goal[1:4] if goal[1] == "turn" else goal[1:]
            if same in seen:
                raise ArgumentError(f"{what} sets {goal[0]!r} twice; give it once", argument=what)
            seen.add(same)
        found.append((key, goals, value))
    return found


def inputs_of(goals: list[Goal], model: CompiledModel) -> list[int] | None:
    """Velocities whose coordinates the goals are, if there are as many as degrees of freedom; else None."""
    names = model.velocity_names
    if len(goals) != model.mobility or any(goal[0] not in names for goal in goals):
        return None
    return [names.index(goal[0]) for goal in goals]


def columns(
    what: str,
    wanted: Any,
    model: CompiledModel,
    framed: Framed,
    *,
    per: str = "",
    frames: Mapping[Any, Any] | None = None,
) -> tuple[list[Goal], Array, dict[Any, list[int]]]:
    """Goals and their values, a row for each pose; also the columns of each key.

    Numbers apply to all poses; arrays of n (or n times as many as the key has numbers) give one for each. `per` is what
    follows the units: "/s" for rates.
    """
    entries = asked(what, wanted, model, framed, frames)
    if not entries:
        raise ArgumentError(f"{what} is empty; name what differs from pose to pose", argument=what)
    goals: list[Goal] = []
    parts: list[tuple[Any, Array]] = []
    indices: dict[Any, list[int]] = {}
    for key, own, value in entries:
        units = [f"{unit or 1}{per}" if per else unit for unit in units_of(own, model)]
        try:
            array = floats(si(f"{what}[{shown(key)}]", value, _by_rows(value, units)))
        except TypeError as error:
            message = f"{what}[{shown(key)}] must be an array of numbers, not {shown(value)}"
            raise ArgumentError(message, argument=what) from error
        count = len(own)
        if (array.shape == () and count == 1) or (array.shape == (count,) and count > 1):
            array = array.reshape(1, count)
        elif array.ndim == 1 and count == 1:
            array = array.reshape(-1, 1)
        elif array.ndim != 2 or array.shape[1] != count:
            each = "(n,)" if count == 1 else f"(n, {count})"
            message = (
                f"{what}[{shown(key)}] has shape {array.shape}; it must be {each}, a row for each pose, or one value "
                "for all"
            )
            raise ArgumentError(message, argument=what)
        if not np.isfinite(array).all():
            row = int(np.argmin(np.isfinite(array).all(axis=1)))
            message = f"{what}[{shown(key)}] of pose {row} is {shown(array[row].tolist())}; give finite numbers"
            raise ArgumentError(message, argument=what)
        indices[key] = list(range(len(goals), len(goals) + count))
        goals += own
        parts.append((key, array))
    given = {key: np.ndim(value) for key, _, value in entries}
    counts = {len(array): key for key, array in parts if given[key] > 1 or len(array) != 1}
    if len(counts) > 1:
        words = ", ".join(f"{shown(key)}: {n}" for n, key in counts.items())
        raise ArgumentError(f"{what} has different numbers of poses ({words}); give the same for all", argument=what)
    rows = next(iter(counts), 1)
    values = np.concatenate([np.broadcast_to(array, (rows, array.shape[1])) for _, array in parts], axis=1)
    return goals, np.ascontiguousarray(values), indices
