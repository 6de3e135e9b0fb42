"""The four-bar that the pages on the criterion measure, by its closed formulas: matrices for any set of coordinates.

Chain of crank, coupler and rocker from the pin A = (0, 0) to the pin D = (ground, 0); phi are the angles of the links
against x. Uniform links of 1 kg/m under gravity.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LENGTHS = np.array([1.0, 2.5, 2.0])
GROUND, GRAVITY = 2.2, 9.81
MASSES = LENGTHS.copy()
CENTRES = LENGTHS / 2.0
INERTIAS = MASSES * LENGTHS**2 / 12.0
TO_JOINTS = np.tril(np.ones((3, 3)))
"""phi = TO_JOINTS q for joint angles q: each against the link before."""
ABSOLUTE = [f"{kind}{link}" for link in (1, 2, 3) for kind in ("x", "y", "θ")]
"""Names of absolute coordinates: centre of mass and angle of each link."""


def close(crank: float) -> Array:
    """Angles phi (3,) of the links for an angle of the crank, on the branch with the elbow up."""
    r = np.array([GROUND - LENGTHS[0] * np.cos(crank), -LENGTHS[0] * np.sin(crank)])
    diagonal = float(np.hypot(*r))
    cosine = (LENGTHS[1] ** 2 + diagonal**2 - LENGTHS[2] ** 2) / (2.0 * LENGTHS[1] * diagonal)
    coupler = np.arctan2(r[1], r[0]) + np.arccos(cosine)
    rest = r - LENGTHS[1] * np.array([np.cos(coupler), np.sin(coupler)])
    return np.array([crank, coupler, np.arctan2(rest[1], rest[0])])


def tangent(phi: Array) -> Array:
    """Rates (3,) of phi that the closed loop allows, up to a factor."""
    (a, b, c), (l1, l2, l3) = phi, LENGTHS
    return np.array([l2 * l3 * np.sin(c - b), l3 * l1 * np.sin(a - c), l1 * l2 * np.sin(b - a)])


BEYOND = np.array([MASSES[1:].sum(), MASSES[2], 0.0])  # what each link carries at its end
PULLS = MASSES * CENTRES + BEYOND * LENGTHS
COUPLING = np.diag(INERTIAS + MASSES * CENTRES**2 + BEYOND * LENGTHS**2)
for _i, _j in ((0, 1), (0, 2), (1, 2)):
    COUPLING[_i, _j] = COUPLING[_j, _i] = PULLS[_j] * LENGTHS[_i]


def mass(phi: Array) -> Array:
    """M (3, 3) for the angles phi."""
    return np.asarray(COUPLING * np.cos(phi[:, None] - phi[None, :]))


def forces(phi: Array, rate: Array) -> Array:
    """h (3,): gravity and what the rates bring."""
    turning = COUPLING * np.sin(phi[:, None] - phi[None, :])
    return np.asarray(-turning @ rate**2 - GRAVITY * PULLS * np.cos(phi))


def closing(phi: Array) -> Array:
    """Phi (2,): how far the end of the rocker is from the pin D."""
    return np.array([LENGTHS @ np.cos(phi) - GROUND, LENGTHS @ np.sin(phi)])


def jacobian(phi: Array) -> Array:
    """C (2, 3)."""
    return np.array([-LENGTHS * np.sin(phi), LENGTHS * np.cos(phi)])


def bias(phi: Array, rate: Array) -> Array:
    """b (2,) of C phi'' + b = 0."""
    return np.array([-LENGTHS @ (np.cos(phi) * rate**2), -LENGTHS @ (np.sin(phi) * rate**2)])


def joint_matrices(phi: Array) -> tuple[Array, Array]:
    """M (3, 3) and C (2, 3) for the joint angles."""
    return TO_JOINTS.T @ mass(phi) @ TO_JOINTS, jacobian(phi) @ TO_JOINTS


def absolute_matrices(phi: Array) -> tuple[Array, Array]:
    """M (9, 9) and C (8, 9) for the centres of mass and the angles of the links: two rows for each of the four pins."""
    m = np.diag(np.column_stack([MASSES, MASSES, INERTIAS]).ravel())
    c = np.zeros((8, 9))
    for pin in range(4):
        rows = slice(2 * pin, 2 * pin + 2)
        if pin > 0:  # the far end of the link before the pin
            c[rows, 3 * pin - 3 : 3 * pin] = _point(phi[pin - 1], LENGTHS[pin - 1] - CENTRES[pin - 1])
        if pin < 3:  # the near end of the link behind it
            c[rows, 3 * pin : 3 * pin + 3] -= _point(phi[pin], -CENTRES[pin])
    return m, c


def _point(angle: float, along: float) -> Array:
    """Rates (2, 3) of a point on a link by those of its centre of mass and its angle."""
    return np.array([[1.0, 0.0, -along * np.sin(angle)], [0.0, 1.0, along * np.cos(angle)]])
