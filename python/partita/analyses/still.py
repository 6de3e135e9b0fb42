"""States without a run in the form of a run: bodies, joints, reactions and sensors of them by name."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError
from ..numeric import shown
from ..results.record import Record
from ..results.run import Run
from ..results.sensor import LiveSensors, account_of
from ..results.source import ModelSource
from ..results.tables import Tables

R = TypeVar("R", bound=Run)


def run_of(
    cls: type[R],
    model: Any,
    t: NDArray[np.float64],
    q: NDArray[np.float64],
    v: NDArray[np.float64],
    vdot: NDArray[np.float64],
    multipliers: NDArray[np.float64],
    *,
    core: Any = None,
    changes: Mapping[str, Any] | None = None,
) -> R:
    """A run of the compiled model with these outputs, one row each; `core`: another model of the core that has the
    multipliers, `changes`: where its summary differs."""
    arrays = Tables({"t": t, "q": q, "v": v, "vdot": vdot, "multipliers": multipliers, "work": np.zeros(len(t))})
    summary = {**model.summary, **(changes or {})}
    account = account_of(model.sensors, summary)
    if account:
        summary["sensors"] = account
    core = model.core if core is None else core
    source = ModelSource(core, core.motion(t, q, v, vdot, multipliers), summary)
    record = Record(arrays=arrays, summary=summary, description=model.description)
    return cls(record, source, LiveSensors(model.sensors, source, account))


def place(index: Any, count: int, what: str) -> int:
    """Index of one of `count` things, from the end if it is negative; `IndexError` beyond them."""
    try:
        return range(count)[index]
    except TypeError:
        raise ArgumentError(f"the number of {what} must be an integer, not {shown(index)}", argument="index") from None
