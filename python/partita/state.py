"""A state: time, coordinates and velocities, with access by joint name."""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import notebook
from .errors import ArgumentError, UnknownNameError
from .naming import Names, coordinate_axes, coordinate_units
from .numeric import MaybeNone, floats, is_list, quaternion, real, shown
from .sensing import Senses

Array = NDArray[np.float64]
Span = tuple[int, int]

# Numbers by which the core represents a spatial rotation: nine cosines and three rates. No joint has as many
# coordinates.
TURN = 12

Beyond = Callable[[str, float, Array, Array], tuple[Array, Array]]
"""Coordinates and velocities of a joint that are not part of the state (t, q, v)."""


class Layout:
    """The indices of the coordinates of each joint in q and v, from the summary of a compiled model."""

    def __init__(self, summary: dict[str, Any] | None = None) -> None:
        self.names: list[str] = []
        self.velocity_names: list[str] = []
        self.by_names_alone = True
        self.parting: tuple[str, ...] = ()
        self.units: tuple[list[str], list[str]] = [], []
        self._spans: dict[str, tuple[Span | None, Span | None]] = {}
        self._beyond: dict[str, Span] = {}
        self._drawn: dict[str, Array] = {}
        self._axes: dict[str, tuple[list[str], list[str]]] = {}
        self._root: object = self
        self._read: Beyond | None = None
        self.senses = Senses({}, {})
        if summary is not None:
            self.fill(summary)

    def fill(self, summary: dict[str, Any]) -> None:
        """Take names and spans from a model's summary."""
        self.names, self.velocity_names = list(summary["coordinates"]), list(summary["velocities"])
        self.units = coordinate_units(summary, Names(tuple(self.names), tuple(self.velocity_names)))
        self.by_names_alone = False
        self.parting = tuple(summary.get("parting", ()))
        first = sum(n for _, n in self._beyond.values())
        for joint in summary["joints"]:
            self._spans[joint["name"]] = _span(joint["state_q"]), _span(joint["state_v"])
            self._axes[joint["name"]] = self._labels_of(joint)
            if joint.get("drawn"):
                self._drawn[joint["name"]] = np.array(joint["drawn"], dtype=float)
            count = joint["v"][1]
            if joint["state_v"] is None and count > 0:
                # a spatial rotation is represented by nine cosines and three rates
                shown = count if count == joint["q"][1] else count + 9
                self._beyond[joint["name"]] = first, shown
                first += shown

    def _labels_of(self, joint: dict[str, Any]) -> tuple[list[str], list[str]]:
        """Names of the coordinates and of the velocities of a joint."""
        q, v = self._spans[joint["name"]]
        if q is None or v is None:
            return coordinate_axes(joint), list(joint["axes"])
        own = [name.rpartition(".")[2] for name in self.names[q[0] : sum(q)]]
        return own, [name.rpartition(".")[2] for name in self.velocity_names[v[0] : sum(v)]]

    def reading(self, core: Any, summary: dict[str, Any]) -> Layout:
        """The same layout, whose states know the joints that are not part of them as this model computes them."""
        numbers = {joint["name"]: i for i, joint in enumerate(summary["joints"])}

        def read(joint: str, t: float, q: Array, v: Array) -> tuple[Array, Array]:
            found = core.motion(np.array([t]), q[None], v[None]).joints([numbers[joint]])
            return found["joint_position"][0], found["joint_velocity"][0]

        found = Layout()
        found.__dict__.update(self.__dict__)
        found._read = read
        return found

    def __deepcopy__(self, memo: dict[int, Any]) -> Layout:
        """Itself: a layout that is filled never changes."""
        return self

    def __getstate__(self) -> dict[str, Any]:
        """Names and spans: a pickled state has no model."""
        return {**self.__dict__, "_read": None}

    def fits(self, summary: dict[str, Any]) -> bool:
        """Whether the state has the coordinates of a model; a joint and a body may share the names of theirs."""
        joints = summary["joints"]
        if self.by_names_alone or self.names != list(summary["coordinates"]):
            return self.names == list(summary["coordinates"])
        return all(self._spans.get(j["name"]) == (_span(j["state_q"]), _span(j["state_v"])) for j in joints)

    def is_like(self, other: Layout) -> bool:
        """Whether it is that layout, or nothing but its names."""
        return self._root is other._root or (self.by_names_alone and self.names == other.names)

    @property
    def tree_joints(self) -> list[str]:
        """Names of the joints whose coordinates are part of the state."""
        return [name for name, (q, _) in self._spans.items() if q is not None]

    def part(self, values: Array, span: Span, joint: Any) -> Any:
        """The coordinates or velocities of a joint in the state, a spatial rotation in the axes of the drawing."""
        found = _part(values, span)
        if (axes := self._drawn.get(str(joint))) is not None:
            found = np.concatenate([found[:-3], axes.T @ found[-3:]])
        return found

    def beyond(self, joint: Any) -> Span | None:
        """First index and number of a joint that closes a loop among the arguments of functions after q, and after
        v."""
        return self._beyond.get(str(joint))

    def q(self, joint: Any) -> Span:
        """First index and number of the joint's coordinates in q."""
        return self._find(joint, False)[0]

    def v(self, joint: Any) -> Span:
        """First index and number of the joint's velocities in v."""
        return self._find(joint, True)[1]

    def place(self, key: Any, rates: bool) -> tuple[Any, int | None]:
        """The joint that `key` names, and which of its coordinates or velocities; None: all of them. A key is a joint,
        one of its coordinates by name ("F.wz"), or `pt.Coordinate(joint, 1)`."""
        if hasattr(key, "joint") and hasattr(key, "coordinate"):
            name = str(key.joint)
            labels = self._axes.get(name, ([], []))[rates]
            if name in self._axes and key.coordinate not in range(len(labels)):
                raise ArgumentError(
                    f"{shown(key)} does not exist: joint {name!r} has {len(labels)} "
                    f"{'velocities' if rates else 'coordinates'}, counted from 0: "
                    f"{', '.join(f'{name}.{axis}' for axis in labels) or 'none'}",
                    argument="joint",
                )
            return key.joint, key.coordinate
        owner, _, axis = str(key).rpartition(".")
        if str(key) not in self._spans and axis in (labels := self._axes.get(owner, ([], []))[rates]):
            return owner, labels.index(axis)
        return key, None

    def known(self, joint: Any, rates: bool, t: float, q: Array, v: Array) -> Any:
        """The coordinates or velocities of a joint, in the state or not."""
        span = self._spans.get(str(joint))
        if span is not None and span[0] is None and self._read is not None:
            found = self._read(str(joint), t, q, v)[rates]
            return float(found[0]) if len(found) == 1 else found
        return self.part(v if rates else q, self._find(joint, rates)[rates], joint)

    def _find(self, joint: Any, rates: bool) -> tuple[Span, Span]:
        name = str(joint)
        if name not in self._spans:
            known = list(self._spans)
            close = difflib.get_close_matches(name, known, n=1)
            if (owner := name.rpartition(".")[0]) in known:
                axes = [f"{owner}.{axis}" for axis in self._axes[owner][rates]]
                hint = f'the joint "{owner}" has {", ".join(axes) or "no motion"}'
            else:
                hint = f'did you mean "{close[0]}"?' if close else f"known joints: {', '.join(known) or 'none'}"
            raise UnknownNameError(f'there is no joint "{name}"; {hint}', name=name, known=known)
        q, v = self._spans[name]
        if q is None or v is None:
            tree = ", ".join(self.tree_joints) or "none"
            raise ArgumentError(
                f'the coordinates of joint "{name}" are not part of the state: the model was compiled '
                "with other coordinates or the "
                "joint closes a loop, so that its motion follows from the others. Joints in the state: "
                f'{tree}; cut="never" '
                "keeps a joint among them, and a result knows the motion of every joint",
                argument="joint",
            )
        return q, v


