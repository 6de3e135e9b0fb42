"""A kinematic study: positions, rates and accelerations at many poses, without dynamics."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple, NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import ArgumentError
from ..naming import index_of, joint_units, name_of
from ..notebook import names, table
from ..numeric import shown
from ..results.joint import JointKinematics
from ..results.motion import Motion
from ..results.sensor import LiveSensors
from ..results.source import ModelSource
from ..state import Layout, State
from ..tolerance import NEGLIGIBLE
from .still import place

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FloatArray = NDArray[np.float64]
Goal = tuple[str, str, int, int, tuple[float, ...]]


class KinematicSource(ModelSource):
    """Bodies and joints of a motion without forces."""

    def _refuse(self) -> NoReturn:
        raise ArgumentError(
            "kinematics computes motions, not forces: reactions, efforts and sensors of them need dynamics; simulate "
            "the motion, with drives where it is prescribed, and ask its result",
            argument="name",
        )

    def reaction(self, j: int, v: tuple[int, int]) -> Mapping[str, NDArray[Any]]:
        self._refuse()

    @property
    def efforts(self) -> FloatArray:
        self._refuse()

    @property
    def reactions(self) -> Mapping[str, NDArray[Any]]:  # type: ignore[override]  # there are none to be cached
        self._refuse()

    def __reduce__(self) -> NoReturn:
        raise TypeError("a kinematic study needs its model and cannot be pickled; store to_xarray() or to_pandas()")


class Study(NamedTuple):
    """What was asked for, and what the core needs to be asked again."""

    core: Any
    summary: Mapping[str, Any]
    layout: Layout
    near: State
    goals: list[Goal]
    values: FloatArray
    """(n, goals)."""
    indices: Mapping[Any, list[int]]
    ratios: FloatArray
    """(n, goals, nv): velocities for unit rate of each goal alone."""
    resolve: Callable[[str, Any], list[Goal]]
    """The goals that a key names."""


@dataclass(frozen=True, eq=False)
class PointMotion:
    """Motion of a point of a body over n poses, in world axes: a coupler curve."""

    position: FloatArray
    """(n, 3): path [m]."""
    velocity: FloatArray
    """(n, 3): velocity [m/s]."""
    acceleration: FloatArray
    """(n, 3): acceleration [m/s^2]."""

    def __repr__(self) -> str:
        return f"<motion of a point: {len(self.position)} poses>"


@dataclass(frozen=True, eq=False)
class Limit:
    """An end of the range in which goals can be reached on a branch."""

    goals: dict[Any, Any]
    """Values of the goals there."""
    pose: int
    """The last pose that was reached."""
    state: State
    """The position there, at rest."""
    located: bool
    """Whether it is the position in which the goal is stationary, to round-off. Otherwise (several goals vary at
    once, or branches meet there) it is the last position of the continuation, about a millionth of the step before the
    end."""

    def __repr__(self) -> str:
        return f"<limit after pose {self.pose}: {_values(self.goals)}>"


@dataclass(frozen=True, eq=False)
class DeadPoint:
    """A position in which a joint is stationary while the mechanism moves: from there it cannot drive it."""

    joint: str
    """The joint, or its coordinate, such as "C.slide"."""
    value: float
    """Its extreme position [rad or m]."""
    goals: dict[Any, Any]
    """Values of the goals there."""
    pose: int
    """The last pose before it."""
    state: State
    """The position there, at rest."""

    def __repr__(self) -> str:
        return f"<dead point of {self.joint!r} at {self.value:.6g}: {_values(self.goals)}>"


@dataclass(frozen=True, eq=False, repr=False)
class Kinematics(Motion):
    """Result of `Mechanism.kinematics`: n poses with their rates and accelerations, from geometry alone.

    Joints, bodies and sensors are asked for by name, as in a `Result`, and computed on access. Rows of poses that were
    not reached are NaN.
    """

    t: FloatArray
    """(n,): the time at which prescribed motions were evaluated [s], the same for all poses."""
    q: FloatArray
    """(n, nq): coordinates [m, rad; quaternions scalar first]."""
    v: FloatArray
    """(n, nv): velocities [m/s, rad/s]; NaN where the rates of the goals do not determine them."""
    vdot: FloatArray
    """(n, nv): accelerations [m/s^2, rad/s^2]; NaN likewise."""
    reached: NDArray[np.bool_]
    """(n,): which poses were reached on the branch."""
    status: NDArray[np.str_]
    """(n,): "reached"; "undetermined" where rates are (a limit of the goals, or branches meet); else why not reached,
    as in `Poses`."""
    reasons: dict[int, str]
    """Index of a pose -> why it was not reached, or has no rates."""
    margin: FloatArray
    """(n,): sine of the angle between the goals and what they cannot move: 0 where they do not determine the motion, 1
    at best."""
    notes: tuple[str, ...]
    """What the study left open: undetermined rates, rotations that move no other body."""
    _source: KinematicSource
    _sensors: LiveSensors
    _study: Study

    @property
    def summary(self) -> Mapping[str, Any]:
        """The model's own description: bodies, joints, sizes, removed rows."""
        return self._study.summary

    @property
    def goals(self) -> dict[Any, FloatArray]:
        """Values of the goals, (n,) or (n, numbers of the goal); of an orientation, after the position, the rotation
        vector relative to the state of the branch."""
        return _by_key(self._study.indices, self._study.values)

    def __len__(self) -> int:
        return len(self.reached)

    def joint(self, name: Any) -> JointKinematics:
        """Motion of a joint by name or handle, in the tree or closing a loop; `UnknownNameError` with the nearest
        names."""
        name = name_of(name)
        about, data = self._joint(name)
        return JointKinematics(name, about["kind"], about["parent"], about["child"], data, joint_units(about)[0])

    def point(self, body: Any, point: ArrayLike = (0.0, 0.0, 0.0)) -> PointMotion:
        """Path, velocity and acceleration of a point of a body, `point` in body axes [m]: a coupler curve.

        >>> import numpy as np
        >>> import partita as pt
        >>> m = pt.catalogue.load("four-bar")
        >>> k = m.kinematics({"A": np.linspace(0.0, 6.0, 7)}, rates={"A": 2.0})
        >>> k.point("coupler", (0.5, 0.2, 0.0)).position.shape
        (7, 3)
        """
        seen = self.body(str(body))
        return PointMotion(seen.point(point), seen.point_velocity(point), seen.point_acceleration(point))

    def state(self, index: int) -> State:
        """Pose number `index` with its velocities, at rest where these are undetermined; `ArgumentError` where it was
        not reached."""
        i = place(index, len(self), "a pose")
        if not self.reached[i]:
            raise ArgumentError(f"pose {i} was not reached: {self.reasons[i]}", argument="index")
        return self._state(self.q[i], np.nan_to_num(self.v[i]))

    def ratio(self, of: Any, by: Any = None) -> FloatArray:
        """Transmission ratio (n,): derivative of one coordinate by another along the motion, exact (P1).

        It does not depend on rates. `of` and `by` name joints, coordinates such as "C.slide", or coordinates of points,
        ("coupler", (0.6, 0, 0), "x"). With one goal both are free; with several, `by` is one of them and the others are
        held. Infinite or NaN where `by` is stationary.

        Args:
            of: what moves.
            by: what drives; None: the goal, if there is one.

        >>> import numpy as np
        >>> import partita as pt
        >>> k = pt.catalogue.load("four-bar").kinematics({"A": np.linspace(0.0, 6.0, 7)}, rates={"A": 2.0})
        >>> bool(np.allclose(k.ratio("D", "A"), k.joint("D").velocity[:, 0] / 2.0, rtol=1e-12))
        True
        """
        study = self._study
        moved = self._one("of", of)
        if by is None and len(study.goals) > 1:
            raise ArgumentError(
                f"ratio: there are {len(study.goals)} goals ({', '.join(goal[0] for goal in study.goals)}); say by "
                "which",
                argument="by",
            )
        driver = study.goals[0] if by is None else self._one("by", by)
        which = [k for k, goal in enumerate(study.goals) if goal[1:] == driver[1:]]
        if which:
            return self._rate(moved, study.ratios[:, which[0]])
        if len(study.goals) > 1:
            raise ArgumentError(
                f"ratio: {driver[0]!r} is none of the {len(study.goals)} goals "
                f"({', '.join(goal[0] for goal in study.goals)}), of which the others are held",
                argument="by",
            )
        alone = study.ratios[:, 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(self._rate(moved, alone) / self._rate(driver, alone))

    def transmission(self, coupler: Any, output: Any) -> FloatArray:
        """Transmission angle (n,) [rad], 0 to pi: how well a coupler moves an output link; pi/2 is best, 0 and pi are
        dead positions of a drive at the other end.

        `coupler` is the joint at the driven end of the coupler, `output` the revolute or prismatic joint on which the
        output link moves; the link and the coupler share one more joint. For a four-bar linkage it is the angle between
        coupler and output link (the acute one of textbooks is `min(mu, pi - mu)`). In general its sine is that of the
        cosine of the pressure angle: the coupler pushes along the line of its two joints, the common joint moves across
        the axis of a revolute or along a prismatic joint.

        >>> import numpy as np
        >>> import partita as pt
        >>> k = pt.catalogue.load("four-bar").kinematics({"A": np.linspace(0.0, 6.0, 7)})
        >>> mu = k.transmission("B", "D")
        >>> bool((mu > 0.0).all() and (mu < np.pi).all())
        True
        """
        joints = self.summary["joints"]
        numbers = [index_of(str(name), self.names.joints, "joint") for name in (coupler, output)]
        first, last = (joints[j] for j in numbers)
        kind = str(last["kind"])
        if kind not in ("revolute", "prismatic"):
            raise ArgumentError(
                f"transmission: output joint {last['name']!r} is {kind}; a transmission angle is defined for an output "
                "link on a revolute or prismatic joint",
                argument="output",
            )
        ends = [{joint["parent"], joint["child"]} - {"ground"} for joint in (first, last)]
        common = [
            joint["name"]
            for j, joint in enumerate(joints)
            if j not in numbers
            and any({a, b} == {joint["parent"], joint["child"]} for a in ends[0] for b in ends[1] if a != b)
        ]
        if len(common) != 1:
            found = f"{len(common)} do: {', '.join(common)}" if common else "none does"
            raise ArgumentError(
                f"transmission: one joint must join a body of {first['name']!r} to a body of {last['name']!r}, the "
                f"coupler to the output link; {found}",
                argument="coupler",
            )
        end, axis = self.joint(common[0]).point, self._axis(numbers[1])
        push = self.joint(first["name"]).point - end
        along = push / np.linalg.norm(push, axis=1, keepdims=True)
        beside = np.einsum("ij,ij->i", along, axis)
        if kind == "prismatic":
            across = np.linalg.norm(along - beside[:, None] * axis, axis=1)
            return np.asarray(np.arctan2(np.abs(beside), across))
        arm = self.joint(last["name"]).point - end
        arm -= np.einsum("ij,ij->i", arm, axis)[:, None] * axis
        arm /= np.linalg.norm(arm, axis=1, keepdims=True)
        inward, across = np.einsum("ij,ij->i", along, arm), np.einsum("ij,ij->i", along, np.cross(axis, arm))
        return np.asarray(np.arctan2(np.abs(across), np.copysign(np.hypot(inward, beside), inward)))

    def _axis(self, j: int) -> FloatArray:
        """(n, 3): axis of joint j in the world."""
        core, n = self._study.core, len(self)
        rest = core.motion(self.t, self.q, *np.zeros((2, n, core.nv)), np.zeros((n, core.rows)))
        # the axes of a joint depend on the position alone
        found: FloatArray = rest.reaction(j)["joint_rotation"][:, :, 2]
        return found

    @cached_property
    def limits(self) -> tuple[Limit, ...]:
        """Ends of the range of the goals within the poses asked for: between a pose that was reached and a neighbour
        that was not, the position in which the goal is stationary, located to round-off.

        >>> import numpy as np
        >>> import partita as pt
        >>> m = pt.catalogue.load("four-bar")
        >>> k = m.kinematics({"D": np.linspace(0.0, 3.0, 31)})       # the rocker, not the crank
        >>> [limit.located for limit in k.limits]
        [True]
        """
        study, found = self._study, []
        for i in np.flatnonzero(self.reached[1:] != self.reached[:-1]):
            inside, outside = (i, i + 1) if self.reached[i] else (i + 1, i)
            end = study.core.limit(study.near.t, self.q[inside], study.goals, study.values[outside])
            if end is not None:
                q, values, located = end
                goals = _by_key(study.indices, values[None])
                found.append(Limit(_single(goals), int(inside), self._state(q), bool(located)))
        return tuple(found)

    @cached_property
    def dead_points(self) -> tuple[DeadPoint, ...]:
        """Positions in which the coordinate of a joint is stationary while the goals move from pose to pose (its ratio
        to the goal is zero), located to round-off; those of the goals themselves are `limits`.

        >>> import numpy as np
        >>> import partita as pt
        >>> k = pt.catalogue.load("four-bar").kinematics({"A": np.linspace(0.0, 2.0 * np.pi, 37)})
        >>> [point.joint for point in k.dead_points if point.joint == "D"]        # the rocker turns back twice
        ['D', 'D']
        """
        found: list[DeadPoint] = []
        for joint in self.summary["joints"]:
            # of a spatial rotation no coordinate alone is stationary
            labels = self._scalars(joint)
            for label in labels:
                found += self._dead_of(label)
        return tuple(sorted(found, key=lambda point: point.pose))

    def _scalars(self, joint: Mapping[str, Any]) -> list[Goal]:
        coordinates, velocities = joint["q"][1], joint["v"][1]
        if coordinates == 0:
            return []
        goals = self._study.resolve("joint", joint["name"])
        return goals if coordinates == velocities else goals[: velocities - 3]

    def _dead_of(self, goal: Goal) -> list[DeadPoint]:
        study, last = self._study, len(self) - 1
        if last < 1 or any(goal[1:] == other[1:] for other in study.goals):
            return []
        alone = [self._rate(goal, study.ratios[:, k]) for k in range(len(study.goals))]
        rates, step = np.stack(alone, axis=1), np.diff(study.values, axis=0)
        before, after = np.sum(rates[:-1] * step, axis=1), np.sum(rates[1:] * step, axis=1)
        size = np.abs(np.concatenate([before, after, step.ravel()]))
        zero = NEGLIGIBLE * np.max(size[np.isfinite(size)], initial=0.0)
        with np.errstate(invalid="ignore"):
            turns = (np.abs(before) > zero) & (np.abs(after) > zero) & (before * after < 0.0)
            still = np.append(np.abs(before), np.abs(after[-1])) <= zero
        found = [self._stationary(goal, int(i), int(i) + 1) for i in np.flatnonzero(turns)]
        for i in np.flatnonzero(still):
            beside = [j for j in (i - 1, i + 1) if 0 <= j <= last]
            if any(still[j] for j in beside):
                continue  # it does not move at all
            # its neighbours locate it, where the goals pass through it on a straight path
            straight = len(beside) == 2 and len(study.goals) == 1 and step[i - 1, 0] * step[i, 0] > 0.0
            nearer = self._stationary(goal, int(i) - 1, int(i) + 1) if straight else None
            found.append(nearer or self._dead(goal, int(i), self.q[i], study.values[i]))
        return [point for point in found if point is not None]

    def _stationary(self, goal: Goal, first: int, last: int) -> DeadPoint | None:
        """Where it is stationary on the straight path of the goals from one pose to another."""
        study = self._study
        end = study.core.stationary(study.near.t, self.q[first], study.goals, study.values[last], goal)
        if end is None:
            return None
        q, part = end
        return self._dead(goal, first, q, (1.0 - part) * study.values[first] + part * study.values[last])

    def _dead(self, goal: Goal, pose: int, q: FloatArray, values: FloatArray) -> DeadPoint:
        goals = _single(_by_key(self._study.indices, values[None]))
        return DeadPoint(goal[0], self._value(goal, q), goals, pose, self._state(q))

    def _value(self, goal: Goal, q: FloatArray) -> float:
        study = self._study
        if goal[1] == "own":
            return float(q[goal[2]])
        motion = np.array([study.near.t]), q[None], np.zeros((1, study.core.nv))
        return float(study.core.motion(*motion).joints([goal[2]])["joint_position"][0, goal[3]])

    def _one(self, what: str, key: Any) -> Goal:
        goals = self._study.resolve(what, key)
        if len(goals) != 1:
            raise ArgumentError(
                f"ratio: {shown(key)} has {len(goals)} coordinates ({', '.join(goal[0] for goal in goals)}); name one",
                argument=what,
            )
        return goals[0]

    def _rate(self, goal: Goal, v: FloatArray) -> FloatArray:
        """Rate (n,) of a coordinate for the velocities v (n, nv)."""
        label, kind, i, part, numbers = goal
        core, t = self._study.core, self.t
        if kind == "point":
            seen = core.motion(t, self.q, v).bodies([i])
            arm = seen["body_rotation"][:, 0] @ np.array(numbers)
            moved = seen["body_velocity"][:, 0] + np.cross(seen["body_angular_velocity"][:, 0], arm)
            return np.asarray(moved[:, part])
        if kind == "joint":
            joint = self.summary["joints"][i]
            if joint["q"][1] == joint["v"][1] or part < joint["v"][1] - 3:
                return np.asarray(core.motion(t, self.q, v).joints([i])["joint_velocity"][:, part])
        elif label in self.names.velocities:
            return np.asarray(v[:, self.names.velocities.index(label)])
        raise ArgumentError(
            f"ratio: {label!r} is one number of a spatial rotation, which has no rate of its own; use points of the "
            "body",
            argument="of",
        )

    def _state(self, q: FloatArray, v: FloatArray | None = None) -> State:
        study = self._study
        return State(study.near.t, q.copy(), np.zeros(study.core.nv) if v is None else v, layout=study.layout)

    @property
    def success(self) -> bool:
        """Whether every pose was reached, with determined rates."""
        return bool((self.status == "reached").all())

    @property
    def abscissa(self) -> str | None:
        """The coordinate over which figures and tables are drawn: the first goal that is a coordinate of a joint and
        varies, otherwise the first joint that does."""
        varies = [goal for k, goal in enumerate(self._study.goals) if np.ptp(self._study.values[:, k]) > 0.0]
        single = {joint["name"] for joint in self.summary["joints"] if joint["q"][1] == 1}
        for goal in varies:
            if goal[0] in single:
                return goal[0]
        for name in self.names.joints:
            x = self.joint(name).position[self.reached, 0] if name in single else np.zeros(0)
            if x.size and np.ptp(x) > 0.0:
                return name
        return None

    def plot(
        self,
        *what: str,
        path: str | os.PathLike[str] | None = None,
        x: str | None = None,
        ax: Axes | None = None,
        points: Mapping[str, Any] | None = None,
    ) -> Figure:
        """Plot `what` in a Matplotlib figure over the goal: "coordinates", "velocities", "accelerations" (the default:
        these three), "paths" (coupler curves of `points`, {name: (body, point in body axes)}, or of the joints), or the
        name of a sensor. Other arguments are those of `Result.plot`.

        >>> import numpy as np
        >>> import partita as pt
        >>> k = pt.catalogue.load("four-bar").kinematics({"A": np.linspace(0.0, 2.0 * np.pi, 37)}, rates={"A": 1.0})
        >>> k.plot("velocities").axes[0].get_xlabel()
        'A [deg]'
        """
        from ..plots import plot

        known = ("coordinates", "velocities", "accelerations", "paths")
        words = what or known[:3]
        for word in words:
            if word not in known and word not in self.sensors:
                raise ArgumentError(
                    f"plot: a kinematic study shows {', '.join(known)} and its sensors"
                    f"{': ' + ', '.join(self.sensors) if self.sensors else ''}, not {shown(word)}",
                    argument="what",
                )
        over = x if x is not None or "paths" in words else self.abscissa
        return plot(self, *words, path=path, x=over, ax=ax, points=points)  # type: ignore[arg-type]  # no forces

    def to_xarray(self) -> xarray.Dataset:
        """Coordinates, velocities, accelerations, and all bodies, joints and sensors, as an `xarray.Dataset` along
        `pose`, with the goals as coordinates, `units` and `long_name`. `MissingDependencyError` without xarray.

        >>> import numpy as np
        >>> import partita as pt
        >>> k = pt.catalogue.load("four-bar").kinematics({"A": np.linspace(0.0, 6.0, 7)}, rates={"A": 1.0})
        >>> k.to_xarray().joint_velocity.sel(joint_freedom="D").dims
        ('pose',)
        """
        from .tables import to_xarray

        return to_xarray(self)

    def to_pandas(self) -> pandas.DataFrame:
        """One row per pose, one column per number, as in `Result.to_pandas`; `df.attrs["units"]` has the units.
        `MissingDependencyError` without pandas."""
        from .tables import to_pandas

        return to_pandas(self)

    def __repr__(self) -> str:
        kinds, counts = np.unique(self.status, return_counts=True)
        words = ", ".join(f"{count} {kind}" for kind, count in zip(kinds, counts, strict=True))
        goals = ", ".join(goal[0] for goal in self._study.goals)
        return f"<Kinematics of {self.title!r} over {goals}: {len(self)} poses: {words or 'none'}>"

    def _repr_html_(self) -> str:
        """A small table, in a notebook."""
        kinds, counts = np.unique(self.status, return_counts=True)
        rows = [
            ("goals", names([goal[0] for goal in self._study.goals])),
            ("poses", ", ".join(f"{count} {kind}" for kind, count in zip(kinds, counts, strict=True)) or "none"),
            ("smallest margin", f"{np.nanmin(self.margin):.3g}" if np.isfinite(self.margin).any() else "not known"),
            ("joints", names(self.names.joints)),
            ("bodies", names(self.names.bodies)),
        ]
        return table(self.title, [*rows, *(("note", note) for note in self.notes)])


def _by_key(indices: Mapping[Any, list[int]], values: FloatArray) -> dict[Any, FloatArray]:
    return {key: values[:, which[0]] if len(which) == 1 else values[:, which] for key, which in indices.items()}


def _single(goals: Mapping[Any, FloatArray]) -> dict[Any, Any]:
    """The same for one pose."""
    return {key: float(value[0]) if value.ndim == 1 else value[0] for key, value in goals.items()}


def _values(goals: Mapping[Any, Any]) -> str:
    return ", ".join(f"{key} = {np.array2string(np.asarray(value), precision=6)}" for key, value in goals.items())
