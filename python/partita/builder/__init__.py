"""The builder: what a user says about a mechanism becomes a checked description."""

from .mechanism import Mechanism
from .records import Body, Drive, Force, Joint

__all__ = ["Body", "Drive", "Force", "Joint", "Mechanism"]
