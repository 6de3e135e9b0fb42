"""Data of a run for figures, pages and files: the form of a `Result`, without its methods that draw and write."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from .errors import ArgumentError, FileFormatError
from .files import malformed
from .naming import Names, coordinate_units, joint_units
from .numeric import shown
from .tolerance import NEGLIGIBLE

FloatArray = NDArray[np.float64]


def checked_run(result: Any) -> None:
    """Refuse anything but a run, before a figure or a page is begun."""
    if not all(hasattr(result, name) for name in ("t", "names", "summary")):
        raise ArgumentError(f"result must be what simulate() returns, not {shown(result)}", argument="result")


def given(result: MotionView) -> bool:
    """Whether the motion was given, as that of a mode is: no law holds it, so velocities, forces and energies mean
    nothing."""
    return result.v.size > 0 and len(result.v) > 1 and bool(np.isnan(np.asarray(result.vdot, dtype=float)).all())


AS_FAR = 0.8
"""Of rotations that are longer than this the first is named: a crank before its rods. Scale: fraction of the longest
step. Reason: rods that follow a crank turn as far."""
FEW = np.pi / 3.0
"""With longer steps the motion between outputs is unknown, and no line joins them. Scale: rad from output to output.
Reason: six outputs for a turn."""


def turn_between_outputs(result: ResultView) -> tuple[str, float]:
    """The coordinate that rotates farthest between outputs, and its usual step [rad]; ("", 0.0) if none rotates.

    The usual step is the median over the run. Beyond `FEW` a line from output to output would show a slower motion than
    there was, as a film shows the wheels of a coach.
    """
    if len(result.t) < 2:
        return "", 0.0
    units = coordinate_units(result.summary, result.names)[0]
    turning = [i for i, unit in enumerate(units) if unit == "rad"]
    names = [str(result.names.coordinates[i]) for i in turning]
    steps = np.median(np.abs(np.diff(np.asarray(result.q)[:, turning], axis=0)), axis=0)
    for name, rate in _spins(result):  # joints that turn any way: no coordinate says how far
        names.append(name)
        steps = np.append(steps, np.median(rate[:-1] * np.diff(result.t)))
    if not names:
        return "", 0.0
    steps = np.nan_to_num(steps)
    most = int(np.argmax(steps >= AS_FAR * steps.max()))  # of equal rotations the first: a crank before its rods
    return names[most], float(steps[most])


def _spins(result: ResultView) -> Iterator[tuple[str, FloatArray]]:
    """Joints with a quaternion, and how fast they turn (nt,) [rad/s]."""
    for joint in result.summary.get("joints", ()):
        if joint.get("state_q") and joint.get("state_v") and joint["state_q"][1] != joint["state_v"][1]:
            start = joint["state_v"][0]
            turning = [start + i for i, unit in enumerate(joint_units(joint)[1]) if unit == "rad"]
            yield str(joint["name"]), np.linalg.norm(np.asarray(result.v)[:, turning], axis=1)


def happened(result: Any) -> Sequence[Any]:
    """The events of a run, in the order of time; none of what has none, as a position."""
    events: Sequence[Any] = getattr(result, "events", ())
    return events


LOAD_UNITS = {"force": "N", "moment": "N m"}
"""Reactions of joints."""


def scales(result: MotionView) -> dict[str, float]:
    """By unit, the magnitude to which values of a run compare: the largest of that unit, or what others make of it.

    A planar mechanism carries moments of 1e-16 N m beside forces of 10 N: their scale is a force times the length of
    the mechanism. Lengths are compared with that length, angles with 1 rad, rates with these over the duration at
    least. Empty for a run without bodies, whose units are not known.
    """
    if not result.names.bodies:
        return {}
    spec, t = getattr(result, "spec", None) or {}, np.asarray(getattr(result, "t", ()), dtype=float)
    largest: dict[str, float] = {}

    def add(unit: str, values: Any) -> None:
        finite = np.abs(np.asarray(values, dtype=float))
        largest[unit] = max(largest.get(unit, 0.0), float(np.max(finite, initial=0.0, where=np.isfinite(finite))))

    q_units, v_units = coordinate_units(result.summary, result.names)
    for values, units in ((np.asarray(result.q), q_units), (np.asarray(result.v), v_units)):
        for i, unit in enumerate(units):
            add(unit, values[:, i])
    points = [body["position"] for body in spec.get("bodies", ()) if "position" in body]
    points += [joint["point"] for joint in spec.get("joints", ()) if joint.get("point") is not None]
    drawn = float(np.linalg.norm(np.ptp(np.array(points, dtype=float).reshape(-1, 3), axis=0))) if points else 0.0
    length = max(drawn, largest.get("m", 0.0)) or 1.0
    duration = float(t[-1] - t[0]) if len(t) > 1 else 0.0
    least = 1.0 / duration if duration > 0.0 else 0.0
    turning = max(largest.get("rad/s", 0.0), largest.get("m/s", 0.0) / length, least)
    if hasattr(result, "multipliers"):  # a position and kinematics have no loads
        for name, unit in LOAD_UNITS.items():
            add(unit, result.at_once.reactions[name])
    if getattr(result, "has_energy", False) and not given(result):
        energy: Any = getattr(result, "energy")  # noqa: B009
        add("J", energy.kinetic)
        add("J", np.asarray(energy.potential) - energy.potential[0])
    work = max(largest.get("N", 0.0) * length, largest.get("N m", 0.0), largest.get("J", 0.0))
    return {
        "rad": max(1.0, largest.get("rad", 0.0)), "m": length, "rad/s": turning, "m/s": turning * length,
        "rad/s^2": turning**2, "m/s^2": turning**2 * length,
        "N": work / length, "N m": work, "J": work, "W": work * turning,
    }  # fmt: skip


def least(result: MotionView, unit: str) -> float:
    """What is smaller than this is round-off in a run; 0 for a unit without a scale."""
    return NEGLIGIBLE * scales(result).get(unit, 0.0)


class MotionView(Protocol):
    """Motion of bodies and joints, with or without forces."""

    @property
    def title(self) -> str: ...
    @property
    def summary(self) -> Mapping[str, Any]: ...
    @property
    def names(self) -> Names: ...
    @property
    def q(self) -> FloatArray: ...
    @property
    def v(self) -> FloatArray: ...
    @property
    def vdot(self) -> FloatArray: ...
    @property
    def at_once(self) -> Any: ...

    def sensor(self, name: str) -> Any:
        """Readings of a sensor."""


@contextmanager
def understood(result: Any) -> Iterator[None]:
    """Where a description and numbers are used that may have been read from a file: others than a run's are refused."""

    def refusal(error: Exception) -> FileFormatError:
        why = f"{type(error).__name__}: {error!s:.100}"
        message = f"the stored result has a description or numbers that no run has ({why}); simulate again"
        return FileFormatError(message, path="", line=None)

    record = getattr(result, "record", None)
    with malformed(refusal) if getattr(record, "of_file", False) else nullcontext():
        yield


