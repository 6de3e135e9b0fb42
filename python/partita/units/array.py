"""Numbers over time that know their unit."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import ArgumentError
from .conversion import convert


class UnitArray(np.ndarray[Any, np.dtype[np.float64]]):
    """An array of numbers with one unit, `unit`, in SI; `to` gives them in another one.

    Parts of it keep the unit; what is computed from it is a plain array, since its unit may be another one.

    >>> import partita as pt
    >>> angle = pt.catalogue.load("four-bar").simulate(0.1).joint("A").angle
    >>> angle.unit, angle.to("deg").shape == angle.shape
    ('rad', True)
    """

    unit: str

    def __new__(cls, values: ArrayLike, unit: str) -> UnitArray:
        made = np.asarray(values, dtype=np.float64).view(cls)
        made.unit = unit
        return made

    def __array_finalize__(self, other: Any) -> None:
        self.unit = getattr(other, "unit", "")

    def __array_wrap__(self, array: Any, context: Any = None, return_scalar: bool = False) -> Any:
        plain = np.asarray(array)
        return plain[()] if return_scalar or plain.ndim == 0 else plain

    def __reduce__(self) -> tuple[Any, tuple[NDArray[np.float64], str]]:
        return UnitArray, (np.asarray(self), self.unit)

    def to(self, unit: str) -> NDArray[np.float64]:
        """The numbers in another unit, such as "deg", "mm" or "rpm"; a plain array.

        Raises `ArgumentError` for an unknown unit and for one of another kind.

        >>> from partita.units.array import UnitArray
        >>> UnitArray([0.0, 0.25], "m").to("mm").tolist()
        [0.0, 250.0]
        """
        if not self.unit:
            raise ArgumentError(
                "these numbers were computed and have no unit; use partita.units.convert", argument="to"
            )
        return convert(np.asarray(self), self.unit, unit)
