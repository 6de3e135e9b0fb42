"""Rates of a stiff problem for solvers of other programs: Partita's equations in C, or van der Pol's in Python."""

from __future__ import annotations

import ctypes
import json
import math
from dataclasses import asdict, dataclass, field
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np


@dataclass
class Known:
    """A problem as plain data: its equations, start and end, and the sizes of which errors are parts."""

    title: str
    duration: float
    y0: list[float]
    end: list[float]
    sizes: list[float]
    positions: int
    library: str | None = None
    name: str = ""
    mu: float = 0.0
    planar: dict[str, Any] = field(default_factory=dict)

    def write(self, path: Path) -> None:
        path.write_text(json.dumps(asdict(self)), encoding="utf-8")

    @classmethod
    def read(cls, path: str) -> Known:
        return cls(**json.loads(Path(path).read_text(encoding="utf-8")))

    def error(self, y: Any) -> float:
        """Largest error of positions and rates at the end, as a part of how much they change at most."""
        found = float(np.max(np.abs(np.asarray(y) - self.end) / self.sizes))
        return found if math.isfinite(found) else math.inf


@dataclass(frozen=True)
class Tried:
    """A run of a solver at one setting; `least` are the seconds of its evaluations alone, by code in C."""

    kind: str
    setting: str
    seconds: float
    error: float
    evaluations: int
    jacobians: int
    cost: float
    least: float


MOST = 60_000
"""Calls after which a solver is stopped: near rounding some crawl."""


class TooManyCalls(Exception):
    """A solver makes more calls than a run is worth."""


class Rates:
    """y' = f(t, y), counted."""

    def __init__(self, known: Known) -> None:
        self.known, self.calls = known, 0
        if known.library is not None:
            library = ctypes.CDLL(known.library)
            self._rates, self._accelerations = (
                getattr(library, f"{known.name}_{x}") for x in ("rates", "accelerations")
            )
            self._rates.argtypes = [ctypes.c_void_p] * 3
            self._accelerations.argtypes = [ctypes.c_double, *[ctypes.c_void_p] * 3]
            self._repeat = getattr(library, f"{known.name}_repeat")
            self._repeat.argtypes = [ctypes.c_long, ctypes.c_double, *[ctypes.c_void_p] * 4]

    def into(self, t: float, y: np.ndarray, to: np.ndarray) -> None:
        """Write f(t, y); contiguous arrays."""
        self.calls += 1
        if self.calls > MOST:
            raise TooManyCalls
        if self.known.library is None:
            x, v = y
            to[0], to[1] = v, self.known.mu * (1.0 - x * x) * v - x
            return
        past = 8 * self.known.positions
        q, out = y.ctypes.data, to.ctypes.data
        failed = self._rates(q, q + past, out)
        if failed + self._accelerations(t, q, q + past, out + past):
            to[:] = math.nan

    def __call__(self, t: float, y: np.ndarray) -> np.ndarray:
        to = np.empty(len(y))
        self.into(t, np.ascontiguousarray(y), to)
        return to

    def each(self) -> float:
        """Seconds of one evaluation in C, without a call from Python; nan for equations in Python."""
        if self.known.library is None:
            return math.nan
        y, to, best, count = np.array(self.known.y0), np.empty(len(self.known.y0)), math.inf, 20000
        past = 8 * self.known.positions
        for _ in range(7):
            start = perf_counter()
            self._repeat(count, 0.0, y.ctypes.data, y.ctypes.data + past, to.ctypes.data, to.ctypes.data + past)
            best = min(best, perf_counter() - start)
        return best / count
