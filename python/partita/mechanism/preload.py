"""Loads that hold a mechanism in a given position: `preload`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .. import options as run_options
from ..builder.parameter_units import parameter_unit
from ..errors import ArgumentError
from ..numeric import is_list, shown
from ..state import State
from ..units import Quantity
from .equilibrium import refuse_friction
from .models import Modelled, layout_of
from .set_valued import without_holding
from .solve import start_of

POWERS = {"m": (1, 0), "rad": (0, 0), "N": (-1, 1), "N m": (0, 1), "N/m": (-2, 1), "N m/rad": (0, 1)}
"""Unit of a parameter -> powers of a length and an energy that are its natural size."""


def preload(
    self: Modelled,
    unknown: Iterable[str],
    at: Any = None,
    *,
    t: Quantity | None = None,
    coordinates: str = "relative",
    parameters: Mapping[str, ArrayLike] | None = None,
) -> dict[str, Any]:
    """Compute numbers of loads with which the mechanism stays at rest in a given position: lengths of springs without
    load, constant torques and forces, stiffnesses.

    k degrees of freedom are k equations. Of more numbers those are taken that differ least from the present ones, in
    natural sizes (lengths by that of a body, forces and torques by the loads that act), so that units do not matter.
    Springs take part with `length` or `angle`, torques and forces with `value`.

    Args:
        unknown: names of parameters (`m.compile().parameters`).
        at: state, as `assemble` returns it; its velocities are ignored. None: the drawing, assembled.
        t: time [s] of loads and prescribed motions; None: that of `at`.
        coordinates, parameters: as in `simulate`; the numbers named are changed from these.

    Returns:
        parameter -> number, or list of numbers: what `parameters=` of `equilibrium`, `linearize`, `simulate` takes.
        `m.equilibrium(at, parameters=found)` says whether the equilibrium is stable.

    Raises:
        ArgumentError: the numbers named cannot hold the position (what is left is named), or are none of loads.
        SingularityError: the position is singular. DescriptionError: there is no parameter of a name.

    >>> import partita as pt
    >>> m = pt.Mechanism("lamp")
    >>> arm = m.add_rod("arm", start=(0, 0, 0), end=(1, 0, 0), mass=2.0)
    >>> hinge = m.add_revolute("A", m.ground, arm, point=(0, 0, 0))
    >>> spring = m.add_torsion_spring("A", stiffness=50.0, name="s")
    >>> found = m.preload(["s.angle"])                     # stiffness * angle = m g L / 2
    >>> round(found["s.angle"], 12)
    0.1962
    >>> m.equilibrium(parameters=found).stable
    True
    """
    wanted = run_options.one_of("coordinates", coordinates, run_options.COORDINATES)
    without_holding(self, "preload", state=True)
    model, _ = layout_of(self, wanted, parameters)
    start = start_of(self, getattr(at, "state", at), model, wanted, parameters)
    refuse_friction(model)
    time = start.t if t is None else State(run_options.si("t", t, "s"), [], []).t
    if not is_list(unknown):
        message = f"unknown must be a list of names such as ['spring.length'], not {shown(unknown)}"
        raise ArgumentError(message, argument="unknown")
    known = model.parameters
    names = list(dict.fromkeys(str(name) for name in unknown))
    if not names:
        raise ArgumentError("unknown is empty; name at least one parameter", argument="unknown")
    asked = []
    for name in names:
        if name not in known:
            model.with_parameters({name: 0.0})  # says which there are
        unit = parameter_unit(model._drawn, name)
        if not isinstance(unit, str) or unit not in POWERS:
            raise ArgumentError(
                f"preload: {name} is no load{f' (its unit is {unit})' if unit else ''}; name lengths of springs "
                "without load, angles, constant torques and forces, or stiffnesses",
                argument="unknown",
            )
        asked.append((name, POWERS[unit]))
    found = model.core.preload(time, np.asarray(start.q), asked)
    return {name: x[0] if len(x) == 1 else x for name, x in zip(names, found, strict=True)}