class StateView:
    """A state as passed to a user function: time `t`, coordinates `q`, velocities `v`, and both by joint name,
    including those of joints that close loops or belong to absolute coordinates (their spatial angles within half a
    turn either way; for spatial rotations the quaternion whose first number is not negative)."""

    __slots__ = ("_beyond", "_layout", "_seen", "q", "t", "v")

    def __init__(
        self,
        t: float,
        q: Array,
        v: Array,
        layout: Layout,
        beyond: tuple[Array, Array] | None = None,
        seen: Array | None = None,
    ) -> None:
        self.t, self.q, self.v = t, q, v
        self._layout, self._beyond, self._seen = layout, beyond, seen

    def position(self, joint: Any) -> Any:
        """Coordinate of a joint by name or handle [rad or m]: a float if it has one, else an array; see
        `State.position`."""
        return self._number(joint, False)

    def velocity(self, joint: Any) -> Any:
        """Velocity of a joint by name or handle [rad/s or m/s]: a float if it has one, else an array; one of several by
        its name, such as "F.wz", or as `pt.Coordinate(joint, 1)`."""
        return self._number(joint, True)

    def _number(self, key: Any, rates: bool) -> Any:
        joint, column = self._layout.place(key, rates)
        if self._beyond is None or (span := self._layout.beyond(joint)) is None:
            found = self._layout.known(joint, rates, self.t, self.q, self.v)
        elif span[1] < TURN:
            found = _part(self._beyond[rates], span)
        else:
            found = (_turning if rates else _turned)(self._beyond[rates], span)
        return found if column is None or isinstance(found, float) else float(found[column])

    def sensor(self, name: Any) -> Any:
        """The value of a position or velocity sensor: a float or an array, see `Mechanism.add_sensor`.

        Available only inside functions f(t, state). Raises `UnknownNameError` for an unknown sensor, and
        `ArgumentError` for one that needs accelerations or forces, since these depend on such functions.
        """
        if self._seen is None:
            raise ArgumentError(
                "sensors are read in force laws, and from a run by run.sensor(name); a state alone has no mechanism",
                argument="name",
            )
        return self._layout.senses.read(name, self.t, self._seen)


