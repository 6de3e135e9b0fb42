"""Families of periodic motions: pseudo-arclength continuation, bifurcations, branches of twice the period.

Unknowns are the variables of a chart, the duration where it is sought, and the parameter, in natural sizes.  The
tangent is the null vector of their equations; a step along it is corrected across it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..analyses.cycle import Cycle
from ..analyses.cycles import Bifurcation, CycleFamily
from ..errors import ArgumentError, PartitaError
from ..numeric import floats, shown
from .algebra import least_seen, least_squares, root
from .family import Line
from .monodromy import Chart, Setting
from .shooting import (
    CLOSED,
    CLOSED_AT_LEAST,
    LONGEST_STEP,
    Kind,
    Returned,
    Start,
    closed,
    equations,
    gone,
    returned,
    run_over,
    taken,
)

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

FIRST_STEP, LARGEST_STEP = 0.05, 0.15
"""Length of the first and of the largest step along a family, in natural sizes and fractions of the values' range."""
SMALLEST_STEP = 1e-7
"""A family whose steps become shorter ends. Scale: as of `FIRST_STEP`. Reason: nothing is found beyond."""
GROWTH, SHRINKAGE = 1.6, 0.5
"""Change of the step after few and after too many corrections."""
CORRECTIONS, FEW, MANY = 16, 5, 9
"""Corrections after a step; after so few the next one is longer, after more than so many shorter."""
SERVES = 0.05
"""Derivatives serve as long as a correction leaves at most this. Scale: fraction of the error before. Reason: a run
costs less than new derivatives."""
FOLLOWED = 0.5
"""A tangent that turns more than this in a step belongs to another family, or the step is too long. Scale: cosine of
the angle. Reason: sixty degrees."""
POSITIONS = 1000
"""Positions of a family."""
LOCATED = 1e-11
"""Bifurcations are located up to this. Scale: length of a step along the family. Reason: the accuracy of the
multipliers."""
ROUGHLY = 1e-4
"""Bifurcations are bracketed up to this before accurate derivatives are used. Scale: length of a step along the
family. Reason: the errors of single differences shift them by less."""
LOCATIONS, REFINEMENTS = 60, 5
"""Iterations of a location, and with accurate derivatives."""
AMPLITUDE = 0.02
"""How far beside a period doubling its branch begins, in natural sizes."""
HALF = 0.5
"""A value asked for is sought from the nearer of two positions. Scale: fraction of the way from one to the other.
Reason: the middle."""
OUTPUTS = 61
"""Outputs of the run over a cycle at each position."""
INSIDE = 1e-9
"""A parameter beyond the values asked for by less is within them. Scale: fraction of their range. Reason: rounding of
given values."""
COMPLEX = 1e-6
"""A multiplier with a smaller imaginary part is not one of a pair. Scale: its imaginary part. Reason: the errors of
single differences where two real ones meet."""


def split(matrix: Array, kind: Kind) -> tuple[ComplexArray, ComplexArray]:
    """Multipliers, the largest first, and those that are 1 by nature."""
    found = np.linalg.eigvals(matrix).astype(complex) if len(matrix) else np.zeros(0, dtype=complex)
    count = 2 if kind.conservative else 1 if kind.free else 0
    order = np.argsort(np.abs(found - 1.0))
    trivial, own = found[order[:count]], found[order[count:]]
    return own[np.lexsort((-own.imag, -np.abs(own)))], trivial


class Followed(NamedTuple):
    """What is followed: the mechanism over the line of its parameters, and the kind of motion."""

    setting: Setting
    kind: Kind
    line: Line
    energy: float | None

    @property
    def span(self) -> float:
        """Natural size of the parameter."""
        return self.setting.size


class Point(NamedTuple):
    """A periodic motion of the family."""

    at: Returned
    tangent: Array
    """In natural sizes, of unit length, onwards."""
    multipliers: ComplexArray

    @property
    def x(self) -> float:
        """The parameter."""
        return self.at.place.x

    @property
    def outside(self) -> int:
        """How many multipliers lie outside of the unit circle."""
        return int(np.sum(np.abs(self.multipliers) > 1.0))


Describe = Callable[[Start, Kind], Cycle]


def point(of: Followed, place: Start, onwards: Array | None, like: Chart | None = None, fine: bool = True) -> Point:
    """The motion at a place with its tangent, in the direction of `onwards` (natural sizes)."""
    at = returned(of.setting, place, of.kind, like, by_x=True, fine=fine)
    return Point(at, tangent(of, at, onwards), split(at.matrix, of.kind)[0])


