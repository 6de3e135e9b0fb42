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

FloatArray = NDArray[np.float64]


def checked_run(result: Any) -> None:
    """Refuse anything but a run, before a figure or a page is begun."""
    if not all(hasattr(result, name) for name in ("t", "names", "summary")):
        raise ArgumentError(f"result must be what simulate() returns, not {shown(result)}", argument="result")


def given(result: ResultView) -> bool:
    """Whether the motion was given, as that of a mode is: no law holds it, so velocities, forces and energies mean
    nothing."""
    return len(result.t) > 1 and result.v.size > 0 and bool(np.isnan(np.asarray(result.vdot, dtype=float)).all())


FEW = np.pi / 3.0
"""With six or fewer outputs per turn the motion between them is unknown: no line joins them."""


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
    most = int(np.argmax(steps >= 0.8 * steps.max()))  # of equal rotations the first: a crank before its rods
    return names[most], float(steps[most])


def _spins(result: ResultView) -> Iterator[tuple[str, FloatArray]]:
    """Joints with a quaternion, and how fast they turn (nt,) [rad/s]."""
    for joint in result.summary.get("joints", ()):
        if joint.get("state_q") and joint.get("state_v") and joint["state_q"][1] != joint["state_v"][1]:
            start = joint["state_v"][0]
            turning = [start + i for i, unit in enumerate(joint_units(joint)[1]) if unit == "rad"]
            yield str(joint["name"]), np.linalg.norm(np.asarray(result.v)[:, turning], axis=1)


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
    def observed(self) -> Mapping[str, NDArray[Any]]: ...
    @property
    def joint_accelerations(self) -> FloatArray: ...

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
    def reactions(self) -> Mapping[str, NDArray[Any]]: ...
    @property
    def checks(self) -> Mapping[str, NDArray[Any]]: ...
    @property
    def determined_efforts(self) -> NDArray[np.bool_]: ...
    @property
    def determined_drive(self) -> NDArray[np.bool_]: ...
    @property
    def determined(self) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]: ...
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