class State(StateView):
    """Time, coordinates and velocities of a mechanism or a system.

    `Mechanism.assemble` returns states that satisfy the constraints. States are plain values without a reference to the
    model, and `copy` returns an independent one.

    Attributes:
        t: time [s].
        q: coordinates (nq,), named by `names`.
        v: velocities (nv,), named by `velocity_names`.
        assembly: report of the assembly (residual, iterations, ...), or None.
        held: names of the joints whose positions or rates `assemble` was given.

    Raises:
        ArgumentError: the arrays are not flat, hold NaN or infinity, or do not fit the names.

    >>> import partita as pt
    >>> state = pt.State(0.0, [1.0, 2.0], [0.0, 0.0], names=["x", "y"])
    >>> state.q
    array([1., 2.])
    """

    __slots__ = ("assembly", "held")

    def __init__(
        self,
        t: float,
        q: ArrayLike,
        v: ArrayLike,
        names: list[str] | None = None,
        velocity_names: list[str] | None = None,
        *,
        layout: Layout | None = None,
        assembly: dict[str, Any] | None = None,
    ) -> None:
        if layout is None:
            layout = Layout()
            layout.names = _labels("names", names)
            layout.velocity_names = (
                list(layout.names) if velocity_names is None else _labels("velocity_names", velocity_names)
            )
        super().__init__(finite_time(t), _flat("q", q, layout.names), _flat("v", v, layout.velocity_names), layout)
        self.assembly: dict[str, Any] | MaybeNone = assembly
        self.held: tuple[str, ...] = ()

    @classmethod
    def computed(cls, t: float, q: Array, v: Array, layout: Layout) -> State:
        """The state that the core returned for this layout: arrays of its own, finite and of its sizes."""
        state = cls.__new__(cls)
        state.t, state.q, state.v, state._layout = t, q, v, layout
        state._beyond = state._seen = state.assembly = None
        state.held = ()
        return state

    @property
    def names(self) -> list[str]:
        """Names of the coordinates q."""
        return list(self._layout.names)

    @property
    def velocity_names(self) -> list[str]:
        """Names of the velocities v."""
        return list(self._layout.velocity_names)

    def is_of(self, summary: dict[str, Any]) -> bool:
        """Whether the coordinates are those of the model with this summary."""
        return self._layout.fits(summary)

    def position(self, joint: Any) -> Any:
        """Coordinate of a joint [rad or m].

        Args:
            joint: name or handle of a joint; of one coordinate of several its name, such as "F.x", or
                `pt.Coordinate(joint, 1)`. Joints that are not part of the state (they close a loop, or the coordinates
                are absolute) are computed by the model that the state was made with: spatial angles within half a turn
                either way, of spatial rotations the quaternion.

        Returns:
            A float for one coordinate, else an array (number of coordinates,).

        Raises:
            UnknownNameError: no such joint.
            ArgumentError: there is no such coordinate, or the joint is not part of a state that was pickled, or read
                from a file, without its model.

        >>> import partita as pt
        >>> m = pt.catalogue.load("four-bar")
        >>> state = m.assemble({"A": 0.5}, rates={"A": 1.0})
        >>> [joint for joint in m.joints if joint not in state.names], len({state.position(j) for j in m.joints})
        (['C'], 4)
        """
        return super().position(joint)

    def copy(self) -> State:
        """An independent copy."""
        copied = State(self.t, self.q.copy(), self.v.copy(), layout=self._layout, assembly=self.assembly)
        copied.held = self.held
        return copied

    def _repr_html_(self) -> str:
        """A table of coordinates and velocities, in a notebook."""
        rows = [("t", f"{self.t:g} s")]
        for values, names, units in (
            (self.q, self.names, self._layout.units[0]),
            (self.v, [f"velocity of {name}" for name in self.velocity_names], self._layout.units[1]),
        ):
            labels = names or [str(i) for i in range(len(values))]
            of = [*units, *[""] * (len(values) - len(units))]
            shown = [
                (label, f"{value:.6g} {'' if unit == '1' else unit}".rstrip())
                for label, value, unit in zip(labels, values, of, strict=True)
            ]
            more = len(shown) - notebook.MOST_ROWS
            rows += shown[: notebook.MOST_ROWS] + ([("...", f"{more} more")] if more > 0 else [])
        return notebook.table("State", rows)

    def __repr__(self) -> str:
        def listed(values: Array, names: list[str]) -> str:
            labels = names or [str(i) for i in range(len(values))]
            shown = [f"{name}={value:.6g}" for name, value in zip(labels, values, strict=True)]
            return ", ".join(shown if len(shown) <= 8 else [*shown[:7], f"... {len(shown)} in all"])

        return f"State(t={self.t:g}, q: {listed(self.q, self.names)}; v: {listed(self.v, self.velocity_names)})"