def tangent(of: Followed, at: Returned, onwards: Array | None) -> Array:
    """Null vector of the equations."""
    system = equations(of.setting, at, of.kind, of.span, of.energy)
    found: Array = least_seen(system.matrix)
    return -found if onwards is not None and found @ onwards < 0.0 else found


def sizes(of: Followed, at: Returned) -> Array:
    """Natural sizes of the unknowns."""
    time = [at.place.period] if of.kind.free and not of.kind.timed else []
    return np.concatenate([at.scales, time, [of.span]])


def corrected(of: Followed, known: Returned, place: Start, row: Array, fine: bool = False) -> tuple[Returned, int]:
    """The motion of the family across `row` (natural sizes) through a place, and the number of corrections: by the
    derivatives of a known motion beside it, and by new ones where these do not serve."""
    at, last = known, np.inf
    for i in range(CORRECTIONS):
        off = gone(of.setting, place, of.kind, at.variables)
        size = float(np.abs(off / at.scales).max(initial=0.0))
        if size <= CLOSED or (size <= CLOSED_AT_LEAST and size >= last):
            return returned(of.setting, place, of.kind, at.variables, by_x=True, fine=fine), i
        if size > SERVES * last:
            at = returned(of.setting, place, of.kind, at.variables, by_x=True)
        last = size
        here = at._replace(place=place, off=off)
        system = equations(of.setting, here, of.kind, of.span, of.energy)
        matrix = np.vstack([system.matrix, row[None, :]])
        step = least_squares(matrix, np.append(system.right, 0.0))
        if np.abs(step).max() > LONGEST_STEP:
            break
        place = taken(of.setting, here, of.kind, step * system.sizes, of.span)
    raise ArgumentError("the next motion of the family was not found", argument="along")


def stepped(of: Followed, start: Point, length: float, fine: bool = False) -> tuple[Returned, int]:
    """The motion so far along the family."""
    change = length * start.tangent * sizes(of, start.at)
    return corrected(of, start.at, taken(of.setting, start.at, of.kind, change, of.span), start.tangent, fine)