class ResultView(MotionView, Protocol):
    """A run as shown or stored; `partita.results.Result` documents each item."""

    @property
    def success(self) -> bool: ...
    @property
    def status(self) -> str: ...
    @property
    def message(self) -> str: ...
    @property
    def notes(self) -> tuple[str, ...]: ...
    @property
    def counters(self) -> Mapping[str, Any]: ...
    @property
    def spec(self) -> Mapping[str, Any] | None: ...
    @property
    def record(self) -> Any: ...
    @property
    def certificate(self) -> Any: ...
    @property
    def is_mechanism(self) -> bool: ...
    @property
    def has_energy(self) -> bool: ...

    @property
    def t(self) -> FloatArray: ...
    @property
    def arrays(self) -> Mapping[str, NDArray[Any]]: ...
    @property
    def multipliers(self) -> FloatArray: ...
    @property
    def closure(self) -> FloatArray: ...
    @property
    def velocity_closure(self) -> FloatArray: ...
    @property
    def measure(self) -> FloatArray: ...
    @property
    def sigma(self) -> FloatArray: ...
    @property
    def sqrt_mu(self) -> FloatArray: ...
    @property
    def independent(self) -> NDArray[np.int64]: ...
    @property
    def energy(self) -> Any: ...
    @property
    def partitions(self) -> Sequence[Any]: ...

    def joint(self, name: str) -> Any:
        """Motion and reaction of a joint."""

    def body(self, name: str) -> Any:
        """Motion of a body."""

    def applied_forces(self) -> Mapping[str, tuple[FloatArray, FloatArray]]:
        """For loads that act at a point: the point and the force, in the world."""
