"""What one log, or random states, say of the parameters of a mechanism: the motion, the regressor, the rank."""

from __future__ import annotations

import copy
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..analyses.identification import SHARP, Combination, Identifiability
from ..builder.changes import remove
from ..builder.compiled import CompiledModel
from ..builder.regression import least_squares, regressor
from ..errors import ArgumentError, SingularityError, UnknownNameError
from ..naming import listed
from ..numeric import is_list, shown
from ..state import State
from ..tolerance import LEAST_DIVISOR
from .goals import goals_of, units_of
from .identified import GRAVITY, Parameters, parameters_of
from .inverse import inverse_dynamics
from .kinematics import kinematics
from .logs import Channel, Courses, Filter, channel_of, courses_of, differentiated, times_of
from .models import Modelled, layout_of
from .set_valued import without_holding
from .solve import assemble

Array = NDArray[np.float64]
SEED = 1
"""Seed of random states."""
RICH_STATES = 2
"""Random states for each parameter."""
FEWEST_STATES = 60
"""Random states, at least."""
ATTEMPTS = 5
"""Rounds in which random positions are tried until enough of them close."""
HALF_RANGE = 0.35
"""Half of the range of random positions. Unit: rad, or a length of the mechanism. Reason: most mechanisms stay on their
branch."""


@dataclass(frozen=True)
class MeasuredMotion:
    """A measured motion: coordinates, their rates and accelerations (nt, k)."""

    t: Array
    timed: bool
    names: tuple[str, ...]
    levels: tuple[Array, Array, Array]
    notes: tuple[str, ...] = ()
    ends: int = 0
    """Samples at each end whose rates and accelerations are less exact than the others."""


@dataclass(frozen=True)
class ClosedMotion:
    """States on the mechanism: t, q, v, v', and which of the samples were reached."""

    t: Array
    q: Array
    v: Array
    vdot: Array
    names: Any
    coordinates: tuple[str, ...]


@dataclass(frozen=True)
class Evaluated:
    """Values of channels and their derivatives along states."""

    values: Array
    derivatives: Array


