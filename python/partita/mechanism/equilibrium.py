"""Positions at rest: `equilibrium`, `equilibria`."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import options as run_options
from ..analyses.equilibrium import Equilibrium
from ..analyses.still import run_of
from ..builder.compiled import CompiledModel
from ..errors import ArgumentError, PartitaError
from ..naming import Names, coordinate_units
from ..results.run import Run
from ..state import State
from .models import Modelled, layout_of
from .solve import start_of

Array = NDArray[np.float64]

SAME = 1e-6
"""Equilibria nearer to each other, in radians and fractions of the size of the state, are one."""


def equilibrium(
    self: Modelled,
    near: Any = None,
    *,
    stable: bool | None = None,
    t: float | None = None,
    coordinates: str = "relative",
    parameters: Mapping[str, ArrayLike] | None = None,
) -> Equilibrium:
    """Find a position in which the mechanism stays at rest under its loads, with all loops closed and all reactions.

    Args:
        near: state from which the search starts; its velocities are ignored. None: the drawing, assembled.
        stable: True: go down the potential to a stable equilibrium, never to a saddle; None or False: the nearest one
            by Newton's method, stable or not.
        t: time [s] of loads and prescribed motions; None: that of `near`. Drives must be at rest then; they hold their
            positions.
        coordinates, parameters: as in `simulate`.

    Raises:
        ArgumentError: no equilibrium was found from there (what is left is named), a drive moves, or friction could
            hold the mechanism at rest anywhere in a set of positions.
        SingularityError: the position is singular.

    >>> import math
    >>> import partita as pt
    >>> m = pt.Mechanism("pendulum")
    >>> rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    >>> hinge = m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    >>> e = m.equilibrium(stable=True)
    >>> e.stable, round(e.state.position("A") / math.pi, 12), e.joint("A").force.round(9).tolist()
    (True, -0.5, [[0.0, 9.81, 0.0]])
    """
    wanted = run_options.one_of("coordinates", coordinates, run_options.COORDINATES)
    model, _ = layout_of(self, wanted, parameters)
    near = getattr(near, "state", near)
    start = start_of(self, near, model, wanted, parameters)
    descends = False if stable is None else run_options.yes_or_no("stable", stable)
    time = start.t if t is None else State(run_options.si("t", t, "s"), [], []).t
    _refuse_friction(model)
    return _found(model, time, start, descends)


def _found(model: CompiledModel, t: float, start: State, stable: bool) -> Equilibrium:
    """The equilibrium that a search arrives at."""
    found = model.core.equilibrium(t, start.q, stable)
    rest = np.zeros(model.core.nv)
    q = found["q"]
    state = State(t, q, rest, layout=start._layout)
    about = model.core.linearized(t, q, rest, np.zeros((0, len(rest))))
    modes = about["modes"]
    values = np.zeros(0, dtype=complex)
    stable_here: bool | None = None
    curvatures = found["curvatures"]
    largest = float(np.abs(curvatures).max(initial=0.0))
    indifferent = int(np.sum(np.abs(curvatures) <= np.sqrt(np.finfo(float).eps) * largest))
    if modes is not None:
        values = modes["real"] + 1j * modes["imaginary"]
        growth, small = float(values.real.max(initial=-np.inf)), float(modes["zero"])
        if about["conservative"]:
            stable_here = None if indifferent else bool(np.all(curvatures > 0.0))
            if np.any(curvatures < 0.0) and not np.all(np.abs(curvatures[curvatures < 0.0]) <= SAME * largest):
                stable_here = False
        elif abs(growth) > small:
            stable_here = growth < 0.0
    row = rest[None, :]
    run = run_of(Run, model, np.array([t]), q[None, :], row, row, found["multipliers"][None, :])
    return Equilibrium(
        state=state,
        stable=stable_here,
        eigenvalues=values,
        stiffness=found["stiffness"],
        independent=tuple(model.velocity_names[i] for i in found["independent"]),
        indifferent=indifferent,
        iterations=int(found["iterations"]),
        _run=run,
    )


def _refuse_friction(model: CompiledModel) -> None:
    """Friction that sticks holds the mechanism at rest in a whole set of positions."""
    for force in json.loads(model.core.description)["forces"]:
        if force["kind"] == "friction":
            raise ArgumentError(
                f'friction "{force["name"]}" can hold the mechanism at rest in a whole set of positions, so an '
                "equilibrium is not one position; remove it, or simulate with damping until the motion stops",
                argument="near",
            )


def equilibria(
    self: Modelled,
    starts: int = 200,
    *,
    seed: int = 0,
    near: Any = None,
    coordinates: str = "relative",
    parameters: Mapping[str, ArrayLike] | None = None,
) -> list[Equilibrium]:
    """Search equilibria from many positions drawn at random, on all branches; the ones found, each once, the lowest
    potential energy first. There may be others: this is what was found from so many starts, never "all".

    Args:
        starts: number of random positions from which the search starts.
        seed: of the random positions; the same seed gives the same list.
        near, coordinates, parameters: as in `equilibrium`; the first search starts at `near`.

    >>> import partita as pt
    >>> m = pt.Mechanism("pendulum")
    >>> rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    >>> hinge = m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    >>> [e.stable for e in m.equilibria(20)]
    [True, False]
    """
    wanted = run_options.one_of("coordinates", coordinates, run_options.COORDINATES)
    model, _ = layout_of(self, wanted, parameters)
    start = start_of(self, getattr(near, "state", near), model, wanted, parameters)
    _refuse_friction(model)
    count, random = run_options.count(starts, "starts"), run_options.generator(seed)
    scales = _scales(model, start)
    found: list[Equilibrium] = []
    for i in range(count + 1):
        here = start if i == 0 else _drawn(model, start, scales, random)
        if here is None:
            continue
        for stable in (False, True):
            try:
                one = _found(model, start.t, here, stable)
            except PartitaError:
                continue
            if not any(_same(model, one, other, scales) for other in found):
                found.append(one)
    return sorted(found, key=lambda one: one.potential)


def _scales(model: CompiledModel, start: State) -> Array:
    """Range of each coordinate: half a turn, or the size of the mechanism."""
    bodies = model.core.bodies(np.array([start.t]), start.q[None, :], start.v[None, :], list(range(_bodies(model))))
    points = bodies["body_position"][0]
    size = float(np.ptp(points, axis=0).max(initial=0.0)) or 1.0
    return np.array([np.pi if unit == "rad" else size if unit == "m" else 1.0 for unit in _units(model)])


def _bodies(model: CompiledModel) -> int:
    return len(model.summary["bodies"])


def _units(model: CompiledModel) -> list[str]:
    names = Names.from_summary(model.summary, model.core.nq, model.core.nv, model.core.rows)
    return coordinate_units(model.summary, names)[0]


def _drawn(model: CompiledModel, start: State, scales: Array, random: np.random.Generator) -> State | None:
    """A position drawn at random, its loops closed; None where they do not close from there."""
    q = start.q + scales * random.uniform(-1.0, 1.0, len(scales))
    try:
        q, v, _ = model.core.assemble(start.t, q, np.zeros(model.core.nv), [], [], [], [], [], 1e-10)
    except PartitaError:
        return None
    return State(start.t, q, v, layout=start._layout)


def _same(model: CompiledModel, one: Equilibrium, other: Equilibrium, scales: Array) -> bool:
    """Whether two positions are one, whole turns of angles aside."""
    off = one.state.q - other.state.q
    turns = scales == np.pi
    off[turns] -= 2.0 * np.pi * np.round(off[turns] / (2.0 * np.pi))
    return bool(np.max(np.abs(off) / scales, initial=0.0) <= SAME)
