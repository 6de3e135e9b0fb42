"""Families of equilibria over parameters: the straight line of their values, and what the core finds along it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..analyses.equilibrium import Equilibrium
from ..analyses.family import BranchPoint, EquilibriumPath, Fold
from ..builder.compiled import CompiledModel
from ..builder.parameter_units import parameter_unit
from ..errors import ArgumentError, PartitaError
from ..numeric import floats, shown
from ..state import Layout, State
from ..tolerance import EQUAL
from ..units.door import QuantityError, in_si
from .models import Modelled

Array = NDArray[np.float64]
Describe = Callable[[CompiledModel, State], Equilibrium]

BEHIND_FOLD = 1e-4
"""Where the motion off a fold begins. Scale: fraction of the range of the parameter. Reason: forces there are far above
rounding, and the equilibrium that it arrives at is corrected to the fold itself."""


class Line(NamedTuple):
    """Values of parameters along a straight line of x."""

    label: str
    """What x is: the one number that varies, or the fraction of the line."""
    names: list[str]
    origin: list[list[float]]
    slope: list[list[float]]
    asked: Array
    """x of each value asked for."""

    def at(self, x: float) -> dict[str, list[float]]:
        """All parameters at x."""
        return {
            name: [a + x * b for a, b in zip(origin, slope, strict=True)]
            for name, origin, slope in zip(self.names, self.origin, self.slope, strict=True)
        }


def line_of(model: CompiledModel, along: Any) -> Line:
    """The line of the values of `along`; refuses what is none."""
    if not isinstance(along, Mapping) or not along:
        message = f"along must be a dict of parameters and their values, not {shown(along)}"
        raise ArgumentError(message, argument="along")
    rows: list[Array] = []
    widths: list[int] = []
    for name, given in along.items():
        values = _values(model, str(name), given)
        if rows and len(values) != len(rows[0]):
            raise ArgumentError(
                f"along: {name} has {len(values)} values, {next(iter(along))} has {len(rows[0])}; give as many",
                argument="along",
            )
        rows.append(values)
        widths.append(values.shape[1])
    names = [str(name) for name in along]
    every, cuts = np.hstack(rows), np.cumsum(widths)[:-1]
    origin, direction = every[0].copy(), every[-1] - every[0]
    varying = np.flatnonzero(np.ptp(every, axis=0) > 0.0)
    if len(varying) == 1:
        one = int(varying[0])
        label = [f"{name}[{i}]" if w > 1 else name for name, w in zip(names, widths, strict=True) for i in range(w)][
            one
        ]
        x, origin[one], direction = every[:, one], 0.0, np.zeros(len(origin))
        direction[one] = 1.0
    else:
        label = f"{', '.join(names)} (fraction)"
        length = float(direction @ direction)
        x = (every - every[0]) @ direction / length if length else np.zeros(len(every))
        off = np.abs(every - every[0] - x[:, None] * direction).max(axis=1)
        if np.any(off > EQUAL * np.sqrt(length)):
            raise ArgumentError(
                f"along: the values of {', '.join(names)} do not lie on a straight line (row {int(np.argmax(off))} is "
                "off); a family has one parameter: give values proportional to each other, or one path for each part",
                argument="along",
            )
    if len(np.unique(x)) != len(x):
        raise ArgumentError("along: a value is given twice; give each once", argument="along")
    parts = [[part.tolist() for part in np.split(numbers, cuts)] for numbers in (origin, direction)]
    return Line(label, names, parts[0], parts[1], np.ascontiguousarray(x))


def _values(model: CompiledModel, name: str, given: Any) -> Array:
    """(n, numbers of the parameter), in SI units."""
    known = model.core.parameters()
    width = next((len(numbers) for key, numbers in known if key == name), None)
    if width is None:
        model.with_parameters({name: given})  # says which there are
    unit = parameter_unit(model._drawn, name)
    try:
        rows = [in_si(name, row, unit) for row in given] if isinstance(given, (list, tuple)) else given
        values = floats(in_si(name, rows, unit) if isinstance(unit, str) else rows)
    except QuantityError as error:
        raise ArgumentError(str(error), argument="along") from error
    except TypeError:
        message = f"along: values of {name} must be numbers, not {shown(given)}"
        raise ArgumentError(message, argument="along") from None
    if values.ndim == 1 and width == 1:
        values = values[:, None]
    with np.errstate(over="ignore", invalid="ignore"):
        bounded = values.size > 0 and np.isfinite(np.ptp(values))
    if values.ndim != 2 or values.shape[1] != width or len(values) < 2 or not bounded:
        wanted = "(n,)" if width == 1 else f"(n, {width})"
        raise ArgumentError(
            f"along: {name} needs values of shape {wanted}, at least two, all finite; given are {shown(given)}",
            argument="along",
        )
    return values


def followed(
    self: Modelled, model: CompiledModel, layout: Layout, line: Line, start: State, describe: Describe
) -> EquilibriumPath:
    """The family through an equilibrium at the first value."""
    along = list(zip(line.names, line.origin, line.slope, strict=True))
    raw = model.core.equilibrium_family(start.t, start.q, along, float(line.asked[0]), line.asked)
    still = np.zeros(model.core.nv)

    def state_of(q: Array, at: CompiledModel) -> State:
        return State(start.t, np.array(q), still, layout=at._laid_out(layout))

    def described(q: Array, x: float) -> Equilibrium:
        at = model.with_parameters(line.at(x))
        return describe(at, state_of(q, at))

    entries = tuple(described(q, float(x)) for q, x in zip(raw["asked"]["q"], raw["asked"]["x"], strict=True))
    events = raw["events"]
    folds, branchings = [], []
    span = float(np.ptp(line.asked))
    for i, fold in enumerate(raw["fold"]):
        x = float(events["x"][i])
        values = line.at(x)
        state = state_of(events["q"][i], model.with_parameters(values))
        before, after = raw["changes"][i]
        direction = np.asarray(raw["directions"][i])
        moving = model.velocity_names[int(np.argmax(np.abs(direction)))]
        if not fold:
            branchings.append(BranchPoint(x, values, state, moving, direction, before, after))
            continue
        # the parameter goes on where the family turns back
        last = int(np.searchsorted(raw["points"]["s"], events["s"][i])) - 1
        onwards = float(np.sign(x - raw["points"]["x"][last]))

        def snapped(x: float = x, q: Array = state.q, onwards: float = onwards) -> Equilibrium | None:
            return _snapped(model, line, (x, q), onwards * BEHIND_FOLD * span, start.t, described)

        is_end = min(before, after) == 0
        folds.append(Fold(x, values, state, moving, direction, before, after, snapped if is_end else None))
    return EquilibriumPath(
        parameter=line.label,
        asked=line.asked,
        which=np.array(raw["which"], dtype=int),
        equilibria=entries,
        folds=tuple(folds),
        branch_points=tuple(branchings),
        ends=(raw["ends"][0], raw["ends"][1]),
        curve_values=raw["points"]["x"],
        curve_q=raw["points"]["q"],
        curve_negative=np.array(raw["points"]["negative"], dtype=int),
        names=tuple(model.names),
        title=str(model.summary["name"]),
    )


def _snapped(
    model: CompiledModel,
    line: Line,
    fold: tuple[float, Array],
    onwards: float,
    t: float,
    described: Callable[[Array, float], Equilibrium],
) -> Equilibrium | None:
    """The stable equilibrium to which the forces lead from a fold, if they lead to one."""
    x, q = fold
    none = np.zeros((0, len(q)))
    try:
        beyond = model.with_parameters(line.at(x + onwards))
        closed = beyond.core.displaced(t, q, np.zeros((1, model.core.nv)))[0]
        away = beyond.core.equilibrium(t, closed, True, none)["q"]
        here = model.with_parameters(line.at(x))
        closed = here.core.displaced(t, away, np.zeros((1, model.core.nv)))[0]
        return described(here.core.equilibrium(t, closed, True, none)["q"], x)
    except PartitaError:
        return None