class RegressionStudy:
    """A mechanism without drives, its actuators and its parameters."""

    def __init__(self, mechanism: Modelled, actuators: Any, parameters: Any, near: State | None, by: Any) -> None:
        without_holding(mechanism, "identify", state=True)
        self.title = mechanism._description.name
        self.given: CompiledModel = layout_of(mechanism, "relative", parameters)[0]
        if mechanism._description.drives:
            if actuators is None:
                _, chosen = layout_of(mechanism, "relative")[0]._with_actuators(None)
                actuators = [each.name for each in chosen]
            mechanism = copy.deepcopy(mechanism)
            for name in list(mechanism._description.drives):
                remove(mechanism, "drives", name)
        elif actuators is None:
            raise ArgumentError(
                "actuators: the mechanism has no drives, so name the actuators: joints or their coordinates, such as "
                "actuators=['A']",
                argument="actuators",
            )
        self.mechanism, self.near, self.prior = mechanism, near, parameters
        self.model: CompiledModel = layout_of(mechanism, "relative", parameters)[0]
        self.inverse, self.actuators = self.model._with_actuators(actuators)
        self.parameters = parameters_of(self.model, by)
        self.start = assemble(mechanism, near=near, parameters=parameters)
        dof, idle = self.model.core.degrees_of_freedom(self.start.t, self.start.q)
        self.k = dof - idle

    def channels(self, measured: Iterable[str] | None, columns: Mapping[str, Array] | None) -> list[Channel]:
        """The named channels; None: those among the columns, or the efforts of all actuators."""
        if measured is None:
            names = [f"effort.{each.name}" for each in self.actuators] if columns is None else list(columns)
            found = [channel_of(name, self.actuators, self.model) for name in names]
            return _distinct([x for x in found if x is not None])
        if isinstance(measured, str) or not is_list(measured):
            raise ArgumentError(
                f"measured must be a list of names such as ['effort.A'], not {shown(measured)}", argument="measured"
            )
        chosen = []
        for name in map(str, measured):
            channel = channel_of(name, self.actuators, self.model)
            if channel is None or (columns is not None and name not in columns):
                known = [f"effort.{each.name}" for each in self.actuators]
                raise UnknownNameError(
                    f"measured: {name!r} is {'no column of the data' if channel else 'no effort and no force'}; there "
                    f"are {listed(known)}, 'ground.force.x' to 'ground.moment.z', and those of joints, such as "
                    "'joint.A.force.x'",
                    name=name,
                    known=known if columns is None else list(columns),
                )
            chosen.append(channel)
        if not chosen:
            raise ArgumentError("measured is empty; name at least one channel", argument="measured")
        return _distinct(chosen)

    def motion(self, columns: Mapping[str, Array], positions: Any, low_pass: Filter | None) -> MeasuredMotion:
        """The motion in a table."""
        known = courses_of(columns, self.model)
        chosen, notes = self._chosen(known, positions), []
        t = times_of(columns)
        if t is not None:
            _finite("times", t)
        levels: list[list[Array]] = [[], [], []]
        computed = []
        for course in chosen:
            position, rate, acceleration = course.levels
            assert position is not None
            _finite(f"positions of {course.name}", position)
            if low_pass is not None:
                position = low_pass.smooth(position)
            if rate is None or acceleration is None:
                if t is None or len(t) <= _SPLINE_POINTS or not np.all(np.diff(t) > 0.0):
                    raise ArgumentError(
                        f"data: joint.{course.name}.velocity and .acceleration are no columns, and cannot be computed: "
                        f"that takes more than {_SPLINE_POINTS} times that increase, in column 't'",
                        argument="data",
                    )
                computed.append(course.name)
                slopes = differentiated(t, position)
                rate = slopes[0] if rate is None else rate if low_pass is None else low_pass.smooth(rate)
                acceleration = slopes[1]
            elif low_pass is not None:
                rate, acceleration = low_pass.smooth(rate), low_pass.smooth(acceleration)
            for own, values in zip(levels, (position, rate, acceleration), strict=True):
                own.append(values)
        if computed:
            notes.append(
                f"rates and accelerations of {', '.join(computed)} are those of a spline of degree 5 through the "
                f"{'filtered ' if low_pass else ''}positions; {SPLINE_ENDS} samples at each end, where it is less "
                "exact, are left out"
            )
        if len(known) > len(chosen):
            others = [name for name in known if name not in {course.name for course in chosen}]
            notes.append(f"positions of {', '.join(others)} are not used: those of the others determine the motion")
        arrays = [np.column_stack(own) for own in levels]
        for word, array in zip(("rates", "accelerations"), arrays[1:], strict=True):
            _finite(word, array)
        count = len(arrays[0])
        return MeasuredMotion(
            np.zeros(count) if t is None else t,
            t is not None,
            tuple(course.name for course in chosen),
            (arrays[0], arrays[1], arrays[2]),
            tuple(notes),
            SPLINE_ENDS if computed else 0,
        )

    def _chosen(self, known: Mapping[str, Courses], positions: Any) -> list[Courses]:
        """As many coordinates as degrees of freedom."""
        if positions is not None:
            if isinstance(positions, str) or not is_list(positions):
                raise ArgumentError(
                    f"positions must be a list of names such as ['A'], not {shown(positions)}", argument="positions"
                )
            names = [str(name) for name in positions]
            for name in names:
                if name not in known:
                    raise UnknownNameError(
                        f"positions: {name!r} is no measured position; there are {listed(list(known))}",
                        name=name,
                        known=list(known),
                    )
        else:
            first = [each.name for each in self.actuators if each.name in known]
            names = [*first, *(name for name in known if name not in first)][: self.k]
        if len(names) != self.k:
            raise ArgumentError(
                f"data: {len(names)} measured position{'s' * (len(names) != 1)} ({listed(names) if names else 'none'})"
                f" for {self.k} degree{'s' * (self.k != 1)} of freedom; give columns such as "
                f"'joint.{self.actuators[0].name}.position', one for each degree of freedom",
                argument="data" if positions is None else "positions",
            )
        return [known[name] for name in names]

    def closed(self, path: MeasuredMotion, parameters: Parameters) -> tuple[ClosedMotion, tuple[str, ...]]:
        """States of the mechanism with the numbers of `parameters` along a path."""
        wanted = [dict(zip(path.names, level.T, strict=True)) for level in path.levels]
        numbers = self._numbers(parameters)
        k = kinematics(self.mechanism, wanted[0], wanted[1], wanted[2], near=self.near, parameters=numbers)
        notes = path.notes
        lost = np.flatnonzero(~k.reached)
        count = len(path.t)
        if len(lost) == count:
            raise ArgumentError(
                f"data: the mechanism reaches no measured position; the first: {k.reasons[0]}", argument="data"
            )
        if len(lost):
            notes = (
                *notes,
                f"{len(lost)} of {count} samples are left out, whose positions the mechanism does not reach; "
                f"the first: {k.reasons[int(lost[0])]}",
            )
        return ClosedMotion(path.t, k.q, k.v, k.vdot, k.names, path.names), notes

    def _numbers(self, parameters: Parameters) -> Any:
        """Numbers that change the motion; inertias do not."""
        own = {item.owner: parameters.numbers[item.owner] for item in parameters.items if item.kind == "plain"}
        return self.prior if not own else {**(self.prior or {}), **own}

    def evaluated(
        self, at: ClosedMotion, parameters: Parameters, channels: Sequence[Channel], gravity: Array | None = None
    ) -> Evaluated:
        """Channels and their derivatives; NaN where a sample has none."""
        numbers = {**(self.prior or {}), **parameters.numbers}
        model = self.model
        if any(item.kind == "plain" for item in parameters.items):
            model = layout_of(self.mechanism, "relative", numbers)[0]
        if gravity is not None:
            model = model.with_parameters({"gravity": gravity})
        names = [each.name for each in self.actuators]
        inverse = model._with_actuators(names)[0]
        more = [name for name in at.coordinates if name not in names]
        seen = model._with_actuators([*names, *more])[0] if more and not parameters.linear else inverse
        held = [] if parameters.linear else [[*names, *more].index(name) for name in at.coordinates]
        self._determined(at, channels)
        arrays = (at.t, at.q, at.v, at.vdot)
        directions = parameters.directions()
        values, derivatives, _ = regressor(
            inverse, (seen, held), arrays, dict(parameters.numbers), directions, [channel.core for channel in channels]
        )
        return Evaluated(values, derivatives)

    def _determined(self, at: ClosedMotion, channels: Sequence[Channel]) -> None:
        """Refuse reactions that the motion does not determine."""
        wanted = [channel for channel in channels if "joint" in channel.core]
        known = np.flatnonzero(np.isfinite(at.q).all(axis=1) & np.isfinite(at.vdot).all(axis=1))
        if not wanted or not len(known):
            return
        i = slice(int(known[0]), int(known[0]) + 1)
        one = SimpleNamespace(t=at.t[i], q=at.q[i], v=at.v[i], vdot=at.vdot[i], names=at.names)
        found = inverse_dynamics(self.mechanism, one, [each.name for each in self.actuators], parameters=self.prior)
        for channel in wanted:
            number, component = channel.core["joint"]
            joint = self.model.summary["joints"][number]["name"]
            if not found.joint(joint).determined[component]:
                raise ArgumentError(
                    f"measured: {channel.name} is not determined by the motion: the constraints are redundant, and it "
                    "depends on elasticity; measure a component that is, or ground.force",
                    argument="measured",
                )

    def random(self, still: bool, around: MeasuredMotion | None = None) -> ClosedMotion:
        """Random states near the drawing, or over the range of a path and beyond."""
        names = [each.name for each in self.actuators] if around is None else list(around.names)
        coordinates = [name for name in names if name in self._coordinates]
        if len(coordinates) < self.k:
            coordinates += [name for name in self._coordinates if name not in coordinates]
        wanted = max(FEWEST_STATES, RICH_STATES * len(self.parameters.items))
        rng = np.random.default_rng(SEED)
        for chosen in self._sets(coordinates):
            found = self._tried(chosen, wanted, rng, still, around)
            if found is not None:
                return found
        raise ArgumentError(
            "no coordinates of joints determine the motion near the drawing; give data with positions",
            argument="motion",
        )

    @property
    def _coordinates(self) -> dict[str, float]:
        """Coordinates that joints have, and their present values."""
        found = {}
        for joint in self.model.summary["joints"]:
            if joint["q"][1] != joint["v"][1]:
                continue  # a rotation in space is no goal by coordinates
            for name, _, number, i, _ in goals_of("positions", joint["name"], self.model) if joint["q"][1] else ():
                found[name] = self._now[joint["name"]][i] if number is not None else 0.0
        return found

    @property
    def _now(self) -> dict[str, Array]:
        q = np.asarray(self.start.q)[None, :]
        motion = self.model.core.motion(np.array([self.start.t]), q, np.zeros((1, self.model.core.nv)))
        return {
            joint["name"]: np.asarray(motion.joints([j])["joint_position"])[0]
            for j, joint in enumerate(self.model.summary["joints"])
        }

    def _sets(self, coordinates: list[str]) -> Iterable[list[str]]:
        """Sets of as many coordinates as degrees of freedom: the first ones, then each other in place of the last."""
        first = coordinates[: self.k]
        yield first
        for other in coordinates[self.k :]:
            yield [*first[:-1], other]

    def _tried(
        self, names: list[str], wanted: int, rng: np.random.Generator, still: bool, around: MeasuredMotion | None
    ) -> ClosedMotion | None:
        """Random states in these coordinates; None where they do not determine the motion."""
        goals = [goal for name in names for goal in goals_of("positions", name, self.model)]
        sizes = np.array([self.length if unit == "m" else 1.0 for unit in units_of(goals, self.model)])
        centre = np.array([self._coordinates[name] for name in names])
        spread = HALF_RANGE * sizes
        if around is not None and tuple(names) == around.names:
            lower, upper = around.levels[0].min(axis=0), around.levels[0].max(axis=0)
            centre, spread = 0.5 * (lower + upper), np.maximum(spread, 0.5 * (upper - lower))
        fast = 2.0 * np.sqrt(GRAVITY / self.length)
        parts = []
        for _ in range(ATTEMPTS):
            levels = [centre + spread * rng.uniform(-1.0, 1.0, (wanted, len(names)))]
            for size in (fast, fast**2):
                moved = size * sizes * rng.uniform(-1.0, 1.0, (wanted, len(names)))
                levels.append(np.zeros_like(moved) if still else moved)
            path = MeasuredMotion(np.full(wanted, self.start.t), True, tuple(names), (levels[0], levels[1], levels[2]))
            try:
                at, _ = self.closed(path, self.parameters)
            except (ArgumentError, SingularityError):
                continue
            good = np.isfinite(at.q).all(axis=1) & np.isfinite(at.vdot).all(axis=1)
            parts.append([x[good] for x in (at.t, at.q, at.v, at.vdot)])
            if sum(len(part[0]) for part in parts) >= wanted:
                break
        if sum(len(part[0]) for part in parts) < len(self.parameters.items):
            return None
        t, q, v, vdot = (np.concatenate(x) for x in zip(*parts, strict=True))
        return ClosedMotion(t, q, v, vdot, at.names, tuple(names))

    @property
    def length(self) -> float:
        """A length of the mechanism."""
        masses = self.parameters.items
        lengths = [item.scale for item in masses if item.unit == "m"]
        moments = {item.owner: item.scale for item in masses if item.kind == "first"}
        mass = {item.owner: item.scale for item in masses if item.kind == "mass"}
        lengths += [scale / mass[body] for body, scale in moments.items() if body in mass]
        if lengths:
            return float(max(lengths))
        points = [np.asarray(x) for name, x in self.model.parameters.items() if name.endswith(".point")]
        return float(max((np.linalg.norm(a - b) for a in points for b in points), default=1.0)) or 1.0

    def fitted(self, found: Evaluated, residuals: Array, sizes: Array, noise: Array) -> dict[str, Any]:
        """Least squares by the core."""
        p = self.parameters
        return least_squares(found.derivatives, residuals, sizes, noise, p.scales, p.preference)

    def rank(self, found: Evaluated, columns: Sequence[int] | None = None) -> dict[str, Any]:
        """Rank and combinations of some channels."""
        derivatives = found.derivatives if columns is None else found.derivatives[:, list(columns)]
        rows, ones = derivatives.shape[:2], np.ones(derivatives.shape[1])
        return self.fitted(Evaluated(found.values, derivatives), np.zeros(rows), ones, ones)

    def identifiability(
        self,
        channels: Sequence[Channel],
        found: Evaluated,
        notes: tuple[str, ...],
        around: MeasuredMotion | None = None,
    ) -> Identifiability:
        """The rank along states, and what further channels and motions would add."""
        own, p = self.rank(found), self.parameters
        rank, values = own["rank"], own["singular"]
        gap = float("inf") if rank == len(values) else float(values[rank - 1] / max(values[rank], LEAST_DIVISOR))
        if rank and gap < SHARP:
            notes = (
                *notes,
                f"the rank is not decided sharply: the last singular value kept exceeds the next by {gap:.3g} only; "
                "the motion excites some combinations weakly",
            )
        combinations = combinations_of(p, own)
        dependent = {p.labels[j] for j in own["dependent"]}
        used = {label for one in combinations for label in one.terms}
        never = tuple(label for label in p.labels if label in dependent and label not in used)
        alone = tuple(one.name for one in combinations if len(one.terms) == 1)
        together = tuple(label for label in p.labels if label not in never and label not in alone)
        attainable, candidates = self._candidates(channels, around)
        return Identifiability(
            self.title,
            p.labels,
            tuple(channel.name for channel in channels),
            rank,
            combinations,
            never,
            together,
            alone,
            values,
            gap,
            attainable,
            candidates,
            tuple(_hints(rank, attainable, candidates, len(p.labels))),
            notes,
        )

    def _candidates(self, channels: Sequence[Channel], around: MeasuredMotion | None) -> tuple[int, dict[str, int]]:
        """Ranks on rich motions: with the channels, and with each further one."""
        at = self.random(False, around)
        names = [channel.name for channel in channels]
        cores = [channel.core for channel in channels]
        further: dict[str, list[Channel]] = {}
        for each in self.actuators:
            channel = channel_of(f"effort.{each.name}", self.actuators, self.model)
            if channel is not None and channel.core not in cores:
                further[f"effort.{each.name}"] = [channel]
        for what in ("force", "moment"):
            parts = [channel_of(f"ground.{what}.{axis}", self.actuators, self.model) for axis in "xyz"]
            if missing := [x for x in parts if x is not None and x.core not in cores]:
                further[f"ground.{what}"] = missing
        every = _distinct([*channels, *(channel for group in further.values() for channel in group)])
        where = {channel.name: i for i, channel in enumerate(every)}
        found = self.evaluated(at, self.parameters, every)
        own = [where[name] for name in names]
        ranks = {
            word: self.rank(found, [*own, *(where[channel.name] for channel in group)])["rank"]
            for word, group in further.items()
        }
        gravity = np.asarray(self.model.parameters["gravity"], dtype=float)
        if not gravity.any():
            for axis in range(3):
                pulled = np.zeros(3)
                pulled[axis] = -GRAVITY
                under = self.evaluated(at, self.parameters, channels, gravity=pulled)
                ranks["gravity"] = max(ranks.get("gravity", 0), self.rank(under)["rank"])
        return self.rank(found, own)["rank"], ranks


