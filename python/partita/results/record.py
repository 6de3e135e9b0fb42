"""What a run left behind, as plain data: arrays over time and the account of how they came about."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

FLOATS_1D = ("t", "closure", "velocity_closure", "sigma", "sqrt_mu", "work")
FLOATS_2D = ("q", "v", "vdot", "multipliers", "measure")
ACCOUNT = ("summary", "partitions", "notes", "counters", "status", "success", "message", "options", "spec")


@dataclass(frozen=True)
class Record:
    """Arrays of a run and its account; what every writer stores and every reader restores."""

    arrays: dict[str, NDArray[Any]]
    """The `FLOATS_1D`, the `FLOATS_2D` and `independent` (nt, k) of integers."""
    summary: dict[str, Any] = field(default_factory=dict)
    partitions: list[dict[str, Any]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    counters: dict[str, int] = field(default_factory=dict)
    status: str = "finished"
    success: bool = True
    message: str = ""
    options: dict[str, Any] = field(default_factory=dict)
    description: str | None = None
    """The mechanism as built, as JSON; None for a `System`."""

    @cached_property
    def spec(self) -> dict[str, Any] | None:
        """The description as plain data, kept so that a stored result can still be drawn."""
        return None if self.description is None else json.loads(self.description)

    @classmethod
    def from_raw(
        cls,
        raw: Mapping[str, Any],
        summary: Mapping[str, Any],
        options: Mapping[str, Any],
        description: str | None,
    ) -> Record:
        """From the dictionary that the core returns."""
        return cls(
            arrays=checked(raw),
            summary=dict(summary),
            partitions=[{key: plain(value) for key, value in entry.items()} for entry in raw.get("partitions", ())],
            notes=[str(note) for note in raw.get("notes", ())],
            counters={str(key): int(value) for key, value in raw.get("counters", {}).items()},
            status=str(raw.get("status", "finished")),
            success=bool(raw.get("success", True)),
            message=str(raw.get("message", "")),
            options=dict(options),
            description=description,
        )

    def account(self) -> dict[str, Any]:
        """Everything but the arrays, ready for JSON."""
        return {key: plain(getattr(self, key)) for key in ACCOUNT}

    @classmethod
    def from_account(cls, account: Mapping[str, Any], arrays: Mapping[str, Any]) -> Record:
        """The inverse of `account`, with the arrays put back."""
        spec = account["spec"]
        told = {key: account[key] for key in ACCOUNT if key != "spec"}
        return cls(arrays=checked(arrays), **told, description=None if spec is None else json.dumps(spec))


def checked(raw: Mapping[str, Any]) -> dict[str, NDArray[Any]]:
    """Arrays of a run with their types and ranks; those a file or a system left out are empty."""
    arrays: dict[str, NDArray[Any]] = {"t": np.atleast_1d(np.asarray(raw.get("t", ()), dtype=float))}
    nt = len(arrays["t"])
    for key in FLOATS_1D[1:]:
        arrays[key] = np.asarray(raw.get(key, ()), dtype=float).reshape(-1)
    for key in FLOATS_2D:
        arrays[key] = rows_of(raw.get(key, ()), nt, float)
    arrays["independent"] = rows_of(raw.get("independent", ()), nt, np.int64)
    return arrays


def rows_of(values: Any, nt: int, dtype: Any) -> NDArray[Any]:
    """`values` as (nt, width); width 0 for nothing at all."""
    array = np.asarray(values, dtype=dtype)
    return array if array.ndim == 2 else array.reshape(nt, -1 if nt and array.size else 0)


def plain(value: Any) -> Any:
    """`value` out of what JSON knows: arrays become lists, NumPy numbers numbers, other objects words."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        complete = value.dtype.kind in "biu" or (value.dtype.kind == "f" and bool(np.isfinite(value).all()))
        return value.tolist() if complete else plain(value.tolist())
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float):
        return value if np.isfinite(value) else None
    if value is None or isinstance(value, (bool, int, str)):
        return value
    if isinstance(value, Sequence):
        return [plain(item) for item in value]
    return str(value)
