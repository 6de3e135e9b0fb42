"""The builder: what a user says about a mechanism becomes a checked description."""

from .builder import Builder
from .records import Body, Drive, Force, Joint

__all__ = ["Body", "Builder", "Drive", "Force", "Joint"]
