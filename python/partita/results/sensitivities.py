"""Derivatives of a run by numbers of the mechanism and of its start."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..derivatives import EndTime, Start, StartRate, objective
from ..errors import ArgumentError
from ..naming import index_of
from ..numeric import shown
from ..options import items, named, positive
from ..sensing import SensorRecord

Array = NDArray[np.float64]
Tree = Any
Observable = dict[str, Any]
Values = Observable | list[Observable]
"""A number, or the three of a vector, as the core observes them."""

RATES = ("position", "velocity")
AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
SAMPLED = 8
"""States in each step of a run at which the place of a largest value is looked for. Unit: number. Reason: what is
sampled has at most a few extrema in a step, whose length follows the motion."""
AROUND = 1e-3
"""How far beside a guess the time of a largest value is sought. Scale: width between its bounds. Reason: a guess by
the secant has three digits more, so that both bounds close in."""
ACROSS = 1e-9
"""A component of a reaction below this is none. Scale: largest component along the run. Reason: rounding of loads
across a plane in which all others act."""
PLACED = 1e-13
"""The time of a largest value is found to this. Scale: duration of the run. Reason: the value changes with its
square."""


@dataclass(frozen=True)
class Number:
    """What is differentiated by."""

    key: Any
    """As it was given."""
    shape: tuple[int, ...]
    directions: tuple[dict[str, Any], ...] = field(repr=False)


def _length(spec: Mapping[str, Any], name: str) -> tuple[float, dict[str, list[float]]] | None:
    """The length of a body, and changes of joints by which it grows by one, its centre of mass staying on it; None
    where there is no such body."""
    body = name.removesuffix(".length")
    ends = [joint for joint in spec["joints"] if body in (joint["parent"], joint["child"])]
    if not any(one["name"] == body for one in spec["bodies"]):
        return None
    if len(ends) != 2:
        raise ArgumentError(
            f'"{name}": the body has {len(ends)} joints, so that it has no length; give the point of one, such as '
            f'"{ends[0]["name"] if ends else "A"}.point"',
            argument="by",
        )

    def other(joint: Mapping[str, Any]) -> str:
        return str(joint["child"] if joint["parent"] == body else joint["parent"])

    def far(joint: Mapping[str, Any]) -> bool:
        return other(joint) != "ground"

    stays, moves = sorted(ends, key=far)

    def point(joint: Mapping[str, Any]) -> Array:
        given = joint.get("child_point") if joint["child"] == body else None
        own = joint["point"] if given is None else given
        return np.array(own, dtype=float)

    along = point(moves) - point(stays)
    size = float(np.linalg.norm(along))
    if not size > 0.0:
        raise ArgumentError(f'"{name}": both joints of the body are in one point', argument="by")
    grown = (along / size).tolist()
    still = [0.0, 0.0, 0.0]
    if moves["child"] == body:
        return size, {f"{moves['name']}.child_point": grown}
    return size, {f"{moves['name']}.point": grown, f"{moves['name']}.child_point": still}


def grown(description: str, wanted: Mapping[str, float]) -> dict[str, list[float]]:
    """Parameters by which bodies get these lengths.

    Raises `ArgumentError` for what is no length."""
    spec = json.loads(description)
    joints = {joint["name"]: joint for joint in spec["joints"]}
    drawn: dict[str, list[float]] = {}
    moved: dict[str, list[float]] = {}
    for name, length in wanted.items():
        found = _length(spec, name) if name.endswith(".length") else None
        if found is None:
            raise ArgumentError(f'"{name}" is no parameter, nor the length of a body with two joints', argument="by")
        size, changes = found
        for parameter, seed in changes.items():
            joint, _, word = parameter.rpartition(".")
            base = list(joints[joint].get(word) or joints[joint]["point"])
            drawn.setdefault(parameter, base)
            if any(seed):  # else the other side of the joint, which stays unless its own body grows
                moved[parameter] = [x + (length - size) * s for x, s in zip(base, seed, strict=True)]
    return drawn | moved


def lengths(mechanism: Any, wanted: Mapping[str, float]) -> dict[str, list[float]]:
    """Parameters by which bodies of two joints get these lengths [m], for `parameters=` of `simulate`.

    The joint that is not on the ground, or the later one, moves along the line through both, on this body alone, whose
    centre of mass stays; so lengths of neighbours change independently.

    Args:
        mechanism: a `Mechanism`.
        wanted: "coupler.length" -> length [m].

    Raises `ArgumentError` for a body that does not exist or has not two joints.

    >>> import partita as pt
    >>> m = pt.catalogue.load("four-bar")
    >>> sorted(pt.lengths(m, {"coupler.length": 0.9}))
    ['C.child_point', 'C.point']
    """
    if (compiled := getattr(mechanism, "compile", None)) is None or not callable(compiled):
        raise ArgumentError(f"mechanism must be a Mechanism, not {shown(mechanism)}", argument="mechanism")
    given = named("wanted", wanted, '{"coupler.length": 0.9}')
    return grown(
        compiled().description, {name: positive(f'wanted["{name}"]', length, "m") for name, length in given.items()}
    )


def number_of(
    key: Any, present: Mapping[str, Sequence[float]], spec: Mapping[str, Any], held: Sequence[Held]
) -> Number:
    """A number that is differentiated by, from what the user names."""
    if isinstance(key, EndTime):
        return Number(key, (), ({"end": 1.0},))
    if isinstance(key, Start | StartRate):
        word = "start" if isinstance(key, Start) else "start_rates"
        indices = [i for i, one in enumerate(held) if (one.joint, one.coordinate) == (key.joint, key.coordinate)]
        if not indices:
            raise ArgumentError(
                f"{shown(str(key))}: at the start {', '.join(one.name for one in held)} is held, and the other joints "
                f'follow; give held=("{key.joint}", ...)',
                argument="by",
            )
        return Number(key, (), ({word: np.eye(len(held))[indices[0]].tolist()},))
    name = str(key)
    if name not in present and name.endswith(".length") and (found := _length(spec, name)) is not None:
        return Number(key, (), ({"parameters": list(found[1].items())},))
    name = list(present)[index_of(name, list(present), "parameter")]
    count = len(present[name])
    shape: tuple[int, ...] = () if count == 1 else (3, 3) if count == 9 else (count,)
    return Number(key, shape, tuple({"parameters": [(name, row)]} for row in np.eye(count).tolist()))


def numbers_of(by: Iterable[Any], run: Any, held: Sequence[Held]) -> list[Number]:
    """The numbers that are differentiated by, as they are given."""
    present, spec = dict(_model(run).parameters()), run._record.spec or {}
    found = [number_of(key, present, spec, held) for key in by]
    used = {name for number in found for one in number.directions for name, _ in one.get("parameters", ())}

    def completed(direction: dict[str, Any]) -> dict[str, Any]:
        # where the two sides of a joint are numbers of their own, its point moves on both
        changes = list(direction.get("parameters", ()))
        own = {name for name, _ in changes}
        for name, seed in tuple(changes):
            other = f"{name.removesuffix('.point')}.child_point"
            if name.endswith(".point") and other in used and other not in own and other not in present:
                changes.append((other, seed))
        return {**direction, "parameters": changes} if changes else direction

    return [Number(one.key, one.shape, tuple(map(completed, one.directions))) for one in found]


@dataclass(frozen=True)
class Held:
    """A coordinate that is held at the start."""

    name: str
    joint: str
    coordinate: int
    measured: dict[str, Any]
    is_turn: bool = False
    """Whether it is a rate of a rotation in space, which is no coordinate."""


def held_of(run: Any, held: Iterable[Any] | None) -> list[Held]:
    """What is held at the start: what is given, what the start was assembled with, or the coordinates in use there."""
    joints = {joint["name"]: joint for joint in run.summary["joints"]}

    def of_joint(name: str) -> list[Held]:
        labels = [f"{name}.{axis}" for axis in joints[name]["axes"]]
        count = joints[name]["v"][1]
        measures = [{"of": "joint", "joint": name, "coordinate": i} for i in range(count)]
        turns = [axis.startswith("w") for axis in joints[name]["axes"]]
        return [
            Held(labels[i] if count > 1 else name, name, i, {"measure": measure}, turns[i])
            for i, measure in enumerate(measures)
        ]

    def held_by(given: Any) -> list[Held]:
        name = str(getattr(given, "name", given))
        if name in joints:
            return of_joint(name)
        owner = name.rpartition(".")[0]
        found = [one for one in of_joint(owner) if one.name == name] if owner in joints else []
        if not found:
            index_of(name, list(joints), "joint")
        return found

    first = run._record.partitions[0] if run._record.partitions else {"independent": []}
    independent = [int(i) for i in first["independent"]]
    if held is not None:
        return [one for given in items("held", held, '["A"]') for one in held_by(given)]
    try:
        assembled = [one for given in run._held for one in held_by(given)]
    except ArgumentError:  # a target that is no joint
        assembled = []
    if assembled and len(assembled) == len(independent):
        return assembled
    spans = [(joint["state_v"], joint["name"]) for joint in joints.values() if joint["state_v"] is not None]
    names, found = list(run.names.velocities), []
    for i in independent:
        owner, offset = next(((name, i - span[0]) for span, name in spans if span[0] <= i < span[0] + span[1]), ("", 0))
        found.append(Held(names[i], owner, offset, {"velocity": i}, names[i].rpartition(".")[2].startswith("w")))
    return found


class Observing:
    """Turns sensors, joints and expressions into what the core observes."""

    def __init__(self, run: Any) -> None:
        self._run = run
        self._sensors: Mapping[str, SensorRecord] = getattr(run._sensors, "records", None) or {}
        self._joints = {joint["name"]: joint for joint in run.summary["joints"]}

    def number(self, tree: Tree) -> Observable:
        """An expression whose value is a number."""
        found = self._of(tree)
        if isinstance(found, list):
            raise ArgumentError(
                f"{shown(_said(tree))} is a vector; take a component, as in sensor[0], its norm(), or a product with "
                "another by dot()",
                argument="objective",
            )
        return found

    def sensor(self, name: str) -> Values:
        """A sensor by its name: a number, or the components of a vector."""
        return self._named(name)

    def joint(self, name: str, reads: str, coordinate: int = 0) -> Observable:
        """The position or the rate of a joint."""
        return {"formula": {reads: {"of": "joint", "joint": name, "coordinate": coordinate}}}

    def wrench(self, name: str, reads: str) -> list[Observable]:
        """The force or the moment of a joint, world axes."""
        first = 0 if reads == "force" else 3
        joint = self._run.joint(name)
        determined = np.asarray(joint.determined, dtype=bool).reshape(-1, 6)[:, first : first + 3]
        known = [bool(determined[:, i].all()) for i in range(3)]
        values = np.asarray(getattr(joint, reads))
        found: list[Observable] = []
        for i in range(3):
            if known[i]:
                found.append({"wrench": [name, first + i]})
            elif float(np.abs(values[:, i]).max(initial=0.0)) <= ACROSS * float(np.abs(values).max(initial=0.0)):
                # across the plane of a planar mechanism nothing acts
                found.append({"formula": {"number": 0.0}})
            else:
                raise ArgumentError(
                    f'the {reads} of joint "{name}" is not determined by the motion (see '
                    f'run.joint("{name}").determined), '
                    "so that it has no derivative; observe a determined reaction",
                    argument="objective",
                )
        return found

    def _of(self, tree: Tree) -> Values:
        if isinstance(tree, str):
            return self._named(tree)
        if not isinstance(tree, list):
            return {"formula": {"number": float(tree)}}
        word, *parts = tree
        if word == "component":
            inner = self._of(parts[0])
            if not isinstance(inner, list):
                raise ArgumentError(f"{shown(_said(parts[0]))} is a number, without components", argument="objective")
            return inner[index_of(str(parts[1]), [str(i) for i in range(len(inner))], "component")]
        found = [self._of(part) for part in parts]
        if word == "norm":
            return {"norm": found[0] if isinstance(found[0], list) else [found[0]]}
        if word == "dot":
            pairs = zip(*(one if isinstance(one, list) else [one] for one in found), strict=True)
            return {"sum": [{"product": list(pair)} for pair in pairs]}
        if not any(isinstance(one, list) for one in found):
            return {word: found}
        rows = [[one[i] if isinstance(one, list) else one for one in found] for i in range(3)]
        return [{word: row} for row in rows]

    def _named(self, name: str) -> Values:
        if name not in self._sensors:
            if name in self._joints:
                return self.joint(name, "position")
            known = [*self._sensors, *self._joints]
            name = known[index_of(name, known, "sensor")]
            return self._named(name)
        data: Mapping[str, Any] = self._sensors[name].data
        reads = data.get("reads")
        if data["of"] == "expression":
            return self._of(data["expression"])
        if data["of"] == "measure" and reads in RATES:
            return {"formula": {str(reads): dict(data["measure"])}}
        if data["of"] == "joint" and reads in RATES:
            return self.joint(data["joint"], str(reads), data.get("coordinate") or 0)
        if data["of"] == "joint" and reads in ("force", "moment") and data.get("axes", "world") == "world":
            return self.wrench(data["joint"], str(reads))
        if data["of"] == "drive" and reads == "effort":
            return {"effort": data["drive"]}
        if data["of"] in ("point", "body") and reads in RATES and data.get("axes", "world") == "world":
            point = list(data.get("point", (0.0, 0.0, 0.0)))
            ends = {"body1": "ground", "point1": [0.0, 0.0, 0.0], "body2": data["body"], "point2": point}
            return [{"formula": {str(reads): {"of": "along", **ends, "axis": list(axis)}}} for axis in AXES]
        raise ArgumentError(
            f'the sensor "{name}" reads {reads or "what has no name"} of a {data["of"]}, of which derivatives are not '
            "computed; observe positions and rates of joints, points and measures, forces and moments of joints in "
            "world axes, or efforts of drives",
            argument="objective",
        )


def _said(tree: Tree) -> str:
    return tree if isinstance(tree, str) else "the expression"


class Sensitivities:
    """Derivatives of a run along its outputs, by `run.sensitivities`.

    Each method gives, for one of the numbers of `by`, an array with the outputs along its first axis, then the
    components of what is observed, then those of the number; without `by` a dict of all.

    Attributes:
        t: the outputs (nt,).
        by: the numbers, as they were given.
        held: names of what is held at the start.
    """

    def __init__(self, run: Any, by: Iterable[Any], held: Iterable[Any] | None) -> None:
        self.t = run.t
        self._run = run
        self._held = held_of(run, held)
        given = items("by", by, '["crank.mass"]')
        self._numbers = numbers_of(given, run, self._held)
        self._observing = Observing(run)
        self._known: dict[str, Array] = {}

    @property
    def by(self) -> tuple[Any, ...]:
        return tuple(number.key for number in self._numbers)

    @property
    def held(self) -> tuple[str, ...]:
        return tuple(one.name for one in self._held)

    def position(self, joint: Any, by: Any = None, *, coordinate: int = 0) -> Any:
        """Of the position of a joint [rad or m]."""
        name = str(getattr(joint, "name", joint))
        return self._of(
            f"{name}.{coordinate} position", [self._observing.joint(name, "position", coordinate)], by, True
        )

    def rate(self, joint: Any, by: Any = None, *, coordinate: int = 0) -> Any:
        """Of the rate of a joint [rad/s or m/s]."""
        name = str(getattr(joint, "name", joint))
        return self._of(f"{name}.{coordinate} rate", [self._observing.joint(name, "velocity", coordinate)], by, True)

    def force(self, joint: Any, by: Any = None) -> Any:
        """Of the force of a joint on its child, world axes [N], where it is determined."""
        name = str(getattr(joint, "name", joint))
        return self._of(f"{name} force", self._observing.wrench(name, "force"), by, False)

    def moment(self, joint: Any, by: Any = None) -> Any:
        """Of the moment of a joint on its child about its point, world axes [N m], where it is determined."""
        name = str(getattr(joint, "name", joint))
        return self._of(f"{name} moment", self._observing.wrench(name, "moment"), by, False)

    def sensor(self, sensor: Any, by: Any = None) -> Any:
        """Of a sensor or of an expression of sensors."""
        tree = objective(sensor).parts[0]
        found = self._observing._of(tree)
        key = json.dumps(tree)
        return self._of(key, found if isinstance(found, list) else [found], by, not isinstance(found, list))

    def _of(self, key: str, observables: list[Observable], by: Any, is_number: bool) -> Any:
        if key not in self._known:
            self._known[key] = self._computed(observables)
        return self._split(self._known[key], by, is_number)

    def _computed(self, observables: list[Observable]) -> Array:
        found = derivatives(self._run, self._numbers, self._held, observables, self.t)
        return found.along

    def _split(self, along: Array, by: Any, is_number: bool) -> Any:
        found, first = {}, 0
        for number in self._numbers:
            count = len(number.directions)
            part = along[:, :, first : first + count].reshape(*along.shape[:2], *number.shape)
            found[number.key] = part[:, 0] if is_number else part
            first += count
        if by is None:
            return found
        if by not in found:
            known = ", ".join(str(key) for key in found)
            raise ArgumentError(
                f"{shown(str(by))} is not among the numbers of these sensitivities: {known}", argument="by"
            )
        return found[by]

    def __repr__(self) -> str:
        by = ", ".join(str(key) for key in self.by)
        return f"Sensitivities({len(self.t)} outputs by {by}; held at the start: {', '.join(self.held)})"


@dataclass(frozen=True)
class Derived:
    """What the core computed."""

    values: Array
    rates: Array
    along: Array
    integrals: list[tuple[float, list[float]]]
    shifts: list[tuple[float, list[float]]]


def _model(run: Any) -> Any:
    source = run._source
    model = getattr(source, "model", None)
    if model is None or run._record.arrays.log is None:
        raise ArgumentError(
            "the result was stored, or pickled, so that its steps are not known any more; run the mechanism again",
            argument="run",
        )
    return model


def derivatives(
    run: Any,
    numbers: Sequence[Number],
    held: Sequence[Held],
    observables: Sequence[Observable],
    times: Any,
    *,
    integrals: Sequence[Observable] = (),
    before: bool = False,
) -> Derived:
    """Values, rates and derivatives of what is observed at these times of a run."""
    _model(run)
    asked = {
        "held": [(one.name, one.measured) for one in held],
        "directions": [direction for number in numbers for direction in number.directions],
        "observables": list(observables),
        "integrals": list(integrals),
    }
    at = np.asarray(times, dtype=float)
    arrays, (gathered, shifts) = run._record.arrays.log.derivatives(json.dumps(asked), at, [before] * len(at))
    values, rates, along = arrays
    directions = [direction for number in numbers for direction in number.directions]
    ends = [i for i, direction in enumerate(directions) if "end" in direction]
    for i in ends:  # what is observed where the run ends moves on
        along[at == run.t[-1], :, i] = rates[at == run.t[-1]]
    return Derived(values, rates, along, gathered, shifts)


def backward(
    run: Any,
    numbers: Sequence[Number],
    held: Sequence[Held],
    observables: Sequence[Observable],
    at: Sequence[tuple[float, bool]],
    *,
    integrals: Sequence[Observable],
    weights: tuple[Array, Array],
) -> Array:
    """The derivatives of the weighed sum of what is observed at these times, each with whether what happens there has
    not happened yet, and of integrals, backwards through the steps."""
    _model(run)
    asked = {
        "held": [(one.name, one.measured) for one in held],
        "directions": [direction for number in numbers for direction in number.directions],
        "observables": list(observables),
        "integrals": list(integrals),
    }
    weighed = {"observables": weights[0].tolist(), "integrals": weights[1].tolist()}
    times, before = np.array([t for t, _ in at], dtype=float), [flag for _, flag in at]
    found = run._record.arrays.log.gradient(json.dumps(asked), json.dumps(weighed), times, before)
    return np.asarray(found)


def observed(run: Any, observables: Sequence[Observable], times: Any, *, before: bool = False) -> tuple[Array, Array]:
    """Values and total rates of what is observed at these times."""
    _model(run)
    at = np.asarray(times, dtype=float)
    values, rates = run._record.arrays.log.observed(json.dumps(list(observables)), at, [before] * len(at))
    return values, rates


def largest(run: Any, observable: Observable) -> float:
    """When what is observed is largest: between two states of a step at which its rate changes sign, to rounding, or
    at an end of the run or an instant at which something happens."""
    begin, end = float(run.t[0]), float(run.t[-1])
    steps = max(int(run.counters.get("kept_steps", 0)), 1)
    happened = sorted({float(event.t) for event in run.events if begin < float(event.t) < end})
    # steps are short where the motion is fast: as many samples between two outputs as there are steps
    marks = np.unique(np.concatenate([np.linspace(begin, end, SAMPLED * steps + 1), run.t, happened]))
    values, rates = (x[:, 0] for x in observed(run, [observable], marks))
    best = int(np.nanargmax(values))
    candidates = [(float(values[best]), float(marks[best]))]
    if happened:
        before = observed(run, [observable], happened, before=True)[0][:, 0]
        candidates += list(zip(before.tolist(), happened, strict=True))
    rising = np.flatnonzero((rates[:-1] > 0.0) & (rates[1:] <= 0.0))
    # what lies between two samples is at most higher by their rates
    gain = np.abs(rates[rising]) * np.diff(marks)[rising]
    promising = rising[values[rising] + gain >= values[best]]
    for i in promising:
        low, high = float(marks[i]), float(marks[i + 1])
        slopes = [float(rates[i]), float(rates[i + 1])]
        while high - low > PLACED * max(abs(end), end - begin):
            guess = low + (high - low) * slopes[0] / (slopes[0] - slopes[1])
            tried = sorted({min(max(guess, low), high), 0.5 * (low + high), *_around(guess, low, high)})
            inside = [t for t in tried if low < t < high]
            if not inside:
                break
            found = observed(run, [observable], inside)[1][:, 0]
            points = [(low, slopes[0]), *zip(inside, found.tolist(), strict=True), (high, slopes[1])]
            place = next(j for j in range(len(points) - 1) if points[j][1] > 0.0 >= points[j + 1][1])
            (low, slopes[0]), (high, slopes[1]) = points[place], points[place + 1]
        candidates.append((float(observed(run, [observable], [high])[0][0, 0]), high))
    return max(candidates)[1]


def _around(guess: float, low: float, high: float) -> list[float]:
    """Times on both sides of a guess, far closer to it than the bounds."""
    near, nearest = AROUND * (high - low), AROUND**2 * (high - low)
    return [guess - near, guess + near, guess - nearest, guess + nearest]
