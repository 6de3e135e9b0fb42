"""Source of bodies, joints, reactions and energies of a result: the compiled model, or a file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError

Arrays = Mapping[str, NDArray[Any]]
T = TypeVar("T")
Span = tuple[int, int]

BODIES = ("body_position", "body_rotation", "body_velocity", "body_angular_velocity")
JOINTS = ("joint_position", "joint_velocity", "joint_point")
OBSERVED = (*BODIES, *JOINTS)
REACTIONS = ("force", "moment", "drive", "joint_rotation", "residual", "residuals", "effort")
ENERGIES = ("kinetic", "potential")
CHECKS = ("acceleration_closure", "acceleration_row", "closure_row", "rank", "margin")


class Source(Protocol):
    """Data of a result beyond the arrays of the run itself."""

    def body(self, i: int) -> Arrays:
        """The `BODIES` arrays of one body, without the axis of the bodies."""

    @property
    def has_model(self) -> bool:
        """Whether it computes what is asked; otherwise it has what was stored."""

    def body_acceleration(self, i: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Accelerations of the origin of one body, and angular ones, (nt, 3) each; with a model only."""

    def joint(self, j: int, q: Span, v: Span) -> Arrays:
        """The `JOINTS` arrays of one joint, whose coordinates are at `q` (first, count) among those of all joints."""

    def joint_acceleration(self, j: int, v: Span) -> NDArray[np.float64]:
        """(nt, dof): accelerations along the degrees of freedom of one joint."""

    @property
    def joint_accelerations(self) -> NDArray[np.float64]:
        """(nt, degrees of freedom of all joints)."""

    @property
    def efforts(self) -> NDArray[np.float64]:
        """(nt, conditions): multipliers of couplings, drives and joints' own conditions that belong to the
        reactions."""

    @property
    def determined_efforts(self) -> NDArray[np.bool_]:
        """(nt, conditions): which of them are unique."""

    def reaction(self, j: int, v: Span) -> Arrays:
        """`force`, `moment`, `drive` and `joint_rotation` of one joint."""

    @property
    def observed(self) -> Arrays:
        """Positions and velocities of all bodies and joints at every output (the `OBSERVED` arrays)."""

    @property
    def reactions(self) -> Arrays:
        """Wrench of every joint at every output (the `REACTIONS` arrays)."""

    def residual_at(self, outputs: list[int]) -> NDArray[np.float64]:
        """`residual` of a few outputs."""

    @property
    def augmented(self) -> Arrays | None:
        """`force` and `moment` of every joint by augmented joint coordinates; None without a model."""

    @property
    def determined(self) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Which reaction components are unique: (nt, nj, 6) in world axes, (nt, nj, 6) in joint axes."""

    @property
    def checks(self) -> Arrays:
        """Checks of the outputs for a certificate (the `CHECKS` arrays, (nt,) each; NaN where there is none)."""

    @property
    def determined_drive(self) -> NDArray[np.bool_]:
        """Which efforts of drives are unique: (nt, degrees of freedom of all joints)."""

    def self_stress_basis(self, i: int) -> tuple[NDArray[np.float64], NDArray[np.float64], float] | None:
        """Orthonormal self-stresses at output i: wrenches (s, nj, 6) in world axes, efforts of the drives, and the
        length by which moments are divided; None without a model."""

    def self_stresses(self, j: int) -> NDArray[np.float64] | None:
        """(nt, 2, 3, 3): directions, as rows, in which self-stresses load joint j by forces and by moments, in units of
        the level that counts as zero; None without a model."""

    @property
    def energies(self) -> Arrays:
        """`kinetic` and `potential` energy at every output."""


class ModelSource:
    """Has the core compute one body, joint or reaction of the `motion` that it keeps, on first use and at all outputs,
    and stores the result. The cost is that of the part on which it depends: the links down to the ground, the connected
    bodies."""

    has_model = True

    def __init__(self, model: Any, motion: Any, summary: Mapping[str, Any]) -> None:
        self.model, self.motion, self.summary = model, motion, summary
        self._found: dict[tuple[str, int], Any] = {}  # what was computed, of which number

    def _once(self, what: str, i: int, compute: Callable[[], T]) -> T:
        """What `compute` returns for number i, computed at its first use."""
        if (what, i) not in self._found:
            self._found[what, i] = compute()
        found: T = self._found[what, i]
        return found

    def body(self, i: int) -> Arrays:
        return self._once("body", i, lambda: alone(self.motion.bodies([i]), BODIES))

    def body_acceleration(self, i: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        def computed() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
            found = self.motion.body_accelerations([i])
            return found["body_acceleration"][:, 0], found["body_angular_acceleration"][:, 0]

        return self._once("body acceleration", i, computed)

    def joint(self, j: int, q: Span, v: Span) -> Arrays:
        return self._once("joint", j, lambda: alone(self.motion.joints([j]), ("joint_point",)))

    def joint_acceleration(self, j: int, v: Span) -> NDArray[np.float64]:
        return self._once("joint acceleration", j, lambda: np.asarray(self.motion.joint_accelerations([j])))

    @cached_property
    def joint_accelerations(self) -> NDArray[np.float64]:
        return np.asarray(self.motion.joint_accelerations())

    @property
    def efforts(self) -> NDArray[np.float64]:
        if self._shares_loads:
            return np.asarray(self.reactions["effort"])
        return np.asarray(self.motion.multipliers[:, int(self.summary.get("closing_rows", 0)) :])

    @property
    def determined_efforts(self) -> NDArray[np.bool_]:
        return self._flags[3]

    def reaction(self, j: int, v: Span) -> Arrays:
        def computed() -> Arrays:
            if self._shares_loads:  # one costs as much as all
                return one_of(self.reactions, j, v)
            found: Arrays = self.motion.reaction(j)
            return found

        return self._once("reaction", j, computed)

    @cached_property
    def _shares_loads(self) -> bool:
        """Whether redundant joints share loads, so that the reaction of each depends on all."""
        return bool(self.motion.shares_loads())

    @cached_property
    def observed(self) -> Arrays:
        return {**self.motion.bodies(), **self.motion.joints()}

    @cached_property
    def reactions(self) -> Arrays:
        found: Arrays = self.motion.reactions()
        return found

    def residual_at(self, outputs: list[int]) -> NDArray[np.float64]:
        if "reactions" in self.__dict__:
            return np.asarray(self.reactions["residual"])[outputs]
        return np.asarray(self.motion.reactions(outputs)["residual"])

    @cached_property
    def augmented(self) -> Arrays | None:
        found: Arrays = self.motion.augmented_reactions()
        return found

    @cached_property
    def checks(self) -> Arrays:
        found: Arrays = self.motion.checks()
        return found

    @cached_property
    def _flags(self) -> tuple[NDArray[np.bool_], ...]:
        return tuple(self.motion.determined())

    @property
    def determined(self) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        return self._flags[0], self._flags[1]

    @property
    def determined_drive(self) -> NDArray[np.bool_]:
        return self._flags[2]

    def self_stress_basis(self, i: int) -> tuple[NDArray[np.float64], NDArray[np.float64], float] | None:
        found: tuple[NDArray[np.float64], NDArray[np.float64], float] = self.motion.self_stress_basis(i)
        return found

    def self_stresses(self, j: int) -> NDArray[np.float64] | None:
        return self._once("self-stresses", j, lambda: self.motion.self_stresses(j))

    @cached_property
    def energies(self) -> Arrays:
        found: Arrays = self.motion.energies()
        return found

    def __deepcopy__(self, memo: dict[int, Any]) -> ModelSource:
        return ModelSource(self.model, self.motion, self.summary)  # these never change

    def __reduce__(self) -> tuple[type[StoredSource], tuple[Arrays]]:
        return StoredSource, (complete(self),)  # all its data, so that it can be read without the model


class StoredSource:
    """Reads the same from the arrays of a file."""

    has_model = False

    def __init__(self, arrays: Arrays) -> None:
        self._arrays = arrays

    def body(self, i: int) -> Arrays:
        return {key: self._arrays[key][:, i] for key in BODIES}

    def body_acceleration(self, i: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        message = "a stored result has no accelerations of bodies; ask the run itself, or store them as sensors"
        raise ArgumentError(message, argument="name")

    def joint(self, j: int, q: Span, v: Span) -> Arrays:
        return {
            "joint_position": columns(self._arrays["joint_position"], q),
            "joint_velocity": columns(self._arrays["joint_velocity"], v),
            "joint_point": self._arrays["joint_point"][:, j],
        }

    def joint_acceleration(self, j: int, v: Span) -> NDArray[np.float64]:
        return columns(self._arrays["joint_acceleration"], v)

    @property
    def joint_accelerations(self) -> NDArray[np.float64]:
        return self._arrays["joint_acceleration"]

    @property
    def efforts(self) -> NDArray[np.float64]:
        return self._arrays["effort"]

    @property
    def determined_efforts(self) -> NDArray[np.bool_]:
        return np.asarray(self._arrays["determined_effort"].astype(bool))

    def reaction(self, j: int, v: Span) -> Arrays:
        return one_of(self._arrays, j, v)

    @property
    def observed(self) -> Arrays:
        return {key: self._arrays[key] for key in OBSERVED}

    @property
    def reactions(self) -> Arrays:
        return {key: self._arrays[key] for key in REACTIONS}

    def residual_at(self, outputs: list[int]) -> NDArray[np.float64]:
        return self._arrays["residual"][outputs]

    @property
    def augmented(self) -> Arrays | None:
        return None

    @property
    def determined(self) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        return (
            self._arrays["determined_world"].astype(bool),
            self._arrays["determined_joint"].astype(bool),
        )

    @property
    def checks(self) -> Arrays:
        return {key: self._arrays[key] for key in CHECKS}

    @property
    def determined_drive(self) -> NDArray[np.bool_]:
        return np.asarray(self._arrays["determined_drive"].astype(bool))

    def self_stress_basis(self, i: int) -> tuple[NDArray[np.float64], NDArray[np.float64], float] | None:
        return None

    def self_stresses(self, j: int) -> NDArray[np.float64] | None:
        return None

    @property
    def energies(self) -> Arrays:
        return {key: self._arrays[key] for key in ENERGIES}


def complete(source: Source) -> dict[str, NDArray[Any]]:
    """All data of a source, in the form of a stored result."""
    world, joint = source.determined
    reported = {**source.energies, **source.observed, **source.reactions, **source.checks}
    flags = {"determined_world": world, "determined_joint": joint, "determined_drive": source.determined_drive}
    more = {"joint_acceleration": source.joint_accelerations, "determined_effort": source.determined_efforts}
    return {**reported, **flags, **more}


def alone(arrays: Arrays, keys: tuple[str, ...]) -> Arrays:
    """Arrays of a single body or joint, without that axis."""
    return {key: a[:, 0] if key in keys else a for key, a in arrays.items()}


def one_of(reactions: Arrays, j: int, v: Span) -> Arrays:
    """The reaction of joint j, whose degrees of freedom are at `v`, out of those of all joints."""
    found = {key: reactions[key][:, j] for key in ("force", "moment", "joint_rotation")}
    return {**found, "drive": columns(reactions["drive"], v)}


def columns(array: NDArray[Any], span: Span) -> NDArray[Any]:
    """The columns first, count."""
    first, count = span
    return array[:, first : first + count]
