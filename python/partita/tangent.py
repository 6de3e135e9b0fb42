"""User-defined tangent velocities, for the formulation "user-tangent"."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import ArgumentError, EvaluationError
from .numeric import floats, shown

Array = NDArray[np.float64]


@dataclass(frozen=True)
class TangentVelocities:
    """k user-defined velocities u: v = D(t, q)^T u + gamma(t, q), with C D^T = 0.

    Prefer them if good velocities are known by inspection, as in symbolic codes; otherwise use the default formulation,
    which finds its own. The directions are checked against the constraints at the start.

    Args:
        directions: f(t, q) -> D (k, n); its rows span all velocities that the constraints allow.
        offset: f(t, q) -> gamma (n,), with C gamma + a = 0; None: zero (constraints do not depend on time).
        bias: f(t, q, v) -> delta (n,), the part of v' without u': (dD^T/dt) u + dgamma/dt; None: computed by finite
            differences along the motion, which costs further evaluations of `directions`; the result reports their
            accuracy.

    >>> import numpy as np
    >>> import partita as pt
    >>> tangent = pt.TangentVelocities(lambda t, q: [[-q[1], q[0]]], bias=lambda t, q, v: -q * (v @ v) / (q @ q))
    >>> ring = pt.System(
    ...     n=2,
    ...     mass=np.eye(2),
    ...     forces=(0.0, -9.81),
    ...     constraints=lambda t, q: [0.5 * (q @ q - 1.0)],
    ...     jacobian=lambda t, q: [q],
    ...     bias=lambda t, q, v: [v @ v],
    ... )
    >>> run = pt.simulate(ring, 1.0, [1.0, 0.0], [0.0, 0.0], solver=pt.Solver("user-tangent", tangent=tangent))
    >>> bool(run.closure.max() < 1e-12)
    True
    """

    directions: Callable[[float, Array], Any]
    offset: Callable[[float, Array], Any] | None = None
    bias: Callable[[float, Array, Array], Any] | None = None

    def __post_init__(self) -> None:
        for name in ("directions", "offset", "bias"):
            function = getattr(self, name)
            if not callable(function) and not (function is None and name != "directions"):
                raise ArgumentError(
                    f"{name} of tangent velocities must be a function, not {shown(function)}", argument=name
                )

    def checked(self, n: int) -> TangentVelocities:
        """The same functions, their results checked at each call: shape (k, n) or (n,), finite."""

        def check(name: str, function: Callable[..., Any], is_vector: bool) -> Callable[..., Array]:
            def call(t: float, *arguments: Array) -> Array:
                returned = function(t, *arguments)
                try:
                    array = floats(returned)
                except TypeError as error:
                    raise EvaluationError(
                        f"tangent velocities: {name} at t = {t:g} s returned {shown(returned)}, which is not an array "
                        f"of numbers",
                        t=t,
                        where=name,
                    ) from error
                fits = array.shape == (n,) if is_vector else array.ndim == 2 and array.shape[1] == n
                if not fits or not np.isfinite(array).all():
                    wanted = f"({n},)" if is_vector else f"(k, {n})"
                    finite = "all finite" if np.isfinite(array).all() else "not all finite"
                    raise EvaluationError(
                        f"tangent velocities: {name} at t = {t:g} s returned shape {array.shape}, {finite}; "
                        f"it must be finite and of shape {wanted}",
                        t=t,
                        where=name,
                    )
                return array

            return call

        return TangentVelocities(
            check("directions", self.directions, False),
            None if self.offset is None else check("offset", self.offset, True),
            None if self.bias is None else check("bias", self.bias, True),
        )
