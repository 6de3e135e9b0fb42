"""The builder: user input becomes a checked description."""

from .builder import Builder
from .measures import Along, Coordinate, Cosine, Distance
from .records import Body, Coupling, Drive, Force, Joint
from .sampled import SampledTable, table
from .sensors import Expression, Sensor

__all__ = [
    "Along",
    "Body",
    "Builder",
    "Coordinate",
    "Cosine",
    "Coupling",
    "Distance",
    "Drive",
    "Expression",
    "Force",
    "Joint",
    "SampledTable",
    "Sensor",
    "table",
]
