"""What a run returns, and files of it: reading by names, saving, loading."""

from .body import BodyResult
from .certificate import Certificate
from .energy import EnergyResult
from .joint import JointResult
from .load import load_result
from .names import Names
from .partition_log import PartitionChange
from .result import Result

__all__ = [
    "BodyResult",
    "Certificate",
    "EnergyResult",
    "JointResult",
    "Names",
    "PartitionChange",
    "Result",
    "load_result",
]
