"""The page "Tilt this hinge": an over-constrained linkage that locks, the reason in words, and the remedy."""

from __future__ import annotations

from typing import Any

from partita import catalogue
from partita.sketch.static import packed_core
from partita.viewer.page import DRAWS
from partita.webpage import whole_page

SCRIPTS = (("partita.sketch", "core.js"), "tilt.js")


LINKAGES = {"four-bar with parallel hinges": "four-bar", "Bennett's linkage": "bennett"}
"""Name on the page -> name in the catalogue, of four hinges in a ring from the ground to the ground."""


def tilt_page() -> str:
    """The page as text. Raises `MissingFileError` where the core was not built for pages."""
    data = {"linkages": {shown: ring(name) for shown, name in LINKAGES.items()}}
    return whole_page(__package__ or "", "Tilt this hinge", data, SCRIPTS, packed_core(), ("partita.viewer", DRAWS))


def ring(name: str) -> dict[str, Any]:
    """Points and axes of the hinges as drawn."""
    joints = {joint["name"]: joint for joint in catalogue.load(name).to_spec()["joints"]}
    return {key: [joints[hinge][of] for hinge in "ABCD"] for key, of in (("points", "point"), ("axes", "axis"))}
