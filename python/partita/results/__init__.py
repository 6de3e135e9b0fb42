"""Results of a run, and files of them: access by name, saving, loading."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from .body import BodyResult
from .certificate import Certificate
from .coupling import CouplingResult, DriveResult
from .energy import EnergyResult
from .joint import JointResult
from .names import Names
from .partition_log import PartitionChange
from .result import Result
from .self_stress import SelfStresses
from .verdict import Finding

if TYPE_CHECKING:
    from .load import load_result

__all__ = [
    "BodyResult",
    "Certificate",
    "CouplingResult",
    "DriveResult",
    "EnergyResult",
    "Finding",
    "JointResult",
    "Names",
    "PartitionChange",
    "Result",
    "SelfStresses",
    "load_result",
]


def __getattr__(name: str) -> Any:
    if name == "load_result":  # with all the formats, which a run does not need
        from .load import load_result

        return load_result
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
