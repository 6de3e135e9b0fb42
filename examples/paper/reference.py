"""The four-bar used by the pages on the criterion: that of the catalogue, at any angle of its crank."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

import partita as pt
from partita.catalogue import reference_four_bar
from partita.instant import Instant
from partita.state import State

Array = NDArray[np.float64]

NAME = "reference-four-bar"
START = reference_four_bar.CRANK_ANGLE
"""Angle of the crank against x in the drawing, where joint angles are zero [rad]."""
FOUR_BAR = pt.catalogue.load(NAME)
MODELS = {coordinates: FOUR_BAR.compile(coordinates) for coordinates in ("relative", "absolute")}
JOINT, ABSOLUTE = (MODELS[coordinates].velocity_names for coordinates in ("relative", "absolute"))
"""Names of the velocities: joints A, B, C, and x, y, turn of crank, coupler and rocker."""


def state(crank: float, rate: float = 0.0, coordinates: str = "relative") -> State:
    """The closed four-bar with its crank at an angle against x [rad], turning with `rate` [rad/s].

    The elbow is on the side where it is drawn: the other one is far from the drawing.
    """
    closed = FOUR_BAR.assemble(targets={"A": crank - START}, rates={"A": rate})
    return FOUR_BAR.convert(closed, coordinates)


@lru_cache(maxsize=1024)
def instant(crank: float, rate: float = 0.0, coordinates: str = "relative") -> Instant:
    """Everything that the equations hold there; the same instant is looked at more than once."""
    at = state(crank, rate, coordinates)
    return MODELS[coordinates].at(at.q, at.v)


@lru_cache(maxsize=1024)
def geometry(crank: float, coordinates: str = "relative") -> pt.partition.Geometry:
    """Lengths, metrics and projectors there."""
    at = instant(crank, coordinates=coordinates)
    return pt.partition.geometry(at.M, at.C)


def measures(crank: Array, coordinates: str) -> Array:
    """rho (nt, n) for angles of the crank (nt,)."""
    closed = FOUR_BAR.assemble_many({"A": crank - START})
    return np.array([MODELS[coordinates].measure(FOUR_BAR.convert(at, coordinates).q) for at in closed])
