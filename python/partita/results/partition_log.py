"""The log of choices of independent coordinates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ..result_view import ResultView

WORDS = {
    "initial": "first choice by the projective measure",
    "start": "first choice by the projective measure",
    "fixed": "fixed by the user",
    "user": "fixed by the user",
    "switch": "a switch enlarges the choice beyond the threshold",
    "volume": "a switch enlarges the choice beyond the threshold",
    "pivot": "a pivot of the dependent block became too small",
    "rank": "the number of independent constraints changed",
    "singular": "crossing of a singular position",
}


@dataclass(frozen=True)
class PartitionChange:
    """One choice of independent coordinates during a run, made between two steps without loss.

    `sigma` and `sqrt_mu` measure the quality of the choice when it was made: the smaller, the nearer
    the mechanism is to a position where these coordinates fail. The first entry of a log has nothing
    entering or leaving: it is the choice the run began with.
    """

    t: float
    independent: tuple[str, ...]
    dependent: tuple[str, ...]
    entering: tuple[str, ...]
    leaving: tuple[str, ...]
    reason: str
    sigma: float
    sqrt_mu: float

    @property
    def is_switch(self) -> bool:
        """Whether coordinates were switched (not the first choice)."""
        return bool(self.entering or self.leaving)

    def __str__(self) -> str:
        if self.is_switch:
            what = f"{', '.join(self.entering)} for {', '.join(self.leaving)}"
        else:
            what = f"independent: {', '.join(self.independent) or 'none'}"
        return f"t = {self.t:.6g} s: {what} ({self.reason}; sigma {self.sigma:.2e})"


def partition_changes(raw: Sequence[Mapping[str, Any]], velocities: Sequence[str]) -> list[PartitionChange]:
    """The log of the core, whose entries are indices of velocities, put in names."""
    return [
        PartitionChange(
            t=float(entry["t"]),
            independent=_named(entry.get("independent"), velocities),
            dependent=_named(entry.get("dependent"), velocities),
            entering=_named(entry.get("entering"), velocities),
            leaving=_named(entry.get("leaving"), velocities),
            reason=WORDS.get(str(entry.get("reason", "")), str(entry.get("reason", ""))),
            sigma=_number(entry.get("sigma")),
            sqrt_mu=_number(entry.get("sqrt_mu")),
        )
        for entry in raw
    ]


def switches_of(result: ResultView) -> int:
    """Switches of independent coordinates, of which a long run lists only some."""
    listed = sum(change.is_switch for change in result.partitions)
    return listed + int(result.counters.get("unlisted_switches", 0))


def _named(indices: Any, velocities: Sequence[str]) -> tuple[str, ...]:
    """Names of an index, of several, or of none (None or negative)."""
    if indices is None:
        return ()
    many = indices if hasattr(indices, "__len__") else (indices,)
    return tuple(velocities[int(i)] for i in many if i is not None and int(i) >= 0)


def _number(value: Any) -> float:
    return float("nan") if value is None else float(value)
