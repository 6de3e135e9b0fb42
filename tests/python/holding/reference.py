"""What holds, by brute force: a program that decides by looking at every combination of what may stick, press or carry.

The equations of the mechanism without its elements are taken as they are (`oracle` checks them). All else is its own:
steps of an integrator of SciPy, looked at five times in each; instants located by bisection; impacts and what holds
from there on by trying every combination.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import DOP853
from scipy.optimize import brentq, linprog

import partita as pt

Array = NDArray[np.float64]
Magnitude = float | Callable[[float], float]
Along = tuple[str, int]
"""A coordinate: joint and number."""

NONE = 1e-8
"""Forces and accelerations below this are none. Unit: N, N m, m/s^2, rad/s^2. Reason: ten times what locating
leaves."""
EARLY = 1e-9
"""What is followed has ended below minus this. Unit: as above. Reason: rounding of what holds is less."""
SLOW = 1e-3
"""Slower impacts do not bounce. Unit: m/s or rad/s. Reason: what bounces without end comes to rest soon."""
MOST = 3000
"""Instants of a run. Unit: number. Reason: what bounces without end takes some dozens."""


class NotDecided(Exception):
    """The program does not know how the motion goes on."""


@dataclass(frozen=True)
class Element:
    """Friction, freewheel, latch or stop of one coordinate."""

    kind: str
    name: str
    along: Along
    dynamic: Magnitude = 0.0
    static: Magnitude | None = None
    sense: int = 1
    """Free sense of a freewheel; of a latch that in which it closes."""
    at: float = 0.0
    lower: float | None = None
    upper: float | None = None
    restitution: float = 0.0
    by_event: bool = False
    """Whether a stop is drawn as an event with `pt.Stop`."""

    def sliding(self, t: float) -> float:
        return self.dynamic(t) if callable(self.dynamic) else self.dynamic

    def sticking(self, t: float) -> float:
        most = self.dynamic if self.static is None else self.static
        return most(t) if callable(most) else most

    @property
    def bounds(self) -> list[tuple[float, int]]:
        """Of a stop: where it is, and the sense in which it pushes."""
        both = ((self.upper, -1), (self.lower, 1))
        return [(x, sense) for x, sense in both if x is not None]


@dataclass(frozen=True)
class Action:
    """At a time: "lock", "release" or "rate" of a coordinate, or "effort" along it, with a value."""

    t: float
    what: str
    along: Along
    value: float = 0.0


@dataclass
class Mode:
    """What is locked, the efforts, and for each element: 0 it sticks or is open, 1 it carries; for frictions that slip
    and stops that press the sign of the rate or of the side."""

    state: list[int]
    locked: set[Along] = field(default_factory=set)
    efforts: dict[Along, float] = field(default_factory=dict)

    def copy(self) -> Mode:
        return Mode(list(self.state), set(self.locked), dict(self.efforts))


@dataclass
class Held:
    """Rows that are held in a mode, forces along others, and what the forces of some of them may be."""

    rows: list[int]
    applied: list[tuple[int, float]]
    most: dict[int, float]
    """Largest magnitude, by the place among the rows."""
    senses: dict[int, int]
    """Sign that the force must have."""


class Reference:
    """A mechanism without its elements, these, and what is done at given times."""

    def __init__(self, plain: pt.Mechanism, elements: Sequence[Element], actions: Sequence[Action] = ()) -> None:
        self.elements, self.actions = list(elements), sorted(actions, key=lambda x: x.t)
        self.coordinates: list[Along] = list(dict.fromkeys([*(x.along for x in elements), *(x.along for x in actions)]))
        drives = [
            {
                "name": f"row {i}",
                "measure": {"of": "joint", "joint": joint, "coordinate": number},
                "motion": {"constant": 0.0},
                "level": "velocity",
            }
            for i, (joint, number) in enumerate(self.coordinates)
        ]
        model = plain.compile()
        self.model: Any = model._with_more_drives(drives, {}) if drives else model
        names = self.model.row_names
        self.own = [names.index(f"drive row {i}") for i in range(len(drives))]
        self.always = [k for k in range(len(names)) if k not in self.own]
        self.n = len(self.model.velocity_names)
        assert self.n == len(self.model.names)
        self.several = False
        """Whether more than one combination was possible somewhere."""
        self.log: list[tuple[float, str, str]] = []

    def row(self, along: Along) -> int:
        return self.own[self.coordinates.index(along)]

    def parts(self, y: Array) -> tuple[Array, Array, Array]:
        """Coordinates, velocities, and the coordinates that elements act along."""
        return y[: self.n], y[self.n : 2 * self.n], y[2 * self.n :]

    def terms(self, t: float, q: Array, v: Array) -> tuple[Array, ...]:
        m = self.model
        return m.mass_matrix(q, t=t), m.forces(q, v, t=t), m.jacobian(q, t=t), m.bias(q, v, t=t), m.rate(q, t=t)

    def held(self, mode: Mode, t: float) -> Held:
        found = Held(list(self.always), [], {}, {})
        found.rows += [self.row(along) for along in mode.locked]
        found.applied += [(self.row(along), effort) for along, effort in mode.efforts.items()]
        for x, state in zip(self.elements, mode.state, strict=True):
            row = self.row(x.along)
            if x.kind == "friction" and state:
                found.applied.append((row, -state * x.sliding(t)))
            elif x.kind == "friction":
                found.most[len(found.rows)] = x.sticking(t)
                found.rows.append(row)
            elif x.kind in ("freewheel", "stop") and state:
                found.senses[len(found.rows)] = x.sense if x.kind == "freewheel" else -state
                found.rows.append(row)
        return found

    def accelerations(self, terms: tuple[Array, ...], held: Held) -> tuple[Array, Array]:
        """Accelerations, and some forces that make them, of the rows that are held."""
        mass, force, c, b, _ = terms
        force = force + sum((c[row] * x for row, x in held.applied), np.zeros(self.n))
        inverse = np.linalg.inv(mass)
        free, rows = inverse @ force, c[held.rows]
        if not held.rows:
            return free, np.zeros(0)
        forces = np.linalg.pinv(rows @ inverse @ rows.T, rcond=1e-11, hermitian=True) @ (-b[held.rows] - rows @ free)
        return free + inverse @ rows.T @ forces, forces

    def lacks(self, c: Array, held: Held, forces: Array) -> float:
        """How far all forces that make these accelerations are from what they may be: at most zero where some may."""
        if not held.most and not held.senses:
            return -np.inf
        rows = c[held.rows]

        def least(x: Array) -> float:
            over = [abs(x[i]) - most for i, most in held.most.items()]
            return max(over + [-sense * x[i] for i, sense in held.senses.items()])

        rank = np.linalg.matrix_rank(rows @ rows.T, tol=1e-10)
        if rank == len(rows):
            return least(forces)
        open_ = np.linalg.svd(rows.T)[2][rank:]
        if np.abs(open_[:, [*held.most, *held.senses]]).max() < 1e-8:
            return least(forces)
        k, left, right = len(open_), [], []
        for i, most in held.most.items():
            for sign in (1, -1):
                left.append([*(sign * open_[:, i]), -1.0])
                right.append(most - sign * forces[i])
        for i, sense in held.senses.items():
            left.append([*(-sense * open_[:, i]), -1.0])
            right.append(sense * forces[i])
        any_ = [(None, None)] * k + [(-1e3, None)]
        found = linprog([0.0] * k + [1.0], A_ub=left, b_ub=right, bounds=any_, method="highs")
        return float(found.fun) if found.status == 0 else np.inf

    def followed(self, t: float, y: Array, mode: Mode) -> Array:
        """Numbers that are positive while a mode lasts: what the forces may be, then one or two for each element."""
        q, v, s = self.parts(y)
        terms = self.terms(t, q, v)
        rates, held = terms[2] @ v + terms[4], self.held(mode, t)
        found = [-self.lacks(terms[2], held, self.accelerations(terms, held)[1])]
        for x, state in zip(self.elements, mode.state, strict=True):
            at, rate = s[self.coordinates.index(x.along)], rates[self.row(x.along)]
            if x.kind == "friction":
                found.append(state * rate if state else 1.0)
            elif x.kind == "freewheel":
                found.append(1.0 if state else x.sense * rate)
            elif x.kind == "latch":
                found.append(1.0 if x.along in mode.locked else x.sense * (x.at - at))
            else:
                found.append(x.upper - at if x.upper is not None and state <= 0 else 1.0)
                found.append(at - x.lower if x.lower is not None and state >= 0 else 1.0)
        return np.array(found)

    def indices(self) -> list[int]:
        """The element of each number that is followed, after the first one."""
        return [i for i, x in enumerate(self.elements) for _ in range(2 if x.kind == "stop" else 1)]

    def velocities(self, t: float, y: Array, mode: Mode, rates: dict[Along, float]) -> tuple[Array, set[int]]:
        """Velocities after an instant, and the elements that were hit: Newton's law, Moreau's least change."""
        q, v, s = self.parts(y)
        mass, _, c, _, a = self.terms(t, q, v)
        inverse = np.linalg.inv(mass)
        sides: list[tuple[int, int, float, int]] = []
        for i, x in enumerate(self.elements):
            row, at = self.row(x.along), s[self.coordinates.index(x.along)]
            if x.kind == "freewheel":
                sides.append((row, x.sense, 0.0, i))
            elif x.kind == "stop":
                sides += [(row, sense, x.restitution, i) for bound, sense in x.bounds if sense * (at - bound) < 1e-8]
        lasting = [*self.always, *(self.row(along) for along in mode.locked)]
        wanted = [(row, 0.0) for row in lasting] + [(self.row(along), rate) for along, rate in rates.items()]

        def to(start: Array, given: list[tuple[int, float]]) -> tuple[Array, Array] | None:
            if not given:
                return start.copy(), np.zeros(0)
            rows, values = [x[0] for x in given], np.array([x[1] for x in given])
            part = c[rows]
            impulses = np.linalg.pinv(part @ inverse @ part.T, rcond=1e-11, hermitian=True) @ (
                values - a[rows] - part @ start
            )
            w = start + inverse @ part.T @ impulses
            met = np.abs(part @ w + a[rows] - values).max() <= 1e-7 * (1.0 + np.abs(values).max())
            return (w, impulses) if met else None

        def bounced(start: Array, given: list[tuple[int, float]], met: Array, part: float) -> Array | None:
            low = []
            for row, sense, e, _ in sides:
                rate = min(sense * (c[row] @ met + a[row]), 0.0)
                low.append(-part * (e if abs(rate) >= SLOW else 0.0) * rate)
            for n in range(len(sides) + 1):
                for pick in itertools.combinations(range(len(sides)), n):
                    found = to(start, [*given, *((sides[p][0], sides[p][1] * low[p]) for p in pick)])
                    if found is None:
                        continue
                    w, impulses = found
                    after = c @ w + a
                    opens = all(
                        sense * after[row] >= x - 1e-9 for (row, sense, _, _), x in zip(sides, low, strict=True)
                    )
                    pushes = all(sides[p][1] * impulses[len(given) + k] >= -1e-9 for k, p in enumerate(pick))
                    if opens and pushes:
                        return w
            return None

        def closing(x: Array) -> set[int]:
            return {i for row, sense, _, i in sides if sense * (c[row] @ x + a[row]) < -1e-9}

        idle = not np.any(a)

        def largest(start: Array, given: list[tuple[int, float]], met: Array) -> Array | None:
            """With the largest part of the bounces that can be and brings no energy."""
            most, own = met @ mass @ met, idle and not any(x[1] for x in given)

            def may_be(w: Array | None, room: float) -> bool:
                return w is not None and not (own and w @ mass @ w > most * (1.0 + room) + 1e-14)

            w = bounced(start, given, met, 1.0)
            if may_be(w, 1e-9):
                return w
            low, high = 0.0, 1.0
            for _ in range(45):
                middle = 0.5 * (low + high)
                if may_be(bounced(start, given, met, middle), 1e-12):
                    low = middle
                else:
                    high = middle
            return bounced(start, given, met, low)

        first = to(v, wanted)
        if first is None:
            raise NotDecided("rates contradict each other")
        met = first[0]
        hit = closing(met)
        w = largest(v, wanted, met)
        if w is None and rates:
            # what is set into something bounces off it
            then = to(met, wanted[: len(lasting)])
            assert then is not None
            hit |= closing(then[0])
            w = largest(met, wanted[: len(lasting)], then[0])
        if w is None:
            raise NotDecided("no velocities")
        return w, hit

    def changed(
        self, t: float, y: Array, mode: Mode, rates: dict[Along, float], rests: int | None = None
    ) -> tuple[Array, Mode]:
        """State and mode after an instant; `rests`: a friction that has just come to rest."""
        v, hit = self.velocities(t, y, mode, rates)
        q, _, s = self.parts(y)
        self.log += [(t, self.elements[i].name, "hit") for i in hit]
        terms = self.terms(t, q, v)
        c, b, a = terms[2:]
        now, state, open_ = c @ v + a, list(mode.state), list[tuple[int, tuple[int, ...]]]()
        for i, x in enumerate(self.elements):
            rate, at = now[self.row(x.along)], s[self.coordinates.index(x.along)]
            if x.kind == "friction":
                if abs(rate) > 1e-8 and not (rests == i and abs(rate) < 1e-5):
                    state[i] = int(np.sign(rate))
                else:
                    open_.append((i, (0, 1, -1)))
            elif x.kind == "freewheel" and x.sense * rate > 1e-8:
                state[i] = 0
            elif x.kind == "freewheel":
                open_.append((i, (1, 0)))
            elif x.kind == "stop":
                state[i] = 0
                near = [sense for bound, sense in x.bounds if sense * (at - bound) < 1e-8 and sense * rate < 1e-7]
                open_ += [(i, (-sense, 0)) for sense in near]

        def sticks(combination: tuple[int, ...]) -> int:
            kinds = (self.elements[i].kind for i, _ in open_)
            return sum(kind == "friction" and not x for kind, x in zip(kinds, combination, strict=True))

        found: list[tuple[Array, list[int]]] = []
        for combination in sorted(itertools.product(*(x[1] for x in open_)), key=sticks, reverse=True):
            trial = Mode(list(state), mode.locked, mode.efforts)
            for (i, _), one in zip(open_, combination, strict=True):
                trial.state[i] = one
            held = self.held(trial, t)
            vdot, forces = self.accelerations(terms, held)
            off = np.abs(c[held.rows] @ vdot + b[held.rows]).max(initial=0.0)
            if off > 1e-6 * (1.0 + np.abs(b[held.rows]).max(initial=0.0) + np.abs(vdot).max()):
                continue
            if self.lacks(c, held, forces) <= NONE and self.agrees(open_, combination, c @ vdot + b, s):
                found.append((vdot, trial.state))
        if not found:
            raise NotDecided(f"no combination at {t}")
        first = found[0][0]
        self.several |= any(np.abs(x[0] - first).max() > 1e-5 * (1.0 + np.abs(first).max()) for x in found[1:])
        for x, before, after in zip(self.elements, mode.state, found[0][1], strict=True):
            if before != after:
                self.log.append((t, x.name, f"{before} -> {after}"))
        return np.concatenate([q, v, s]), Mode(found[0][1], mode.locked, mode.efforts)

    def agrees(
        self, open_: Sequence[tuple[int, tuple[int, ...]]], combination: Sequence[int], bends: Array, s: Array
    ) -> bool:
        """Whether these accelerations move what slips as its force says, and nothing into what is open."""
        for (i, _), state in zip(open_, combination, strict=True):
            x = self.elements[i]
            bend, at = bends[self.row(x.along)], s[self.coordinates.index(x.along)]
            if x.kind == "friction" and state and state * bend <= NONE:
                return False
            if x.kind == "freewheel" and not state and x.sense * bend < -NONE:
                return False
            if x.kind == "stop" and not state:
                sense = 1 if x.lower is not None and abs(at - x.lower) < 1e-7 else -1
                if sense * bend < -NONE:
                    return False
        return True

    def slope(self, t: float, y: Array, mode: Mode) -> Array:
        q, v, _ = self.parts(y)
        terms = self.terms(t, q, v)
        rates = terms[2] @ v + terms[4]
        return np.concatenate([v, self.accelerations(terms, self.held(mode, t))[0], rates[self.own]])

    def run(
        self, end: float, q: Array, v: Array, times: Sequence[float], efforts: dict[Along, float]
    ) -> dict[float, Array]:
        """States at these times, that after an instant; the last numbers are those of `coordinates`, from zero."""
        mode = Mode([0] * len(self.elements), set(), dict(efforts))
        t = 0.0
        y, mode = self.changed(t, np.concatenate([q, v, np.zeros(len(self.coordinates))]), mode, {})
        found = {x: y for x in times if x == 0.0}
        goals = sorted({x.t for x in self.actions} | {end})
        for _ in range(MOST):
            goal = next(x for x in goals if x > t)
            t, y, mode = self.until(t, y, mode, goal, times, found)
            if t == end:
                return found
        raise NotDecided("too many instants")

    def until(
        self, t: float, y: Array, mode: Mode, goal: float, times: Sequence[float], found: dict[float, Array]
    ) -> tuple[float, Array, Mode]:
        """On to the next instant at which something changes, or to `goal`."""
        latches = [1 + k for k, i in enumerate(self.indices()) if self.elements[i].kind == "latch"]
        last = (t, self.followed(t, y, mode))
        solver = DOP853(lambda x, y: self.slope(x, y, mode), t, y, goal, rtol=1e-9, atol=1e-11, max_step=0.02)
        while solver.status == "running":
            solver.step()
            if solver.status == "failed":
                raise NotDecided("the integrator fails")
            dense, happens = solver.dense_output(), None
            for x in np.linspace(solver.t_old, solver.t, 6)[1:]:
                g = self.followed(x, dense(x), mode)
                ended = [k for k in range(len(g)) if g[k] < -EARLY and (last[1][k] > EARLY or k not in latches)]
                if ended:
                    happens = min((self.located(dense, mode, k, last, x), k) for k in ended)
                    break
                last = (x, g)
            until = solver.t if happens is None else happens[0]
            found |= {x: dense(x) for x in times if solver.t_old < x <= until}
            if happens is not None:
                return self.passed(dense, mode, *happens, solver.t)
        y = np.asarray(solver.y)
        new, rates, acts = mode.copy(), dict[Along, float](), [x for x in self.actions if x.t == goal]
        for action in acts:
            match action.what:
                case "lock":
                    new.locked.add(action.along)
                case "release":
                    new.locked.discard(action.along)
                case "effort":
                    new.efforts[action.along] = action.value
                case _:
                    rates[action.along] = action.value
        if acts:
            y, new = self.changed(goal, y, new, rates)
            found |= {goal: y} if goal in found else {}
        return goal, y, new

    def located(self, dense: Any, mode: Mode, k: int, last: tuple[float, Array], x: float) -> float:
        """When a number that is followed passed zero."""
        low = last[0]
        if last[1][k] <= 0.0:
            # what begins on zero may have left it, and come back since
            inside = (low + (x - low) * 0.5**i for i in range(1, 40))
            away = next((t for t in inside if self.followed(t, dense(t), mode)[k] > 0.0), None)
            if away is None:
                return low
            low = away
        try:
            return float(brentq(lambda t: self.followed(t, dense(t), mode)[k], low, x, xtol=1e-13))
        except ValueError:
            return x

    def passed(self, dense: Any, mode: Mode, t: float, k: int, end: float) -> tuple[float, Array, Mode]:
        """State and mode after the instant at which number k passed zero."""
        y, new, rests = np.array(dense(t)), mode.copy(), None
        if k == 0:
            # a little later, where it is clearly beyond
            h = 1e-9
            while h < 1e-3 and t + h < end and self.followed(t + h, dense(t + h), mode)[0] >= -3.0 * NONE:
                h *= 3.0
            t, y = t + h, np.array(dense(t + h))
        else:
            i = self.indices()[k - 1]
            x = self.elements[i]
            if x.kind == "friction":
                rests = i
            elif x.kind == "latch":
                new.locked.add(x.along)
            elif x.kind == "stop":
                is_upper = self.indices().index(i) == k - 1
                bound = x.upper if is_upper else x.lower
                assert bound is not None
                y[2 * self.n + self.coordinates.index(x.along)] = bound
        y, new = self.changed(t, y, new, {}, rests)
        return t, y, new
