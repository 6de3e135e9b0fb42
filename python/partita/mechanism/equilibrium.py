"""Positions at rest: `equilibrium`, `equilibria`."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import options as run_options
from ..analyses.equilibrium import Equilibrium
from ..analyses.family import EquilibriumPath
from ..analyses.still import run_of
from ..builder.compiled import CompiledModel
from ..errors import ArgumentError, PartitaError
from ..naming import Names, coordinate_units, joint_units
from ..results.run import Run
from ..state import State
from ..tolerance import EQUAL_IN_SIX_DIGITS
from ..units import Quantity
from . import family
from .models import Modelled, layout_of
from .set_valued import without_holding
from .solve import start_of

Array = NDArray[np.float64]

EVERY, WIDER = 4, 10.0
"""Every so many starts lengths are drawn from a range so many times as wide: no load need tell how far slides go."""
DEFLATED = 5
"""Starts from which further equilibria are searched beside the known ones, after the last start that found one."""


@overload
def equilibrium(
    self: Modelled,
    near: Any = None,
    *,
    along: None = None,
    stable: bool | None = None,
    t: Quantity | None = None,
    coordinates: str = "relative",
    parameters: Mapping[str, ArrayLike] | None = None,
) -> Equilibrium: ...
@overload
def equilibrium(
    self: Modelled,
    near: Any = None,
    *,
    along: Mapping[str, ArrayLike],
    stable: bool | None = None,
    t: Quantity | None = None,
    coordinates: str = "relative",
    parameters: Mapping[str, ArrayLike] | None = None,
) -> EquilibriumPath: ...
def equilibrium(
    self: Modelled,
    near: Any = None,
    *,
    along: Mapping[str, ArrayLike] | None = None,
    stable: bool | None = None,
    t: Quantity | None = None,
    coordinates: str = "relative",
    parameters: Mapping[str, ArrayLike] | None = None,
) -> Equilibrium | EquilibriumPath:
    """Find a position in which the mechanism stays at rest under its loads, with all loops closed and all reactions.

    Args:
        near: state from which the search starts; its velocities are ignored. None: the drawing, assembled.
        along: name of a parameter (`m.compile().parameters`) -> values, at least two: the family of equilibria over
            them, as an `EquilibriumPath`. It begins at the equilibrium for the first value and is followed by
            pseudo-arclength continuation, through folds, while the parameter stays within the range of the values,
            widened by itself on both sides (values of one sign keep it). Parameters of several numbers take rows of
            them, several parameters change together; they must lie on a straight line.
        stable: True: go down the potential to a stable equilibrium, never to a saddle; None or False: the nearest one
            by Newton's method, stable or not, and down the potential where that arrives nowhere, as it does beside
            stops. Of a family: the equilibrium at which it begins.
        t: time [s] of loads and prescribed motions; None: that of `near`. Drives must be at rest then; they hold their
            positions.
        coordinates, parameters: as in `simulate`.

    Raises:
        ArgumentError: no equilibrium was found from there (what is left is named), a drive moves, or friction could
            hold the mechanism at rest anywhere in a set of positions; values of `along` that are no straight line.
        SingularityError: the position is singular.

    Cost of a family: for each position about four evaluations, with three changes of parameters each.

    >>> import math
    >>> import partita as pt
    >>> m = pt.Mechanism("pendulum")
    >>> rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    >>> hinge = m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    >>> e = m.equilibrium(stable=True)
    >>> e.stable, round(e.state.position("A") / math.pi, 12), e.joint("A").force.round(9).tolist()
    (True, -0.5, [[0.0, 9.81, 0.0]])
    >>> spring = m.add_torsion_spring("A", stiffness=20.0, name="s")
    >>> m.equilibrium(along={"s.stiffness": [20.0, 10.0, 5.0]})
    <EquilibriumPath over s.stiffness: 3 equilibria for 3 values, 3 stable; no folds>
    """
    wanted = run_options.one_of("coordinates", coordinates, run_options.COORDINATES)
    without_holding(self, "equilibrium", state=True)
    model, layout = layout_of(self, wanted, parameters)
    descends = False if stable is None else run_options.yes_or_no("stable", stable)
    near = getattr(near, "state", near)
    if along is not None:
        line = family.line_of(model, along)
        model = model.with_parameters(line.at(float(line.asked[0])))
        first = {**(parameters or {}), **line.at(float(line.asked[0]))}
        start = _start(self, near, model, wanted, first, t)
        found = _searched(model, start, descends)
        return family.followed(self, model, layout, line, found.state, lambda m, state: _found(m, state))
    return _searched(model, _start(self, near, model, wanted, parameters, t), descends)


def _start(
    self: Modelled,
    near: Any,
    model: CompiledModel,
    coordinates: str,
    parameters: Mapping[str, ArrayLike] | None,
    t: Quantity | None,
) -> State:
    start = start_of(self, near, model, coordinates, parameters)
    refuse_friction(model)
    if t is None:
        return start
    time = State(run_options.si("t", t, "s"), [], []).t
    return State(time, start.q, start.v, layout=start._layout)


def _searched(model: CompiledModel, start: State, stable: bool) -> Equilibrium:
    """The equilibrium that a search arrives at."""
    return _described(model, start, _rested(model, start, stable))


def _rested(model: CompiledModel, start: State, stable: bool, known: list[Array] | None = None) -> Mapping[str, Any]:
    """The same as numbers, other than the known ones."""
    beside = np.ascontiguousarray(known) if known else np.zeros((0, len(start.q)))
    found: Mapping[str, Any] = model.core.equilibrium(start.t, start.q, stable, beside)
    return found


def _described(model: CompiledModel, start: State, found: Mapping[str, Any]) -> Equilibrium:
    return _found(model, State(start.t, found["q"], np.zeros(model.core.nv), layout=start._layout), found)


def _found(model: CompiledModel, state: State, found: Mapping[str, Any] | None = None) -> Equilibrium:
    """A position of rest, with everything about it."""
    if found is None:
        found = model.core.resting(state.t, state.q)
    about = model.core.linearized(state.t, state.q, state.v, np.zeros((0, len(state.v))), beside=False)
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
            if np.any(curvatures < -EQUAL_IN_SIX_DIGITS * largest):
                stable_here = False
        elif abs(growth) > small:
            stable_here = growth < 0.0
    row = state.v[None, :]
    run = run_of(Run, model, np.array([state.t]), state.q[None, :], row, row, found["multipliers"][None, :])
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


def refuse_friction(model: CompiledModel) -> None:
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

    From each start it searches by Newton's method and down the potential, and then for further ones with those that are
    known removed from the equations (deflation). Angles are drawn from a whole turn, lengths from the size of the
    mechanism and of its springs, stops and tables. Of a continuum of equilibria (`indifferent`) one is listed.

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
    without_holding(self, "equilibria", state=True)
    model, _ = layout_of(self, wanted, parameters)
    start = _start(self, getattr(near, "state", near), model, wanted, parameters, None)
    count, random = run_options.count(starts, "starts"), run_options.generator(seed)
    spread, slides = _spread(model, start)
    wide = np.where(slides, WIDER * spread, spread)
    found: list[Equilibrium] = []
    last = 0
    for i in range(count + 1):
        here = start if i == 0 else _drawn(model, start, spread if i % EVERY else wide, random)
        if here is None:
            continue
        for stable in (False, True):
            if _added(model, here, stable, found, deflated=False):
                last = i
        # beside one of a continuum there are others without end
        while found and i - last <= DEFLATED and not any(one.indifferent for one in found):
            if not _added(model, here, False, found, deflated=True):
                break
            last = i
    return sorted(found, key=lambda one: one.potential)


def _added(model: CompiledModel, start: State, stable: bool, found: list[Equilibrium], *, deflated: bool) -> bool:
    """Whether a search found another equilibrium, which joins the others."""
    known = [other.state.q for other in found]
    try:
        one = _rested(model, start, stable, known if deflated else None)
    except PartitaError:
        return False
    if any(np.abs(model.core.displacement_between(one["q"], q)).max(initial=0.0) <= EQUAL_IN_SIX_DIGITS for q in known):
        return False
    there = _described(model, start, one)
    # of a continuum one is listed
    alike = [other for other in found if other.indifferent and other.indifferent == there.indifferent]
    if there.indifferent and any(model.core.indifferent(start.t, there.state.q, one.state.q) for one in alike):
        return False
    found.append(there)
    return True


def _spread(model: CompiledModel, start: State) -> tuple[Array, NDArray[np.bool_]]:
    """Range of each displacement, and whether it is a length: half a turn, or the size of the mechanism or of its
    springs, stops and tables."""
    names = Names.from_summary(model.summary, model.core.nq, model.core.nv, model.core.rows)
    slides = np.array([unit != "rad/s" for unit in coordinate_units(model.summary, names)[1]], dtype=bool)
    sizes = model.core.characteristic_displacements()
    farthest = max(_lengths(model, start), default=0.0)
    return np.where(slides, np.maximum(sizes, farthest), np.pi * sizes), slides


def _lengths(model: CompiledModel, start: State) -> list[float]:
    """Lengths on which loads depend: of springs, between stops, over which tables are given."""
    joints = {joint["name"]: joint_units(joint)[1] for joint in model.summary["joints"]}

    def slides(along: Mapping[str, Any]) -> bool:
        units = joints.get(along.get("joint", ""), [])
        return along.get("of", "joint") == "joint" and units[along.get("coordinate", 0) :][:1] == ["m"]

    found: list[float] = []
    bodies = model.core.motion(np.array([start.t]), start.q[None], start.v[None]).bodies()
    poses = {
        body["name"]: (bodies["body_position"][0, i], bodies["body_rotation"][0, i])
        for i, body in enumerate(model.summary["bodies"])
    }
    for force in json.loads(model.core.description)["forces"]:
        if force["kind"] == "spring":
            ends = [
                np.array(force[f"point{i}"]) if force[f"body{i}"] not in poses
                else poses[force[f"body{i}"]][0] + poses[force[f"body{i}"]][1] @ np.array(force[f"point{i}"])
                for i in (1, 2)
            ]  # fmt: skip
            found += [float(force["length"]), float(np.linalg.norm(ends[1] - ends[0]))]
        elif slides(force):
            found += [abs(force[key]) for key in ("lower", "upper", "angle") if isinstance(force.get(key), float)]
        table = force["value"].get("table") if isinstance(force.get("value"), dict) else None
        if table and isinstance(force.get("over"), dict) and slides(force["over"]):
            found += [abs(float(x)) for x in (table["breaks"][0], table["breaks"][-1])]
    return found


def _drawn(model: CompiledModel, start: State, spread: Array, random: np.random.Generator) -> State | None:
    """A position drawn at random, its loops closed; None where they do not close from there."""
    by = spread * random.uniform(-1.0, 1.0, len(spread))
    try:
        q = model.core.displaced(start.t, start.q, by[None, :])[0]
    except PartitaError:
        return None
    return State(start.t, q, np.zeros(model.core.nv), layout=start._layout)
