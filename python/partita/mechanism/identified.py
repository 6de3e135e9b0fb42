"""Parameters that are identified: labels, present values, natural sizes, and directions in the numbers of a model.

The mass, first moment m c and moments of inertia of a body about a reference point enter forces linearly; mass, centre
of mass and inertia about it do not. Both sets are offered; the first is the default.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..builder.compiled import CompiledModel
from ..builder.parameter_units import parameter_unit
from ..errors import ArgumentError, UnknownNameError
from ..naming import listed
from ..numeric import is_list, shown
from ..tolerance import EQUAL
from ..units.text import unit_of

Array = NDArray[np.float64]
_AXES = "xyz"
_PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
GRAVITY = 9.81
"""Acceleration of gravity of a mechanism that has none: for natural sizes, and to try it. Unit: m/s^2."""
LATER = {"mass": 4.0, "first": 2.0}
"""Parameters with larger numbers are expressed by others: masses, which are the hardest to separate, then first
moments, then moments of inertia."""
CARRIED = 1.0
"""Added for those of a body that no joint connects to the ground: the others carry it."""


@dataclass(frozen=True)
class Parameter:
    """One number: its label, unit, natural size, and where it stands."""

    label: str
    unit: str
    scale: float
    kind: str
    """"mass", "first" or "inertia" of a body in linear form, or "plain": a number of the model."""
    owner: str
    """Body, or the name of the model's parameter."""
    at: tuple[int, ...]
    """Axis, pair of axes, or index of the number."""
    later: float = 0.0
    """How much rather it is expressed by others."""


@dataclass(frozen=True)
class Reference:
    """The point of a body about which moments are taken: a joint's, or the origin of the body."""

    joint: str
    point: Array