class Continuation:
    """One direction along a family."""

    def __init__(self, of: Followed, start: Point) -> None:
        self.of, self.points = of, [start]
        self.lengths: list[float] = []
        self.end = ""
        asked = of.line.asked
        slack = INSIDE * of.span
        self.low, self.high = float(asked.min()) - slack, float(asked.max()) + slack

    def go(self) -> None:
        """Follow the family until it ends."""
        length = FIRST_STEP
        while len(self.points) < POSITIONS:
            last = self.points[-1]
            try:
                at, count = stepped(self.of, last, length)
                secant = self._between(last, at)
                new = Point(at, tangent(self.of, at, secant), split(at.matrix, self.of.kind)[0])
                turns = float(new.tangent @ last.tangent) if at.variables.width == last.at.variables.width else 1.0
                if turns < FOLLOWED:
                    raise ArgumentError("the family turns within the step", argument="along")
            except PartitaError as error:
                length *= SHRINKAGE
                if length < SMALLEST_STEP:
                    self.end = f"at {last.x:.6g} no further motion was found ({error})"
                    return
                continue
            self.points.append(new)
            self.lengths.append(length)
            if not self.low <= new.x <= self.high:
                bound = self.high if new.x > self.high else self.low
                self.end = f"the value {bound:.6g} is reached"
                return
            if count <= FEW:
                length = min(GROWTH * length, LARGEST_STEP)
            elif count > MANY:
                length *= SHRINKAGE
        self.end = f"after {POSITIONS} positions"

    def _between(self, last: Point, at: Returned) -> Array:
        """From one position to the next, in natural sizes."""
        model = self.of.setting.model_at(at.place.x)
        change = [at.variables.between(model, last.at.place.state, at.place.state)]
        if self.of.kind.free and not self.of.kind.timed:
            change.append(np.array([at.place.period - last.at.place.period]))
        change.append(np.array([at.place.x - last.x]))
        return np.concatenate(change) / sizes(self.of, at)

    def passages(self) -> list[tuple[float, int, Start]]:
        """(place along the path, index of the value, guess of the motion) where values asked for are passed."""
        found = []
        for i, (a, b) in enumerate(zip(self.points, self.points[1:], strict=False)):
            for j, x in enumerate(self.of.line.asked):
                if (a.x - x) * (b.x - x) < 0.0 or (b.x == x != a.x):
                    part = (x - a.x) / (b.x - a.x)
                    near, end = (a, 1.0) if part < HALF else (b, -1.0)  # from the nearer one, along its own tangent
                    share = part if end > 0.0 else part - 1.0
                    place = taken(
                        self.of.setting,
                        near.at,
                        self.of.kind,
                        share * self.lengths[i] * near.tangent * sizes(self.of, near.at),
                        self.of.span,
                    )
                    only = np.zeros(len(near.tangent))
                    only[-1] = x - place.x
                    moved = taken(self.of.setting, near.at._replace(place=place), self.of.kind, only, self.of.span)
                    found.append((i + part, j, moved._replace(x=float(x))))
        return found

    def located(self) -> list[tuple[float, str, Point, Point, Point]]:
        """(place along the path, what, before, there, after) of all bifurcations within the range."""
        found = []
        for i, (a, b) in enumerate(zip(self.points, self.points[1:], strict=False)):
            for what, test in TESTS.items():
                if what == "branch point" and a.tangent[-1] * b.tangent[-1] < 0.0:
                    continue
                if test(a) * test(b) >= 0.0:
                    continue
                there = self._root(a, self.lengths[i], test)
                if there is None or not self.low <= there[1].x <= self.high:
                    continue
                pair = np.abs(there[1].multipliers.imag).max(initial=0.0) > COMPLEX
                if what == "Neimark-Sacker" and not (pair and abs(b.outside - a.outside) == 2):
                    continue
                found.append((i + there[0] / self.lengths[i], what, a, there[1], b))
        return sorted(found, key=lambda one: one[0])

    def _root(self, a: Point, length: float, test: Callable[[Point], float]) -> tuple[float, Point] | None:
        """Where a test is zero between a position and the next."""

        def at(s: float, fine: bool) -> Point:
            found, _ = stepped(self.of, a, s, fine=fine)
            return Point(found, tangent(self.of, found, a.tangent), split(found.matrix, self.of.kind)[0])

        step = ROUGHLY * length
        try:
            s = root(lambda s: test(at(s, False)), 0.0, length, step, LOCATIONS)
            # the derivatives of the search have an error of their own: secants with accurate ones
            before, there = at(s, True), at(s + step, True)
            s += step
            for _ in range(REFINEMENTS):
                if test(there) == test(before) or abs(step) <= LOCATED * length:
                    break
                step *= test(there) / (test(before) - test(there))
                s += step
                before, there = there, at(s, True)
        except (PartitaError, ValueError, RuntimeError):
            return None
        return s, there


def _doubling(p: Point) -> float:
    return float(np.prod(p.multipliers + 1.0).real)


def _branching(p: Point) -> float:
    return float(np.prod(p.multipliers - 1.0).real)


def _torus(p: Point) -> float:
    x = p.multipliers
    pairs = [x[i] * x[j] - 1.0 for i in range(len(x)) for j in range(i)]
    return float(np.prod(pairs).real) if pairs else 1.0


TESTS: dict[str, Callable[[Point], float]] = {
    "fold": lambda p: float(p.tangent[-1]),
    "period doubling": _doubling,
    "branch point": _branching,
    "Neimark-Sacker": _torus,
}


def followed(of: Followed, start: Start, describe: Describe) -> CycleFamily:
    """The family through a motion at the first value: towards the others, both ways if they lie on both sides."""
    asked = of.line.asked
    first = point(of, start, None, fine=False)
    rest = asked - start.x
    signs = [sign for sign in (1.0, -1.0) if np.any(sign * rest > 0.0)]
    paths: list[Continuation] = []
    for sign in sorted(signs, key=lambda sign: -np.abs(rest[sign * rest > 0.0]).max()):
        towards = first.tangent if first.tangent[-1] * sign >= 0.0 else -first.tangent
        path = Continuation(of, first._replace(tangent=towards))
        path.go()
        paths.append(path)
    begins = "it begins at the first value" if len(paths) == 1 else paths[1].end
    index = int(np.flatnonzero(asked == start.x)[0])
    return _collected(of, paths, describe, [(0.0, index, start)], begins)


