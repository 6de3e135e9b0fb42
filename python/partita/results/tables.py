"""Arrays over time: those a run stores, and those computed from them on first access."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from .verdict import Finding, findings_of

KEPT_1D, KEPT_2D = ("work",), ("q", "v")
DESCRIBED_1D, DESCRIBED_2D = ("closure", "velocity_closure"), ("vdot", "multipliers")
ASSESSED_1D, ASSESSED_2D = ("sigma", "sqrt_mu"), ("measure",)
ASSESSED = (*ASSESSED_1D, *ASSESSED_2D, "selector")
NAMES = ("t", *KEPT_2D, *KEPT_1D, *DESCRIBED_2D, *DESCRIBED_1D, *ASSESSED, "independent")


class SolutionLog(Protocol):
    """Data of the core from a run: the choices of coordinates and everything else that describes an instant."""

    def describe(self) -> dict[str, Any]:
        """Accelerations, multipliers, closures and the choice at every output, and notes."""

    def assess(self) -> dict[str, Any]:
        """Measures, qualities and frozen tangent velocities at every output."""

    def work(self) -> NDArray[np.float64]:
        """Work at every output."""

    def partitions(self) -> list[dict[str, Any]]:
        """Choices of coordinates, in order of time."""

    def counters(self) -> dict[str, int]:
        """Counts of work."""

    def state(self, t: float) -> tuple[float, NDArray[np.float64], NDArray[np.float64]] | None:
        """t, q and v at a time where a step is kept; elsewhere of the last earlier time at which one is."""

    def states(self, times: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
        """The same at these times, a row each; NaN where there is none."""

    def span(self) -> tuple[float, float] | None:
        """When the first step kept begins and the last one ends."""


class Tables(Mapping[str, NDArray[Any]]):
    """The arrays `NAMES` of a run. `t`, `q` and `v` exist from the start. Accelerations, multipliers and
    closures are computed together, for all outputs, when one of them is first accessed; so are measures, qualities and
    tangent velocities."""

    def __init__(self, arrays: Mapping[str, Any], log: SolutionLog | None = None) -> None:
        self._log = log
        t = np.atleast_1d(np.asarray(arrays.get("t", ()), dtype=float))
        self._arrays: dict[str, NDArray[Any]] = {"t": t}
        self._take(arrays, KEPT_1D, KEPT_2D)
        self._notes: list[str] = []
        self._findings: list[Finding] = []
        if log is None:
            self._describe(arrays)
            self._assess(arrays)

    @classmethod
    def of_run(cls, arrays: dict[str, NDArray[Any]], log: SolutionLog) -> Tables:
        """Those that the core returns, whose types and ranks are right; nothing else keeps the dictionary."""
        found = cls.__new__(cls)
        found._arrays, found._log, found._notes, found._findings = arrays, log, [], []
        return found

    @property
    def log(self) -> SolutionLog | None:
        """What the core keeps of the run, if it was computed here."""
        return self._log

    @property
    def notes(self) -> list[str]:
        """Notes about outputs with undetermined quantities."""
        try:
            self["closure"]
        except Exception as error:  # of a user's function, which may have ended the run as well
            why = f"{type(error).__name__}: {error}"
            return [f"what follows from the equations at the outputs cannot be computed: {why}"]
        return self._notes

    @property
    def findings(self) -> list[Finding]:
        """Findings of the description against the run, at its outputs."""
        self["closure"]
        return self._findings

    def __getitem__(self, name: str) -> NDArray[Any]:
        if name in self._arrays or self._log is None:
            return self._arrays[name]
        if name in KEPT_1D:
            self._arrays[name] = self._log.work()
        elif name in ASSESSED:
            self._assess(self._log.assess())
        elif name in NAMES:
            found = self._log.describe()
            self._describe(found)
            self._notes = [str(note) for note in found["notes"]]
            self._findings = findings_of(found["findings"])
        return self._arrays[name]

    def __iter__(self) -> Iterator[str]:
        return iter(NAMES)

    def __len__(self) -> int:
        return len(NAMES)

    def __deepcopy__(self, memo: dict[int, Any]) -> Tables:
        other = Tables({}, self._log)  # what the core keeps never changes
        other._arrays, other._notes = copy.deepcopy(self._arrays, memo), list(self._notes)
        other._findings = list(self._findings)
        return other

    def __reduce__(self) -> tuple[type[Tables], tuple[dict[str, NDArray[Any]]]]:
        return Tables, (dict(self),)

    def _describe(self, arrays: Mapping[str, Any]) -> None:
        self._take(arrays, DESCRIBED_1D, DESCRIBED_2D)
        # NaN: nothing was chosen in a singular position
        chosen = np.nan_to_num(np.asarray(arrays.get("independent", ()), dtype=float), nan=-1.0)
        self._arrays["independent"] = rows_of(chosen, len(self._arrays["t"]), np.int64)

    def _assess(self, arrays: Mapping[str, Any]) -> None:
        self._take(arrays, ASSESSED_1D, ASSESSED_2D)
        nothing = np.zeros((len(self._arrays["t"]), 0, self._arrays["v"].shape[1]))
        self._arrays["selector"] = np.asarray(arrays.get("selector", nothing), dtype=float)

    def _take(self, arrays: Mapping[str, Any], vectors: tuple[str, ...], wide: tuple[str, ...]) -> None:
        """Arrays with their types and ranks; those a file or a system left out are empty."""
        for key in vectors:
            self._arrays[key] = np.asarray(arrays.get(key, ()), dtype=float).reshape(-1)
        for key in wide:
            self._arrays[key] = rows_of(arrays.get(key, ()), len(self._arrays["t"]), float)


def rows_of(values: Any, nt: int, dtype: Any) -> NDArray[Any]:
    """`values` as (nt, width); width 0 for nothing at all."""
    array = np.asarray(values, dtype=dtype)
    return array if array.ndim == 2 else array.reshape(nt, -1 if nt and array.size else 0)
