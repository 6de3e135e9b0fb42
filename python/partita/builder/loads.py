"""Bushings."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..products import matmul
from ..tolerance import SUM_ROUNDING
from . import frames
from .bodies import resolve, to_world
from .checks import Array, Element, matrix, name_of, shape_of, vector
from .drawing import Drawing
from .forces import store
from .points import point_in_world
from .records import GROUND, Body, Description, Force, LoadRecord


def add_bushing(
    self: Drawing,
    name: str,
    body1: Body | str,
    body2: Body | str,
    point: ArrayLike,
    *,
    stiffness: ArrayLike,
    damping: ArrayLike = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    frame: Any = None,
) -> Force:
    """Add a bushing: stiffness and damping in all six directions between two bodies, unloaded as drawn.

    Both bodies carry a frame that is drawn at `point` with the axes `frame`. Let x = (d, theta) be the displacement and
    the rotation vector of the frame of body 2 in the axes of the frame of body 1. The wrench on body 2 is -(stiffness x
    + damping dx/dt): three forces along these axes and three moments, the generalised forces conjugate to x. The
    opposite wrench acts on body 1 at the same point of space. A symmetric stiffness K has the potential x K x / 2; the
    work of the damping and of the nonsymmetric part of K counts as work. The rotation must stay below half a turn.

    Args:
        name: unique among the forces.
        body1, body2: two different bodies or the ground; body 1 carries the axes.
        point: origin of both frames in the world, as drawn [m].
        stiffness: six numbers (x, y, z [N/m], about x, y, z [N m/rad]) or a 6x6 matrix, translations before rotations.
        damping: the same [N s/m, N m s/rad].
        frame: axes of both frames in the world as drawn, given like `orientation` of `add_body`; None: the world axes.

    >>> import partita as pt
    >>> m = pt.Mechanism("mount")
    >>> engine = m.add_body("engine", mass=80.0, inertia=(2, 3, 2))
    >>> m.add_bushing("B", m.ground, engine, (0, 0, 0), stiffness=(2e5, 2e5, 4e5, 5e3, 5e3, 5e3)).name
    'B'
    """
    element = name_of("force", name, self._description.forces)
    first, second = _two(self, element, body1, body2)
    where = point_in_world(self, element, "point", point)
    axes = frames.rotation(element, "frame", frame)
    law = {
        "stiffness": _six(element, "stiffness", stiffness, STIFFNESS),
        "damping": _six(element, "damping", damping, DAMPING),
    }
    d = self._description
    means = {
        "body1": first,
        "point1": to_body(d, first, where),
        "frame1": matmul(_axes(d, first).T, axes),
        "body2": second,
        "point2": to_body(d, second, where),
        "frame2": matmul(_axes(d, second).T, axes),
        **law,
    }
    arguments = {
        "body1": first,
        "body2": second,
        "point": where,
        "frame": None if np.array_equal(axes, np.eye(3)) else axes,
        "stiffness": _short(law["stiffness"]),
        "damping": _short(law["damping"]) if np.any(law["damping"]) else None,
    }
    units = {"stiffness": [x for row in STIFFNESS for x in row], "damping": [x for row in DAMPING for x in row]}
    return store(self, LoadRecord(name, "bushing", arguments, means, units))


def _two(mechanism: Drawing, element: Element, body1: Body | str, body2: Body | str) -> tuple[str, str]:
    """Names of two different bodies."""
    first, second = resolve(mechanism, element, "body1", body1), resolve(mechanism, element, "body2", body2)
    if first == second:
        element.fail(f'both sides are on "{first}", where it has no effect; name two different bodies')
    return first, second


def _axes(description: Description, body: str) -> Array:
    """Body axes in the world, as drawn."""
    return np.eye(3) if body == GROUND else description.bodies[body].rotation


def to_body(description: Description, body: str, point: Array) -> Array:
    """A point of the world, as drawn, in the axes of a body."""
    return (
        point
        if body == GROUND
        else matmul(_axes(description, body).T, point - to_world(description, body, np.zeros(3)))
    )


def _six(element: Element, what: str, value: Any, units: list[list[str]]) -> Array:
    """A 6x6 matrix, or six numbers on its diagonal."""
    if shape_of(value) == (6,):
        return np.diag(vector(element, what, value, [units[i][i] for i in range(6)], 6))
    if shape_of(value) != (6, 6):
        element.fail(f"{what} must be six numbers or a 6x6 matrix, not of shape {shape_of(value)}")
    full = matrix(element, what, value, units, 6)
    # symmetric up to the round-off of a product: as intended
    intended = np.allclose(full, full.T, rtol=0.0, atol=SUM_ROUNDING * float(np.max(np.abs(full))))
    return 0.5 * (full + full.T) if intended else full


STIFFNESS = [[f"{a}{b}" for b in ["/m"] * 3 + ["/rad"] * 3] for a in ["N"] * 3 + ["N m"] * 3]
DAMPING = [[f"{a} s{b}" for b in ["/m"] * 3 + ["/rad"] * 3] for a in ["N"] * 3 + ["N m"] * 3]


def _short(value: Array) -> Array:
    """Six numbers if only the diagonal is nonzero."""
    diagonal = np.diag(value)
    return diagonal if np.array_equal(value, np.diag(diagonal)) else value
