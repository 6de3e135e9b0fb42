"""Arrays of a run, thinned and stored as text."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..tolerance import LONG_ROUNDING, SINGLE

FloatArray = NDArray[np.float64]

MOST_FRAMES = 1500
FEWEST_FRAMES = 60
SMOOTH = 600
"""Outputs that a page of single precision should hold at least, where a run has them; else numbers take two bytes."""
BYTES = 940_000
"""Target size of the data that a run adds to a page; for large mechanisms fewer outputs are kept, to stay below it."""

LEVELS = 65534
"""Steps of a number in two bytes over the range of its column; one more represents non-finite values."""


@dataclass(frozen=True)
class Packed:
    """Tables as text, the outputs kept, whether in two bytes, and the largest deviation of the omitted outputs.

    `strays`: the largest distance of what steers, where left out, from the straight way between the outputs kept.
    """

    tables: dict[str, Any]
    frames: NDArray[np.int_]
    coarse: bool
    strays: float


def pack_tables(tables: Mapping[str, FloatArray], others: int = 0, steering: FloatArray | None = None) -> Packed:
    """Store tables (nt, columns), of equal nt, in single precision or, where that leaves few outputs, in two bytes.

    Columns that stay constant are stored once: a planar mechanism then costs half of a spatial one. `others` is the
    size of all else in the page. First and last output are always kept; half of the others evenly by number, half where
    the columns of `steering` (nt, n) stray most from the straight way between those.
    """
    nt = len(next(iter(tables.values())))
    moving = {name: _moving(table) for name, table in tables.items()}
    still = sum(int((~own).sum()) * 14 + int(own.sum()) * 3 for own in moving.values())
    columns = max(1, sum(int(own.sum()) for own in moving.values()))
    room = max(0, BYTES - others - still) * 3 // 4  # base64 encodes three bytes as four characters
    fine = room // (4 * columns)
    coarse = fine < min(nt, SMOOTH)
    count = min(nt, MOST_FRAMES, max(FEWEST_FRAMES, room // (2 * columns) if coarse else fine))
    frames, strays = _chosen(np.empty((nt, 0)) if steering is None else steering, nt, count)
    packed = {name: _packed(table, moving[name], frames, coarse and name != "t") for name, table in tables.items()}
    return Packed(packed, frames, coarse, strays)


def _moving(table: FloatArray) -> NDArray[np.bool_]:
    """Which columns (columns,) change over time; a column with a value that is not finite counts as changing."""
    finite = np.isfinite(table)
    scale = float(np.max(np.abs(table), where=finite, initial=0.0))
    with np.errstate(invalid="ignore"):
        spread = np.ptp(table, axis=0)
    moving: NDArray[np.bool_] = ~(finite.all(axis=0) & (spread <= SINGLE * scale))
    return moving


def _chosen(table: FloatArray, nt: int, count: int) -> tuple[NDArray[np.int_], float]:
    """Outputs kept, and the largest distance of an omitted value from the line between the outputs kept around it."""
    if count >= nt:
        return np.arange(nt), 0.0
    even = np.unique(np.round(np.linspace(0, nt - 1, max(2, (count + 1) // 2))).astype(int))
    stray = _stray(table, even)
    stray[even] = -1.0
    # Ties are common (a constant table): they are spread evenly too.
    spread = np.unique(np.round(np.linspace(0, nt - 1, count)).astype(int))
    stray[spread] += LONG_ROUNDING * (float(stray.max(initial=0.0)) or 1.0)
    worst = np.argsort(-stray, kind="stable")[: count - len(even)]
    frames = np.union1d(even, worst)
    return frames, float(_stray(table, frames).max(initial=0.0))


def _stray(table: FloatArray, kept: NDArray[np.int_]) -> FloatArray:
    """For each output (nt,), the largest distance from the line between the outputs kept before and after it."""
    at = np.arange(len(table))
    after = np.clip(np.searchsorted(kept, at, side="right"), 1, len(kept) - 1)
    low, high = kept[after - 1], kept[after]
    found = np.zeros(len(table))
    part = (at - low) / (high - low)
    for column in table.T:  # one table at a time: all at once would need as much memory as the run
        between = column[low] + part * (column[high] - column[low])
        found = np.fmax(found, np.abs(column - between))
    return np.nan_to_num(found)


def _packed(table: FloatArray, moving: NDArray[np.bool_], frames: NDArray[np.int_], coarse: bool) -> dict[str, Any]:
    values = table[frames][:, moving]
    still = [float(f"{x:.9g}") for x in table[0, ~moving]]
    about = {
        "columns": int(table.shape[1]),
        # differences from one to the next, and nothing if all constants are 0: both lists are long for large mechanisms
        "moving": np.diff(np.flatnonzero(moving), prepend=0).tolist(),
        "still": still if any(still) else [],
    }
    if not coarse:
        with np.errstate(over="ignore"):
            data = values.astype("<f4").tobytes()
        return {**about, "data": base64.b64encode(data).decode("ascii")}
    finite = np.isfinite(values)
    low = np.min(values, axis=0, where=finite, initial=np.inf)
    high = np.max(values, axis=0, where=finite, initial=-np.inf)
    low, high = np.where(low <= high, low, 0.0), np.where(low <= high, high, 0.0)
    step = np.array([float(f"{x:.6g}") for x in (high - low) / LEVELS])
    low = np.array([float(f"{x:.10g}") for x in low])
    with np.errstate(invalid="ignore", divide="ignore"):
        whole = np.where(step > 0.0, np.rint((values - low) / step), 0.0)
    whole = np.where(finite, np.clip(whole, 0, LEVELS), LEVELS + 1)
    data = whole.astype("<u2").tobytes()
    return {**about, "low": low.tolist(), "step": step.tolist(), "data": base64.b64encode(data).decode("ascii")}
