"""Thresholds that several modules share: what each separates, what it is a fraction or a multiple of, and why it has
its size. Those of one algorithm stand in its module. A name that the core has too has the core's value."""

import numpy as np

ROUNDING = 4.0 * float(np.finfo(float).eps)
"""Numbers that differ by less are equal to rounding. Scale: fraction of the size of the numbers. Reason: some units in
the last place."""
SUM_ROUNDING = 1e-14
"""Sums, products of matrices and sines that come out smaller are rounding. Scale: fraction of their terms. Reason: some
tens of terms, each rounded."""
LONG_ROUNDING = 1e-12
"""Results of thousands of operations, and moments of inertia, that come out smaller are rounding. Scale: fraction of
their terms. Reason: ten thousand roundings; moments are differences of products."""
EQUAL = 1e-9
"""Given numbers that differ by less are intended to be equal. Scale: fraction of their size; radians for axes. Reason:
ten printed digits have this error, far above rounding."""
EQUAL_IN_SIX_DIGITS = 1e-6
"""Directions, places and values that differ by less are equal to six digits. Scale: fraction of their size, lengths of
that of the mechanism; radians for directions. Reason: the sixth digit, of drawings and of single precision."""
NEGLIGIBLE = 1e-9
"""Computed values below this are zero. Scale: fraction of the scale of their unit in a run (`result_view.scales`), or
of the largest of their kind. Reason: far above rounding, far below what anybody sees."""
RTOL = 1e-8
"""Default relative tolerance of a run. Scale: fraction of what is integrated. Reason: eight digits of a motion."""
ATOL = 1e-10
"""Default absolute tolerance of a run. Scale: radians; characteristic length. Reason: a hundredth of `RTOL`, so that it
matters next to zero only."""
VISIBLE = 1e-3
"""What is smaller is not seen in a picture. Scale: fraction of what is shown beside it; sine of an angle. Reason: less
than a pixel of a thousand."""
SINGLE = 1e-7
"""Numbers of a page, and corners of meshes, that differ by less are equal. Scale: fraction of the largest beside them.
Reason: single precision."""
NEARLY_ALONG = 0.9
"""A direction this near to an axis does not define the direction across it. Scale: cosine of the angle. Reason: 26
degrees, beyond which digits are lost."""
HALFWAY_ALONG = 0.7
"""A direction less near to an axis is crossed with it, another one with the next axis. Scale: cosine of the angle.
Reason: about half a right angle, so that either product is long."""
LEAST_DIVISOR = 1e-300
"""Divisors and arguments of logarithms below this are replaced by it. Scale: their unit. Reason: above the smallest
number, below all that are given; only zero is changed."""
