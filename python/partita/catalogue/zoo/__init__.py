"""The zoo: mechanisms of many kinds, each with the results of the theory of mechanisms.

A theme is a file, a mechanism in it a function that draws it and the `Truth` above that function.
"""

from __future__ import annotations

from . import (
    couplings,
    engines,
    linkages,
    machines,
    platforms,
    rolling,
    shafts_and_gyros,
    six_bars_and_legs,
    spherical_and_overconstrained,
    suspensions,
)
from .checks import checks, closure, size
from .member import Theme

__all__ = ["ENTRIES", "THEMES", "checks", "closure", "size"]

THEMES: dict[str, Theme] = {
    "Four-bars, slider-cranks, five-bar": linkages.MEMBERS,
    "Six-bars and walking legs": six_bars_and_legs.MEMBERS,
    "Machines of many links": machines.MEMBERS,
    "Engines": engines.MEMBERS,
    "Suspensions": suspensions.MEMBERS,
    "Platforms on several legs": platforms.MEMBERS,
    "Spherical and overconstrained loops": spherical_and_overconstrained.MEMBERS,
    "Shafts, spatial loops, gyros": shafts_and_gyros.MEMBERS,
    "Gears, screws, belts, cams, rods": couplings.MEMBERS,
    "Wheels and balls that roll": rolling.MEMBERS,
}
"""Members by theme, in the order in which a theme draws them."""

ENTRIES: Theme = {name: entry for theme in THEMES.values() for name, entry in theme.items()}
