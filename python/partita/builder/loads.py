"""Bushings."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..products import matmul
from ..tolerance import SUM_ROUNDING
from . import frames
from .bodies import to_world
from .checks import Array, matrix, shape_of, vector
from .declaration import Call, Field, Load, side
from .drawing import Drawing
from .points import point_in_world
from .records import GROUND, Body, Description, Force


def _six(call: Call, what: str, value: Any, units: list[str]) -> Array:
    """A 6x6 matrix, or six numbers where only its diagonal is not zero."""
    element = call.element
    if shape_of(value) == (6,):
        return vector(element, what, value, units[::7], 6)
    if shape_of(value) != (6, 6):
        element.fail(f"{what} must be six numbers or a 6x6 matrix, not of shape {shape_of(value)}")
    full = matrix(element, what, value, [units[i : i + 6] for i in range(0, 36, 6)], 6)
    if np.array_equal(full, np.diag(np.diag(full))):
        return np.diag(full)
    # symmetric up to the round-off of a product: as intended
    intended = np.allclose(full, full.T, rtol=0.0, atol=SUM_ROUNDING * float(np.max(np.abs(full))))
    return 0.5 * (full + full.T) if intended else full


EFFORTS = ["N"] * 3 + ["N m"] * 3
_SIX: dict[str, Any] = {"check": _six, "rule": {"$ref": "#/$defs/stiffness"}}
BUSHING = Load(
    "bushing",
    body1=side(),
    body2=side(),
    point=Field(
        lambda call, what, value, _: point_in_world(call.drawing, call.element, what, value),
        {"$ref": "#/$defs/vector"},
    ),
    frame=Field(
        lambda call, what, value, _: frames.rotation(call.element, what, value),
        {"$ref": "#/$defs/rotation"},
        absent=np.eye(3),
    ),
    stiffness=Field(**_SIX, unit=[f"{a}{b}" for a in EFFORTS for b in ("/m", "/rad") for _ in range(3)]),
    damping=Field(**_SIX, unit=[f"{a} s{b}" for a in EFFORTS for b in ("/m", "/rad") for _ in range(3)]),
    lost="nothing holds its bodies together",
    apart="both sides are on {}, where it has no effect",
)


@BUSHING
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
    call, d = BUSHING.checked(locals()), self._description
    axes = np.eye(3) if frame is None else call["frame"]
    first, second = call["body1"], call["body2"]
    return call.store(
        body1=first,
        point1=to_body(d, first, call["point"]),
        frame1=matmul(_axes(d, first).T, axes),
        body2=second,
        point2=to_body(d, second, call["point"]),
        frame2=matmul(_axes(d, second).T, axes),
        stiffness=_full(call["stiffness"]),
        damping=_full(call["damping"]),
    )


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


def _full(value: Array) -> Array:
    """The matrix of six numbers on its diagonal."""
    return np.diag(value) if value.ndim == 1 else value
