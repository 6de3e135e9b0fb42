"""Rotations and inertias as given by the user, checked and converted to one form."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np

from ..products import det, matmul, nearest_rotation, norm
from ..tolerance import EQUAL, EQUAL_IN_SIX_DIGITS, NEARLY_ALONG, SUM_ROUNDING
from .checks import Array, Element, matrix, shape_of, vector


def transform() -> Any:
    """SciPy's rotations, imported when first needed: that takes longer than importing all of Partita."""
    from scipy.spatial import transform

    return transform


def is_rotation(value: Any) -> bool:
    """Whether it is a SciPy `Rotation`. SciPy is not imported for this test: a caller that has one has imported it."""
    module = sys.modules.get("scipy.spatial.transform")
    return module is not None and isinstance(value, module.Rotation)


def as_pair(value: Any) -> Any:
    """(position, orientation) of a SciPy `RigidTransform`, which newer SciPy has; anything else as it is."""
    kind = getattr(sys.modules.get("scipy.spatial.transform"), "RigidTransform", None)
    return (value.translation, value.rotation) if kind is not None and isinstance(value, kind) else value


def rotation(element: Element, what: str, value: Any) -> Array:
    """The 3x3 rotation (body axes to world axes) given by None, a matrix, a quaternion or a SciPy `Rotation`."""
    if value is None:
        return np.eye(3)
    if is_rotation(value):
        if not value.single:
            element.fail(f"{what} contains {len(value)} rotations; give one, for instance {what}[0]")
        return _orthonormal(element, what, np.asarray(value.as_matrix(), dtype=float))
    if shape_of(value) == (4,):
        return _from_quaternion(element, what, vector(element, what, value, size=4))
    if shape_of(value) != (3, 3):
        element.fail(
            f"{what} must be a 3x3 rotation matrix, a quaternion (w, x, y, z) or a SciPy Rotation, "
            f"not {type(value).__name__} with shape {shape_of(value)}"
        )
    return _orthonormal(element, what, matrix(element, what, value))


def _from_quaternion(element: Element, what: str, quaternion: Array) -> Array:
    """Scalar first; any length but zero, since only the direction of a quaternion matters."""
    if not np.any(quaternion):
        element.fail(f"{what} is the zero quaternion, which is not a rotation; the identity is (1, 0, 0, 0)")
    return np.asarray(transform().Rotation.from_quat(quaternion[[1, 2, 3, 0]]).as_matrix(), dtype=float)


def _orthonormal(element: Element, what: str, rows: Array) -> Array:
    """Refuse a matrix that is not a rotation; remove round-off by the polar decomposition."""
    error = float(np.max(np.abs(matmul(rows.T, rows) - np.eye(3))))
    if error > EQUAL:
        element.fail(
            f"{what} is not a rotation: its columns are not orthonormal, by {error:.1e} (allowed "
            f"{EQUAL:.0e}); "
            "give more digits, or a quaternion"
        )
    if det(rows) < 0.0:
        element.fail(f"{what} is a reflection (determinant -1), not a rotation; change the sign of one column")
    if error <= SUM_ROUNDING:
        return rows
    return nearest_rotation(rows)


def along(element: Element, start: Array, end: Array) -> tuple[float, Array]:
    """Length of a rod and its 3x3 rotation: x towards `end`.

    z stays as near to the world's z as possible, so that rods drawn in the x-y plane keep it. For a rod within 26
    degrees of the world's z that would be ill-conditioned: then y stays near the world's y instead.
    """
    span = end - start
    length = float(norm(span))
    if not length > 0.0:
        element.fail(f"start and end are the same point {start.tolist()}; a rod needs a length")
    x = span / length
    if abs(x[2]) < NEARLY_ALONG:
        z = _across(np.array([0.0, 0.0, 1.0]), x)
        y = _cross(z, x)
    else:
        y = _across(np.array([0.0, 1.0, 0.0]), x)
        z = _cross(x, y)
    return length, np.column_stack([x, y, z])


def _cross(a: Array, b: Array) -> Array:
    """a x b of two vectors; NumPy's own serves stacks of them, at twenty times the cost."""
    (a0, a1, a2), (b0, b1, b2) = a.tolist(), b.tolist()
    return np.array([a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0])


def _across(wanted: Array, x: Array) -> Array:
    """Unit vector perpendicular to `x`, nearest to `wanted`."""
    rest = wanted - (matmul(wanted, x)) * x
    return np.asarray(rest / norm(rest), dtype=float)


def inertia(element: Element, value: Any) -> Array:
    """Inertia about the centre of mass as 3x3 from three principal values or a matrix; physically possible,
    or an error."""
    if shape_of(value) == (3,):
        tensor = np.diag(vector(element, "inertia", value, "kg m^2"))
    elif shape_of(value) == (3, 3):
        tensor = matrix(element, "inertia", value, "kg m^2")
    else:
        element.fail(f"inertia must be (Ixx, Iyy, Izz) or a 3x3 matrix, not shape {shape_of(value)}")
    size = float(np.max(np.abs(tensor)))
    skew = float(np.max(np.abs(tensor - tensor.T)))
    if skew > EQUAL_IN_SIX_DIGITS * size:
        element.fail(
            f"inertia is not symmetric: entries across the diagonal differ by {skew:.3g}; each product of inertia "
            f"must appear with the same sign on both sides"
        )
    tensor = 0.5 * tensor + 0.5 * tensor.T
    unit = size if size > 0.0 else 1.0  # numbers near the ends of their range have squares beyond it
    small, middle, large = (unit * float(value) for value in np.linalg.eigvalsh(tensor / unit))
    if small < -EQUAL_IN_SIX_DIGITS * size:
        element.fail(f"inertia has the principal value {small:.6g}; moments of inertia are not negative")
    if small + middle < large - EQUAL_IN_SIX_DIGITS * size:
        element.fail(
            f"inertia has the principal values {small:.6g}, {middle:.6g}, {large:.6g}: no body has one "
            "that exceeds the sum of "
            f"the two others; if only Izz = {large:.6g} matters because the motion is planar, give "
            f"({large / 2:.6g}, "
            f"{large / 2:.6g}, {large:.6g})"
        )
    return tensor
