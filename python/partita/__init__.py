"""Partita: motion and forces of mechanisms with closed loops.

>>> import partita as pt
>>> m = pt.Mechanism("pendulum")
>>> rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
>>> hinge = m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
>>> run = m.simulate(1.0)
>>> run.success
True
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from . import errors, limits, partition, shapes, units
from ._core import version as _version
from .builder import Along, Coordinate, Cosine, Distance, table
from .comparison import compare
from .derivatives import at_end, end_time, integral, peak, start, start_rate
from .events import Event, Lock, Release, SetInput, SetRates, Stop
from .mechanism import Mechanism, load
from .solver import Solver
from .state import State
from .sweep import load_sweep, samples, sweep
from .system import System, simulate
from .tangent import TangentVelocities

if TYPE_CHECKING:
    from . import catalogue
    from .results import Result, load_result
    from .results.sensitivities import lengths
    from .sketch import draw

__version__ = _version()

__all__ = [
    "Along",
    "Coordinate",
    "Cosine",
    "Distance",
    "Event",
    "Lock",
    "Mechanism",
    "Release",
    "Result",
    "SetInput",
    "SetRates",
    "Solver",
    "State",
    "Stop",
    "System",
    "TangentVelocities",
    "__version__",
    "at_end",
    "catalogue",
    "compare",
    "draw",
    "end_time",
    "errors",
    "integral",
    "lengths",
    "limits",
    "load",
    "load_result",
    "load_sweep",
    "partition",
    "peak",
    "samples",
    "shapes",
    "simulate",
    "start",
    "start_rate",
    "sweep",
    "table",
    "units",
]

# Imported on first use: they bring plotting and data libraries along.
_LATER = ("catalogue", "plots", "results", "viewer")
_NAMED_LATER = {"Result": "results", "lengths": "results.sensitivities", "draw": "sketch", "load_result": "results"}


def __getattr__(name: str) -> Any:
    if name in _LATER:
        return importlib.import_module(f"{__name__}.{name}")
    if name in _NAMED_LATER:
        return getattr(importlib.import_module(f"{__name__}.{_NAMED_LATER[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*__all__, *(name for name in globals() if name.startswith("__"))})