def _collected(
    of: Followed, paths: list[Continuation], describe: Describe, known: list[tuple[float, int, Start]], begins: str
) -> CycleFamily:
    """All paths as one family, the second one backwards in front of the first."""
    entries, special, points = list(known), [], []
    for path, sign in zip(paths, (1.0, -1.0), strict=False):
        inside = [p for p in path.points if path.low <= p.x <= path.high]
        points += [(sign * i, p) for i, p in enumerate(inside) if i or sign > 0.0]
        for s, j, guess in path.passages():
            try:
                entries.append((sign * s, j, closed(of.setting, guess, of.kind, energy=of.energy)[0]))
            except PartitaError:
                continue  # the value is told as missed
        for s, what, a, there, b in path.located():
            a, b = (a, b) if sign > 0.0 else (b, a)
            special.append((sign * s, _described(of, what, a, there, b, describe)))
    entries.sort(key=lambda one: one[0])
    points.sort(key=lambda one: one[0])
    special.sort(key=lambda one: one[0])
    curve = [p for _, p in points]
    runs = tuple(run_over(of.setting, p.at.place, of.kind, OUTPUTS) for p in curve)
    model = of.setting.model_at(curve[0].x)
    return CycleFamily(
        parameter=of.line.label,
        asked=of.line.asked,
        which=np.array([j for _, j, _ in entries], dtype=int),
        cycles=tuple(describe(place, of.kind) for _, _, place in entries),
        bifurcations=tuple(one for _, one in special),
        ends=(begins, paths[0].end),
        curve_values=np.array([p.x for p in curve]),
        curve_periods=np.array([p.at.place.period * of.kind.periods for p in curve]),
        curve=runs,
        curve_multipliers=np.array([p.multipliers for p in curve]),
        names=tuple(model.names),
        title=str(model.summary["name"]),
    )


def _described(of: Followed, what: str, a: Point, there: Point, b: Point, describe: Describe) -> Bifurcation:
    target = {"period doubling": there.multipliers + 1.0, "Neimark-Sacker": np.abs(there.multipliers) - 1.0}
    off = target.get(what, there.multipliers - 1.0)
    if what == "Neimark-Sacker":
        off = np.where(there.multipliers.imag > 0.0, off, np.inf)
    crossing = complex(there.multipliers[int(np.argmin(np.abs(off)))])

    def branch(values: ArrayLike | None) -> CycleFamily:
        return doubled(of, there, values, describe)

    return Bifurcation(
        what=what,
        value=there.x,
        parameters=of.line.at(there.x),
        cycle=describe(there.at.place, of.kind),
        multiplier=crossing,
        before=a.outside,
        after=b.outside,
        _branch=branch if what == "period doubling" else None,
    )


def doubled(of: Followed, there: Point, values: ArrayLike | None, describe: Describe) -> CycleFamily:
    """The family of twice the period that begins at a period doubling, along the eigenvector of -1."""
    line = of.line if values is None else of.line._replace(asked=_values(values))
    twice = of._replace(kind=of.kind._replace(periods=2 * of.kind.periods), line=line)
    place = there.at.place
    at = returned(of.setting, place, twice.kind, there.at.variables, by_x=True, fine=True)
    own, vectors = np.linalg.eig(there.at.matrix)
    scales = at.scales
    direction = vectors[:, int(np.argmin(np.abs(own + 1.0)))].real / scales
    row = np.zeros(len(sizes(twice, at)))
    row[: len(direction)] = direction / np.linalg.norm(direction)
    begun = taken(twice.setting, at, twice.kind, AMPLITUDE * row * sizes(twice, at), twice.span)
    # its equations at the doubling itself are singular
    beside = returned(of.setting, begun, twice.kind, at.variables, by_x=True)
    found, _ = corrected(twice, beside, begun, row)
    start = Point(found, tangent(twice, found, row), split(found.matrix, twice.kind)[0])
    path = Continuation(twice, start)
    # a value just beside the doubling may lie outside of what was asked for
    path.low, path.high = min(path.low, start.x), max(path.high, start.x)
    path.go()
    return _collected(twice, [path], describe, [], f"it leaves the period doubling at {there.x:.10g}")


def _values(values: Any) -> Array:
    try:
        found = floats(values)
    except TypeError:
        raise ArgumentError(f"values must be numbers, not {shown(values)}", argument="values") from None
    if found.ndim != 1 or not len(found) or not np.all(np.isfinite(found)):
        raise ArgumentError(f"values must be a flat array of finite numbers, not {shown(values)}", argument="values")
    return np.ascontiguousarray(found)