def _span(pair: Any) -> Span | None:
    return None if pair is None else (int(pair[0]), int(pair[1]))


def _part(values: Array, span: Span) -> Any:
    first, count = span
    return float(values[first]) if count == 1 else values[first : first + count]


def _labels(what: str, names: Any) -> list[str]:
    """Names as texts; None: none."""
    if names is None:
        return []
    if not is_list(names):
        raise ArgumentError(f"{what} must be a list of texts, not {shown(names)}", argument=what)
    return [str(name) for name in names]


def finite_time(t: Any) -> float:
    """`t` as a finite number of seconds, or an `ArgumentError`."""
    try:
        time = real(t)
    except TypeError as error:
        raise ArgumentError(f"t must be a number, not {shown(t)}", argument="t") from error
    if not math.isfinite(time):
        raise ArgumentError(f"t is {time}; give a finite time", argument="t")
    return time


def _flat(what: str, values: ArrayLike, names: list[str]) -> Array:
    """A new flat array of finite numbers, one for each name (if there are any)."""
    try:
        array = floats(values)
    except TypeError as error:
        raise ArgumentError(f"{what} must be an array of numbers, not {shown(values)}", argument=what) from error
    if array.ndim != 1 or (names and array.size != len(names)):
        raise ArgumentError(
            f"{what} must be a flat array{f' of {len(names)} numbers' if names else ''}, not of shape {array.shape}",
            argument=what,
        )
    if not np.isfinite(array).all():
        bad = int(np.argmin(np.isfinite(array)))
        raise ArgumentError(
            f"{what}[{bad}] ({names[bad] if names else bad}) is {array[bad]}; give finite numbers",
            argument=what,
        )
    return array


def _turned(values: Array, span: Span) -> Array:
    """Translations, followed by the quaternion of a rotation that is represented by its cosines."""
    first, last = span[0], sum(span)
    slides, cosines = values[first : last - TURN], values[last - TURN : last - 3].reshape(3, 3)
    turn = np.array(quaternion(cosines))
    return np.concatenate([slides, turn if turn[0] >= 0.0 else -turn])


def _turning(values: Array, span: Span) -> Array:
    """Their rates, and those of the rotation about the axes of the child."""
    first, last = span[0], sum(span)
    return np.concatenate([values[first : last - TURN], values[last - 3 : last]])