@dataclass(frozen=True)
class Parameters:
    """The identified parameters of one model, and its present numbers."""

    items: tuple[Parameter, ...]
    numbers: Mapping[str, list[float]]
    """Numbers of the model that they change."""
    references: Mapping[str, Reference] = field(default_factory=dict)
    """Of the bodies in linear form."""
    axes: Mapping[str, tuple[int, ...]] = field(default_factory=dict)
    """Of each body of these numbers, the axes along which its centre of mass moves."""

    @property
    def labels(self) -> tuple[str, ...]:
        """Names, in order."""
        return tuple(item.label for item in self.items)

    @property
    def linear(self) -> bool:
        """Whether forces are linear in all of them."""
        return all(item.kind != "plain" for item in self.items)

    @property
    def values(self) -> Array:
        """Present values."""
        return np.array([self._value(item) for item in self.items])

    @property
    def scales(self) -> Array:
        """Natural sizes."""
        return np.array([item.scale for item in self.items])

    @property
    def preference(self) -> Array:
        """How much rather each is expressed by others."""
        return np.array([item.later for item in self.items])

    def directions(self) -> list[list[float]]:
        """The change of all numbers, one after the other, along each parameter."""
        first, sizes = {}, 0
        for name, values in self.numbers.items():
            first[name] = sizes
            sizes += len(values)
        found = []
        for item in self.items:
            along = np.zeros(sizes)
            for name, change in self._along(item).items():
                along[first[name] : first[name] + len(change)] = change
            found.append(along.tolist())
        return found

    def changed(self, values: Array) -> Parameters:
        """With other values of the parameters."""
        numbers = {name: list(own) for name, own in self.numbers.items()}
        for item, value in zip(self.items, values, strict=True):
            if item.kind == "plain":
                for i in _places(item):
                    numbers[item.owner][i] = float(value)
        for name, tensor in numbers.items():
            axes = self.axes.get(name.rpartition(".")[0], (0, 1, 2))
            if name.endswith(".inertia") and len(axes) == 2:
                moments = np.array(tensor).reshape(3, 3)
                _possible(moments, list(axes), ({0, 1, 2} - set(axes)).pop())
                numbers[name] = moments.ravel().tolist()
        for body in self.references:
            own = {item: value for item, value in zip(self.items, values, strict=True) if item.owner == body}
            if own:
                numbers |= self._body(body, own)
        return replace(self, numbers=numbers)

    def bodies(self) -> tuple[str, ...]:
        """Bodies of which a mass, a centre of mass or an inertia is identified."""
        plain = [item.owner.rpartition(".") for item in self.items if item.kind == "plain"]
        own = [body for body, _, word in plain if word in ("mass", "com", "inertia")]
        return tuple(dict.fromkeys([*self.references, *own]))

    def mass_and_moments(self, body: str) -> tuple[float, Array]:
        """The mass, and principal moments of inertia about the centre of mass; in a plane the one that matters. A
        number that is not identified counts as possible."""
        mass = self.numbers.get(f"{body}.mass", [np.inf])[0]
        own = self.numbers.get(f"{body}.inertia")
        if own is None:
            return mass, np.ones(1)
        inertia, axes = np.array(own).reshape(3, 3), self.axes.get(body, (0, 1, 2))
        if len(axes) == 2:
            normal = ({0, 1, 2} - set(axes)).pop()
            return mass, np.array([inertia[normal, normal]])
        return mass, np.linalg.eigvalsh(inertia) if np.isfinite(inertia).all() else np.full(3, np.nan)

    def _value(self, item: Parameter) -> float:
        if item.kind == "plain":
            return float(self.numbers[item.owner][item.at[0]])
        mass, arm, inertia = self._state(item.owner)
        if item.kind == "mass":
            return mass
        if item.kind == "first":
            return float(mass * arm[item.at[0]])
        return float((inertia + mass * _steiner(arm))[item.at])

    def _state(self, body: str) -> tuple[float, Array, Array]:
        """Mass, centre of mass from the reference point, inertia about the centre of mass; of a body in a plane the
        part of the arm in it."""
        mass, com = self.numbers[f"{body}.mass"][0], np.array(self.numbers[f"{body}.com"])
        arm = np.zeros(3)
        own = list(self.axes[body])
        arm[own] = (com - self.references[body].point)[own]
        return mass, arm, np.array(self.numbers[f"{body}.inertia"]).reshape(3, 3)

    def _along(self, item: Parameter) -> dict[str, Array]:
        """d(mass, com, inertia) along a parameter in linear form: c = f / m, I = J - (|f|^2 1 - f f^T) / m."""
        if item.kind == "plain":
            change = np.zeros(len(self.numbers[item.owner]))
            change[list(_places(item))] = 1.0
            return {item.owner: change}
        mass, arm, _ = self._state(item.owner)
        com, inertia, unit = np.zeros(3), np.zeros((3, 3)), np.eye(3)
        found = {}
        if item.kind == "mass":
            com, inertia = -arm / mass, _steiner(arm)
            found[f"{item.owner}.mass"] = np.ones(1)
        elif item.kind == "first":
            a = unit[item.at[0]]
            com = a / mass
            inertia = np.outer(a, arm) + np.outer(arm, a) - 2.0 * arm @ a * unit
        else:
            inertia[item.at] = inertia[item.at[::-1]] = 1.0
        return {
            **found,
            f"{item.owner}.com": com,
            f"{item.owner}.inertia": self._kept(item.owner, inertia).ravel(),
        }

    def _kept(self, body: str, change: Array) -> Array:
        """A change of inertia in its plane alone, where a body moves in one."""
        axes = self.axes[body]
        if len(axes) == 3:
            return change
        normal = ({0, 1, 2} - set(axes)).pop()
        kept = np.zeros((3, 3))
        kept[normal, normal] = change[normal, normal]
        return kept

    def _body(self, body: str, own: Mapping[Parameter, float]) -> dict[str, list[float]]:
        """Numbers of a body with these values of its linear parameters, the others as they are."""
        mass, arm, inertia = self._state(body)
        first, second = mass * arm, inertia + mass * _steiner(arm)
        for item, value in own.items():
            if item.kind == "mass":
                mass = float(value)
            elif item.kind == "first":
                first[item.at[0]] = value
            else:
                second[item.at] = second[item.at[::-1]] = value
        # a mass of zero has no centre; the division says so where the numbers are used
        with np.errstate(divide="ignore", invalid="ignore"):
            new = first / mass
        com, axes = np.array(self.numbers[f"{body}.com"]), list(self.axes[body])
        com[axes] = (self.references[body].point + new)[axes]
        before = np.array(self.numbers[f"{body}.inertia"]).reshape(3, 3)
        about = before + self._kept(body, second - mass * _steiner(new) - before)
        if len(axes) == 2:
            _possible(about, axes, ({0, 1, 2} - set(axes)).pop())
        return {
            f"{body}.mass": [mass],
            f"{body}.com": com.tolist(),
            f"{body}.inertia": about.ravel().tolist(),
        }


