"""The equations of motion of a compiled mechanism in the rates of its actuators."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..errors import ArgumentError
from ..naming import index_of
from ..numeric import floats, shown
from ..options import si
from ..state import State

FloatArray = NDArray[np.float64]


class Actuated:
    """A mechanism seen from as many actuators as it has degrees of freedom, at one state: tau = M w' + bias, where w
    are the rates along the actuators. Idle rotations (rods between balls) need none: no effort acts on them.

    Attributes:
        actuators: names of the k actuators.
        state: the state.
        M: (k, k) mass matrix in the rates of the actuators; its diagonal is the reflected inertia of each, the others
            held.
        bias: (k,) efforts for w' = 0: velocity terms, gravity and all other applied forces.
        rates: (k,) w, rates along the actuators.
        ratios: (nv, k) transmission ratios: each velocity of the state per rate of an actuator, the others held.

    >>> import partita as pt
    >>> m = pt.catalogue.load("four-bar")
    >>> model = m.compile()
    >>> a = model.actuated(m.assemble(rates={"A": 2.0}), ["A"])
    >>> a.M.shape, round(float(a.ratio("A")[0]), 12)
    ((1, 1), 1.0)
    >>> there = a.at(m.assemble(targets={"A": 1.0}))                # elsewhere, with nothing set up again
    >>> bool(there.ratio("C")[0] != a.ratio("C")[0])
    True
    """

    def __init__(self, model: Any, core: _core.Actuated, actuators: tuple[str, ...], state: State) -> None:
        self._model, self._core = model, core
        self.actuators, self.state = actuators, state
        found = core.at(state.t, state.q, state.v)
        self.M: FloatArray = found["M"]
        self.bias: FloatArray = found["bias"]
        self.ratios: FloatArray = found["ratios"]
        self.rates: FloatArray = found["rates"]

    @cached_property
    def gravity(self) -> FloatArray:
        """(k,): the part of the bias that carries the constant gravity."""
        return self._core.gravity(self.state.t, self.state.q, self.state.v)

    @cached_property
    def margin(self) -> float:
        """Distance from a position in which the actuators cannot cause every motion, without units: 1 best, 0 there; as
        `InverseDynamics.margin`."""
        return self._core.margin(self.state.t, self.state.q)

    def at(self, state: State) -> Actuated:
        """The same at another state."""
        self._model._of_this(state)
        return Actuated(self._model, self._core, self.actuators, state)

    @property
    def reflected(self) -> FloatArray:
        """(k,): inertia that each actuator moves, the others held: the diagonal of M [kg m^2, kg]."""
        return np.diag(self.M).copy()

    def efforts(self, accelerations: Any) -> FloatArray:
        """(k,): efforts for these accelerations along the actuators."""
        try:
            given = floats(accelerations)
        except TypeError:
            given = np.empty((0, 0))
        if given.shape != self.bias.shape or not np.isfinite(given).all():
            raise ArgumentError(
                f"accelerations must be {len(self.bias)} finite numbers, one for each of {', '.join(self.actuators)}, "
                f"not {shown(accelerations)}",
                argument="accelerations",
            )
        return np.asarray(self.M @ given + self.bias)

    def ratio(self, joint: Any) -> FloatArray:
        """Transmission ratios of a joint, in the tree or closing a loop: its rate per rate of each actuator, the others
        held; (k,) where the joint has one degree of freedom, else (degrees of freedom, k)."""
        joints = self._model.summary["joints"]
        j = index_of(str(joint), [each["name"] for each in joints], "joint")
        found = np.asarray(self._columns().joints([j])["joint_velocity"]).T
        return found[0] if len(found) == 1 else found

    def jacobian(self, of: Any) -> FloatArray:
        """(6, k): velocity of a point of a body, then the angular velocity of the body, per rate of each actuator, in
        world axes. `of` is (body, point in body axes [m]), or a body, for its origin.

        >>> import partita as pt
        >>> m = pt.catalogue.load("four-bar")
        >>> a = m.compile().actuated(m.assemble(), ["A"])
        >>> a.jacobian(("coupler", (0.5, 0, 0))).shape
        (6, 1)
        """
        body, point = of if isinstance(of, tuple) and len(of) == 2 else (of, (0.0, 0.0, 0.0))
        names = [each["name"] for each in self._model.summary["bodies"]]
        i = index_of(str(body), names, "body")
        try:
            arm = floats(si("jacobian", point, "m"))
        except TypeError:
            arm = np.empty(0)
        if arm.shape != (3,) or not np.isfinite(arm).all():
            raise ArgumentError(
                f"jacobian: the point of {str(body)!r} must be three finite numbers in body axes, not {shown(point)}",
                argument="of",
            )
        found: Mapping[str, FloatArray] = self._columns().bodies([i])
        spin = found["body_angular_velocity"][:, 0]
        return np.concatenate(
            [(found["body_velocity"][:, 0] + np.cross(spin, found["body_rotation"][:, 0] @ arm)).T, spin.T]
        )

    def _columns(self) -> Any:
        """A motion with a unit rate of each actuator."""
        k = len(self.actuators)
        return self._model.core.motion(np.full(k, self.state.t), np.tile(self.state.q, (k, 1)), self.ratios.T)

    def __repr__(self) -> str:
        words = ", ".join(f"{name} {x:.4g}" for name, x in zip(self.actuators, self.reflected, strict=True))
        return f"<Actuated by {', '.join(self.actuators)}: reflected inertia {words}; margin {self.margin:.3g}>"
