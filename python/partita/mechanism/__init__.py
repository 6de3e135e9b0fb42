"""The facade: a `Mechanism` on top of the modules that describe, compile, simulate, store and compare it; and
`load`."""

from __future__ import annotations

from .facade import Mechanism
from .files import load

__all__ = ["Mechanism", "load"]