def _steiner(arm: Array) -> Array:
    return np.asarray(arm @ arm * np.eye(3) - np.outer(arm, arm))


def _possible(inertia: Array, axes: list[int], normal: int) -> None:
    """Moments about axes in the plane, of which the motion is independent, such as a body with this moment about the
    normal can have: their difference at most, their sum at least as large."""
    (i, j), about = axes, inertia[normal, normal]
    apart = np.clip(inertia[i, i] - inertia[j, j], -abs(about), abs(about))
    together = max(inertia[i, i] + inertia[j, j], about)
    inertia[i, i], inertia[j, j] = 0.5 * (together + apart), 0.5 * (together - apart)


def _places(item: Parameter) -> tuple[int, ...]:
    """The numbers of the model that a plain parameter sets: two of a symmetric matrix beside its diagonal."""
    i = item.at[0]
    if item.owner.endswith(".inertia"):
        row, column = divmod(i, 3)
        return (i,) if row == column else (i, 3 * column + row)
    return (i,)


def parameters_of(model: CompiledModel, by: Any) -> Parameters:
    """The parameters of these names; None: all that a body's inertia has."""
    return _Finder(model).found(by)


class _Finder:
    """Names -> parameters."""

    def __init__(self, model: CompiledModel) -> None:
        self.model, self.drawn = model, model._drawn
        self.known = {name: np.ravel(np.asarray(x, dtype=float)).tolist() for name, x in model.parameters.items()}
        self.bodies = list(self.drawn.bodies)
        self.normal = self._normal()
        self.points = {name: self._points(name) for name in self.bodies}
        extents = {name: max(map(np.linalg.norm, self._spread(name)), default=0.0) for name in self.bodies}
        self.length = float(max(extents.values(), default=0.0)) or 1.0
        self.extents = {name: float(x) if x > EQUAL * self.length else self.length for name, x in extents.items()}
        masses = [self.known[f"{name}.mass"][0] for name in self.bodies]
        self.mass = float(np.mean([x for x in masses if x > 0.0])) if any(masses) else 1.0

    def found(self, by: Any) -> Parameters:
        if by is None:
            names = [name for name in self.bodies if self._moves(name)]
        elif isinstance(by, str) or not is_list(by):
            raise ArgumentError(
                f"by must be a list of parameters such as ['crank', 'spring.stiffness'], not {shown(by)}", argument="by"
            )
        else:
            names = [str(name) for name in by]
        if not names:
            raise ArgumentError("by is empty; name at least one parameter, or a body for all of its", argument="by")
        items: list[Parameter] = []
        # a body has linear parameters where one of its names is theirs
        linear = {body for name in names for body in self.bodies if name == body or self._linear(body, name)}
        for name in names:
            items += self._named(name, linear)
        labels = [item.label for item in items]
        if twice := next((x for i, x in enumerate(labels) if x in labels[:i]), None):
            raise ArgumentError(f"by names {twice!r} twice; name each parameter once", argument="by")
        owners = dict.fromkeys(item.owner for item in items if item.kind == "plain")
        bodies = dict.fromkeys(item.owner for item in items if item.kind != "plain")
        for body in bodies:
            owners |= dict.fromkeys(f"{body}.{word}" for word in ("mass", "com", "inertia"))
        return Parameters(
            tuple(items),
            {name: list(self.known[name]) for name in owners},
            {body: self._reference(body) for body in bodies},
            {body: self._axes(body) for name in owners if (body := name.rpartition(".")[0]) in self.bodies},
        )

    def _named(self, name: str, linear: set[str]) -> list[Parameter]:
        for body in self.bodies:
            if name == body:
                return list(self._of_body(body).values())
            if body in linear and name.startswith(f"{body}."):
                own = self._of_body(body)
                if name in own:
                    return [own[name]]
                if name in self.known or name.rpartition(".")[0] in self.known:
                    raise ArgumentError(
                        f"by names {name!r} beside parameters of {body!r} about its reference point "
                        f"({listed(list(own))}): name either those, or mass, com and inertia",
                        argument="by",
                    )
        return self._plain(name)

    def _linear(self, body: str, name: str) -> bool:
        return name != f"{body}.mass" and name in self._of_body(body)

    def _of_body(self, body: str) -> dict[str, Parameter]:
        """All inertial parameters of a body in linear form, by label."""
        about, axes = self._reference(body).joint or "origin", self._axes(body)
        mass, extent = self.known[f"{body}.mass"][0] or self.mass, self.extents[body]
        carried = 0.0 if any(other == "ground" for _, other in self.points[body]) else CARRIED

        def of(label: str, unit: str, scale: float, kind: str, at: tuple[int, ...]) -> Parameter:
            later = LATER.get(kind, 0.0) + carried
            return Parameter(f"{body}.{label}", unit, scale, kind, body, at, later)

        found = [of("mass", "kg", mass, "mass", (0,))]
        found += [of(f"first_moment.{_AXES[i]}", "kg m", mass * extent, "first", (i,)) for i in axes]
        pairs = [(i, i) for i in {0, 1, 2} - set(axes)] or _PAIRS
        for i, j in pairs:
            label = f"inertia_about_{about}.{_AXES[i]}{_AXES[j]}"
            found.append(of(label, "kg m^2", mass * extent**2, "inertia", (i, j)))
        return {item.label: item for item in found}

    def _plain(self, name: str) -> list[Parameter]:
        """Numbers of a parameter of the model: all, or one."""
        owner, _, part = name.rpartition(".")
        if name in self.known:
            indices = list(range(len(self.known[name])))
            owner = name
        elif owner in self.known and part in (words := self._words(owner)):
            indices = [words.index(part)]
        else:
            near = [known for known in self.known if known.partition(".")[0] == name.partition(".")[0]]
            labels = [x for body in self.bodies if name.startswith(f"{body}.") for x in self._of_body(body)]
            raise UnknownNameError(
                f"by: there is no parameter {name!r}; there are {listed([*labels, *(near or self.known)])}, and the "
                "names of bodies for all of their inertial parameters",
                name=name,
                known=[*labels, *self.known],
            )
        words = self._words(owner)
        if len(indices) > 1:
            indices = [i for i in indices if self._in_plane(owner, i)]
        unit = parameter_unit(self.drawn, owner)
        return [
            Parameter(
                owner if words == [""] else f"{owner}.{words[i]}",
                own := unit if isinstance(unit, str) else str(unit[i]),
                self._scale(owner, i, own),
                "plain",
                owner,
                (i,),
            )
            for i in indices
        ]

    def _words(self, owner: str) -> list[str]:
        """Words for the numbers of a parameter."""
        count = len(self.known[owner])
        if count == 1:
            return [""]
        if count == 3:
            return list(_AXES)
        if owner.endswith(".inertia") and count == 9:
            return [a + b for a in _AXES for b in _AXES]
        return [str(i) for i in range(count)]

    def _in_plane(self, owner: str, i: int) -> bool:
        """Whether a number of several matters: one half of a symmetric matrix, and in a plane what is in it."""
        name, _, word = owner.rpartition(".")
        if word == "inertia":
            row, column = divmod(i, 3)
            axes = self._axes(name)
            return row <= column if len(axes) == 3 else row == column and row not in axes
        if len(self.known[owner]) != 3 or self.normal is None:
            return True
        if word == "com" or (name in self.drawn.forces and word.startswith("point")):
            return i in self._axes(name) if name in self.bodies else True
        aligned = np.flatnonzero(np.abs(self.normal) > 1.0 - EQUAL)
        return not len(aligned) or i != aligned[0]

    def _scale(self, owner: str, i: int, unit: str) -> float:
        """The natural size of a number: lengths by that of the mechanism, others by their value, else by its unit."""
        if unit == "m":
            return self.length
        name, _, word = owner.rpartition(".")
        if name in self.bodies:
            mass = self.known[f"{name}.mass"][0] or self.mass
            return mass if word == "mass" else mass * self.extents[name] ** 2
        values = self.known[owner]
        if largest := max(map(abs, [values[i]] if values[i] else values)):
            return float(largest)
        if not unit:
            return 1.0
        length, mass, time, _ = map(float, unit_of(unit).dimension)
        return float(self.length**length * self.mass**mass * np.sqrt(self.length / GRAVITY) ** time)

    def _reference(self, body: str) -> Reference:
        """The point of a joint to the ground, else of the first joint; else the origin of the body."""
        points = self.points[body]
        on_ground = {joint for joint, other in points if other == "ground"}
        chosen = next((x for x in points if x[0] in on_ground), next(iter(points), None))
        return Reference("", np.zeros(3)) if chosen is None else Reference(chosen[0], points[chosen])

    def _points(self, body: str) -> dict[tuple[str, str], Array]:
        """Joint and the other body -> its point, in body axes."""
        record = self.drawn.bodies[body]
        rotation, position = np.asarray(record.rotation, dtype=float), np.asarray(record.position, dtype=float)
        found = {}
        for joint in self.drawn.joints.values():
            if body not in (joint.parent, joint.child):
                continue
            child = self.known.get(f"{joint.name}.child_point")
            world = child if child is not None and joint.child == body else self.known[f"{joint.name}.point"]
            other = joint.child if joint.parent == body else joint.parent
            found[joint.name, other] = rotation.T @ (np.array(world) - position)
        return found

    def _spread(self, body: str) -> Iterable[Array]:
        """Its joints and its centre of mass from the reference point."""
        reference = self._reference(body).point
        return [x - reference for x in (*self.points[body].values(), np.array(self.known[f"{body}.com"]))]

    def _axes(self, body: str) -> tuple[int, ...]:
        """Axes of the body along which it moves: two where it moves in a plane across the third, else all."""
        if self.normal is None:
            return 0, 1, 2
        own = np.abs(np.asarray(self.drawn.bodies[body].rotation, dtype=float).T @ self.normal)
        return tuple({0, 1, 2} - {int(own.argmax())}) if own.max() > 1.0 - EQUAL else (0, 1, 2)

    def _normal(self) -> Array | None:
        """Normal of the plane of the mechanism, world axes; None where it moves in space."""
        if not self.model.summary.get("planar"):
            return None
        for joint in self.drawn.joints.values():
            if joint.kind == "revolute":
                axis = np.asarray(joint.geometry["axis"], dtype=float)
                return np.asarray(axis / np.linalg.norm(axis))
        return None

    def _moves(self, body: str) -> bool:
        """Whether it has a mass, and is not fixed to the ground."""
        return self.known[f"{body}.mass"][0] > 0.0 and body not in self._fixed

    @property
    def _fixed(self) -> set[str]:
        found, grown = {"ground"}, True
        while grown:
            more = {
                body
                for joint in self.drawn.joints.values()
                if joint.kind == "fixed" and {joint.parent, joint.child} & found
                for body in (joint.parent, joint.child)
            }
            grown = not more <= found
            found |= more
        return found
