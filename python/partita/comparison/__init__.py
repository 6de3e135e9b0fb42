"""Formulations and rules of choice side by side, on one mechanism from one start.

>>> import partita as pt
>>> m = pt.catalogue.load("four-bar")
>>> start = pt.catalogue.entry("four-bar").initial(m)
>>> found = m.compare(0.5, initial=start, formulations=["projective", "multipliers"], selections=["collective"])
>>> [row.name for row in found.rows]
['projective', 'multipliers']
>>> max(row.error for row in found.rows) < 1e-7
True
"""

from __future__ import annotations

from .comparison import Comparison
from .doors import compare, compare_mechanism
from .row import Row
from .work_precision import Point, WorkPrecision

__all__ = ["Comparison", "Point", "Row", "WorkPrecision", "compare", "compare_mechanism"]
