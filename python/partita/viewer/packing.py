"""Arrays of a run, thinned and stored as text."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

MOST_FRAMES = 1500
FEWEST_FRAMES = 120
BYTES = 700_000
"""Wanted size of all arrays before base64; large mechanisms get fewer frames to stay near it."""

NEGLIGIBLE = 1e-7
"""A column that moves less than this fraction of its table is constant: single precision ends there too."""


def pack_tables(tables: Mapping[str, FloatArray]) -> tuple[dict[str, Any], NDArray[np.int_]]:
    """Store tables (nt, columns), of equal nt, in single precision; returns them and the frames kept.

    Columns that stay constant are stored once: a planar mechanism then costs half of a spatial one.
    First and last output are always kept, the others evenly by their number.
    """
    nt = len(next(iter(tables.values())))
    moving = {name: _moving(table) for name, table in tables.items()}
    frame_bytes = 4 * max(1, sum(int(columns.sum()) for columns in moving.values()))
    count = min(nt, MOST_FRAMES, max(FEWEST_FRAMES, BYTES // frame_bytes))
    frames = np.unique(np.round(np.linspace(0, nt - 1, count)).astype(int))
    return {name: _packed(table, moving[name], frames) for name, table in tables.items()}, frames


def _moving(table: FloatArray) -> NDArray[np.bool_]:
    """Which columns (columns,) change over time; one with anything not finite counts as changing."""
    finite = np.isfinite(table)
    scale = float(np.max(np.abs(table), where=finite, initial=0.0))
    with np.errstate(invalid="ignore"):
        spread = np.ptp(table, axis=0)
    moving: NDArray[np.bool_] = ~(finite.all(axis=0) & (spread <= NEGLIGIBLE * scale))
    return moving


def _packed(table: FloatArray, moving: NDArray[np.bool_], frames: NDArray[np.int_]) -> dict[str, Any]:
    with np.errstate(over="ignore"):
        data = table[frames][:, moving].astype("<f4")
    return {
        "columns": int(table.shape[1]),
        "moving": np.flatnonzero(moving).tolist(),
        "still": [None if m else float(x) for x, m in zip(table[0], moving, strict=True)],
        "data": base64.b64encode(data.tobytes()).decode("ascii"),
    }
