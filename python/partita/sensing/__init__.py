"""What sensors read, as plain data, and how it is found from motions and forces: of all outputs of a run at once, or of
one state as a force law sees it.

A sensor is a dict: `of` says what it looks at ("point", "body", "joint", "measure", "force", "drive", "coupling",
"expression" or "function"), `reads` which of its quantities. All arrays may have axes in front, such as that of time.
"""

from __future__ import annotations

from .laws import Senses
from .quantities import Moving
from .reader import Reader
from .records import OPERATIONS, READS, SensorRecord, known, uses
from .words import text_of, unit_of

__all__ = ["OPERATIONS", "READS", "Moving", "Reader", "SensorRecord", "Senses", "known", "text_of", "unit_of", "uses"]
