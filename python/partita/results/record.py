"""Data of a run, as plain data: arrays over time and the description of how they were computed."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from .._core import version as core_version
from .tables import Tables
from .verdict import INVALID, Finding, findings_of

ACCOUNT = (
    "summary", "partitions", "notes", "counters", "status", "success", "message", "steps_open", "gaps",
    "exchanged", "geometric_error", "findings", "options", "spec", "version", "events",
)  # fmt: skip


@dataclass(frozen=True)
class Record:
    """Arrays of a run and its description; written by every writer and restored by every reader."""

    arrays: Tables
    summary: dict[str, Any] = field(default_factory=dict)
    partitions: list[dict[str, Any]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    counters: dict[str, int] = field(default_factory=dict)
    status: str = "finished"
    success: bool = True
    message: str = ""
    steps_open: tuple[float, float] = field(default_factory=lambda: (0.0, 0.0))
    """Largest |Phi| and |C v + a| at the ends of accepted steps."""
    gaps: tuple[float, float] = field(default_factory=lambda: (0.0, 0.0))
    """The same relative to the effect of a large displacement on each constraint, and to the fastest rate."""
    exchanged: float = field(default_factory=float)
    """Lower bound of the energy exchanged [J], from the speeds at the ends of accepted steps."""
    geometric_error: float = 0.0
    """Largest change of a joint frame by which the drawing was repaired (rad, fractions of lengths); 0 where none
    was."""
    findings: list[Finding] = field(default_factory=list)
    """Findings against the run at the ends of its steps."""
    options: dict[str, Any] = field(default_factory=dict)
    events: dict[str, Any] = field(default_factory=dict)
    """Names of the events that were looked for, and those that happened, as plain data."""
    error: Exception | None = None
    """What ended the run early, from its cause; only in memory."""
    description: str | None = None
    """The mechanism as built, as JSON; None for a `System`."""
    version: str = ""
    """The version of Partita that computed it."""
    of_file: bool = False
    """Whether it was read from a file, whose description nobody has compiled."""

    @cached_property
    def spec(self) -> dict[str, Any] | None:
        """The description as plain data, kept so that a stored result can still be drawn."""
        return None if self.description is None else json.loads(self.description)

    @classmethod
    def from_raw(
        cls,
        raw: dict[str, Any],
        summary: Mapping[str, Any],
        options: Mapping[str, Any],
        description: str | None,
    ) -> Record:
        """From the dictionary that the core returns, which it takes over, and options as plain data, which nothing
        changes afterwards."""
        found = cls.__new__(cls)
        found.__dict__.update(
            raw,
            arrays=Tables.of_run(raw["arrays"], raw.pop("log")),
            summary=summary,
            geometric_error=float(summary.get("repaired") or 0.0),
            findings=findings_of(raw["findings"]),
            options=options,
            description=description,
            version=_VERSION,
        )
        return found

    def __getattr__(self, name: str) -> Any:
        """Fields of a run that the core computes when they are first read."""
        log = self.__dict__["arrays"].log if name in _FROM_THE_LOG and "arrays" in self.__dict__ else None
        if log is None:
            raise AttributeError(name)
        value = self.__dict__[name] = getattr(log, name)()
        return value

    def __getstate__(self) -> dict[str, Any]:
        """With all fields, since a copy has no log."""
        return {**self.__dict__, **{name: getattr(self, name) for name in _FROM_THE_LOG}}

    def account(self) -> dict[str, Any]:
        """Everything but the arrays, ready for JSON; the inverse is `from_account` of what `read_exact` finds."""
        reported = {"notes": self.all_notes, "findings": exact([*self.findings, *self.arrays.findings])}
        return {key: exact(getattr(self, key)) for key in ACCOUNT} | reported

    @property
    def all_notes(self) -> list[str]:
        """Notes of the run and of its outputs."""
        return list(dict.fromkeys([*self.notes, *self.arrays.notes]))

    def judged(self, findings: Iterable[Finding]) -> Record:
        """The record after these findings of a certificate: one that makes a result invalid ends its success."""
        worst = next((finding for finding in findings if finding.invalid), None)
        if worst is None or not self.success:
            return self
        message = f"{self.message}, but the result is invalid: {worst.sentence}"
        return replace(self, status=INVALID, success=False, message=message)

    @classmethod
    def from_account(cls, account: Mapping[str, Any], arrays: Mapping[str, Any]) -> Record:
        """The inverse of `account`, with the arrays restored."""
        spec = account["spec"]
        own = ("spec", "steps_open", "gaps", "exchanged", "geometric_error", "findings", "version", "events")
        reported = {key: account[key] for key in ACCOUNT if key not in own}
        reported["steps_open"], reported["gaps"] = _pair(account.get("steps_open")), _pair(account.get("gaps"))
        reported["exchanged"] = _pair((account.get("exchanged", 0.0), 0.0))[0]
        reported["geometric_error"] = _pair((account.get("geometric_error", 0.0), 0.0))[0]
        reported["findings"] = findings_of(account.get("findings", ()))
        reported["events"] = dict(account.get("events") or {})
        reported["version"] = str(account.get("version", ""))
        return cls(
            arrays=Tables(arrays), **reported, description=None if spec is None else json.dumps(spec), of_file=True
        )


_FROM_THE_LOG = ("partitions", "counters", "steps_open", "gaps", "exchanged")
_VERSION = core_version()


def _pair(values: Sequence[float | None] | None) -> tuple[float, float]:
    """Two numbers; empty where a file does not contain them, infinite where a file cannot represent them."""
    one, other = (0.0, 0.0) if values is None else values
    return (float("inf") if one is None else float(one), float("inf") if other is None else float(other))


def plain(value: Any, unfit: Callable[[float], Any] = lambda number: None) -> Any:
    """`value` in terms of JSON: arrays become lists, NumPy numbers numbers, other objects words; non-finite numbers
    become null, or the result of `unfit`."""
    kind = type(value)
    if value is None or kind in _AS_IT_IS:
        return value
    if kind is float:
        return value if math.isfinite(value) else unfit(value)
    if kind is list:
        return [plain(item, unfit) for item in value]
    if isinstance(value, Mapping):
        return {str(key): plain(item, unfit) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        complete = value.dtype.kind in "biu" or (value.dtype.kind == "f" and bool(np.isfinite(value).all()))
        return value.tolist() if complete else plain(value.tolist(), unfit)
    if isinstance(value, np.generic):
        return plain(value.item(), unfit)
    if isinstance(value, float):
        return value if np.isfinite(value) else unfit(value)
    if isinstance(value, (bool, int, str)):
        return value
    if isinstance(value, Sequence):
        return [plain(item, unfit) for item in value]
    return str(value)


_AS_IT_IS = frozenset({bool, int, str})
NOT_FINITE = "not finite"


def exact(value: Any) -> Any:
    """The same without loss: non-finite numbers become `{"not finite": "nan"}`, which `read_exact` reads back."""
    return plain(value, lambda number: {NOT_FINITE: repr(number)})


def read_exact(reported: Any) -> Any:
    """The inverse of `exact`, for a JSON text or the data read from one."""
    return json.loads(reported if isinstance(reported, str) else json.dumps(reported), object_hook=_number)


def _number(item: dict[str, Any]) -> Any:
    return float(item[NOT_FINITE]) if list(item) == [NOT_FINITE] and isinstance(item[NOT_FINITE], str) else item