SPLINE_ENDS = 10
"""Samples at each end of a spline that are left out: its error there falls to a half or less with each."""
_SPLINE_POINTS = 2 * SPLINE_ENDS + 6
"""Times that a spline of degree five needs, without its ends."""


def _finite(what: str, values: Array) -> None:
    """Refuse a column, or columns, with a value that is not finite."""
    bad = ~np.isfinite(values.reshape(len(values), -1)).all(axis=1)
    if bad.any():
        raise ArgumentError(
            f"data: {what} have a value that is not finite at sample {int(np.argmax(bad))}; leave such samples out",
            argument="data",
        )


def _distinct(channels: Sequence[Channel]) -> list[Channel]:
    found: list[Channel] = []
    for channel in channels:
        if channel.core not in [known.core for known in found]:
            found.append(channel)
    return found


def combinations_of(p: Parameters, own: Mapping[str, Any], estimated: bool = False) -> tuple[Combination, ...]:
    """Base parameters, with estimates where there are any."""
    found, values = [], p.values
    for b, i in enumerate(own["base"]):
        others = [(d, float(x)) for d, x in zip(own["dependent"], own["coefficients"][b], strict=True) if x != 0.0]
        terms = {p.labels[i]: 1.0} | {p.labels[d]: x for d, x in others}
        prior = float(values[i] + sum(x * values[d] for d, x in others))
        item = p.items[i]
        if not estimated:
            found.append(Combination(item.label, terms, item.unit, item.scale, prior))
            continue
        sd = float(own["base_deviations"][b])
        estimate = prior + float(own["base_changes"][b])
        found.append(Combination(item.label, terms, item.unit, item.scale, prior, estimate, sd, sd > item.scale))
    return tuple(found)


def _hints(rank: int, attainable: int, candidates: Mapping[str, int], count: int) -> Iterable[str]:
    if attainable > rank:
        yield (
            "a richer motion with the same channels (other positions, rates and accelerations) determines "
            f"{attainable} combinations instead of {rank}"
        )
    words = {
        "gravity": "gravity, or a mounting in which it acts along the motion",
        "ground.force": "the force of the ground",
        "ground.moment": "the moment of the ground",
    }
    better = {word: found for word, found in candidates.items() if found > max(rank, attainable)}
    for word, found in sorted(better.items(), key=lambda x: -x[1]):
        yield f"{words.get(word, word)} as well determines {found} combinations on a rich motion"
    if not better and attainable <= rank < count:
        yield (
            f"no further effort, and no force of the ground, determines more than {rank} combinations of the {count} "
            "parameters: efforts and forces of the motion do not depend on the rest"
        )
