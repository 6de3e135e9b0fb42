"""Names along the arrays of a result."""

from __future__ import annotations

from ..naming import Names, coordinate_units, index_of, joint_units, listed, missing_attribute, name_of

__all__ = [
    "Names",
    "coordinate_units",
    "index_of",
    "joint_units",
    "listed",
    "missing_attribute",
    "name_of",
]
