"""Mechanisms with elements that hold a joint at times: latches, freewheels, friction that sticks, rigid contacts."""

from __future__ import annotations

from collections.abc import Callable

from ..entry import Entry
from . import bicycle_hub, door_latch, downlock, ratchet_wrench, stick_slip, valve_float

__all__ = ["ENTRIES"]

ENTRIES: dict[str, Callable[[], Entry]] = {
    "bicycle-hub": bicycle_hub.entry,
    "door-latch": door_latch.entry,
    "landing-gear-downlock": downlock.entry,
    "ratchet-wrench": ratchet_wrench.entry,
    "stick-slip": stick_slip.entry,
    "valve-float": valve_float.entry,
}
