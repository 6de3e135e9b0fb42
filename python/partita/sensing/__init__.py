"""Readings of sensors, as plain data, and their computation from motions and forces: for all outputs of a run at once,
or for one state read by a force law.

A sensor is a dict: `of` names its object ("point", "body", "joint", "measure", "force", "drive", "coupling",
"expression" or "function"), `reads` which of its quantities. All arrays may have axes in front, such as that of time.
"""

from __future__ import annotations

from .instant import StateSignals
from .labels import text_of, unit_of
from .laws import Senses, at_once
from .quantities import Moving, Signals, measured
from .reader import Reader, plain
from .records import OF_MOUNTED, OPERATIONS, READS, SensorRecord, known, uses

__all__ = [
    "OPERATIONS",
    "OF_MOUNTED",
    "READS",
    "Moving",
    "Reader",
    "SensorRecord",
    "Senses",
    "Signals",
    "StateSignals",
    "at_once",
    "known",
    "measured",
    "plain",
    "text_of",
    "unit_of",
    "uses",
]
