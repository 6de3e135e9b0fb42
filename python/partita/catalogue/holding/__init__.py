"""Mechanisms that hold a joint at times: by latches, freewheels, friction that sticks, rigid contacts, and by events
that lock, release and part, or set an effort."""

from __future__ import annotations

from collections.abc import Callable

from ..entry import Entry
from . import (
    bicycle_hub,
    door_latch,
    downlock,
    geneva_wheel,
    punch_press,
    ratchet_wrench,
    stick_slip,
    trebuchet,
    valve_float,
)

__all__ = ["ENTRIES"]

ENTRIES: dict[str, Callable[[], Entry]] = {
    "bicycle-hub": bicycle_hub.entry,
    "door-latch": door_latch.entry,
    "geneva-wheel": geneva_wheel.entry,
    "landing-gear-downlock": downlock.entry,
    "punch-press": punch_press.entry,
    "ratchet-wrench": ratchet_wrench.entry,
    "stick-slip": stick_slip.entry,
    "trebuchet": trebuchet.entry,
    "valve-float": valve_float.entry,
}
