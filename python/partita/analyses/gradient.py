"""The gradient of an objective of a run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..notebook import table

if TYPE_CHECKING:
    from ..results import Result

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class Gradient:
    """The value of an objective of a run, and its derivatives, by `Mechanism.gradient`.

    Attributes:
        value: of the objective.
        by: number -> derivative, with the shape of the number; keys as they were given.
        method: "forward" or "adjoint".
        agrees: on `check=True` the largest difference to central differences of runs, over the largest derivative of the
            number; else None.
        hessian: on `second=True` second derivatives, numbers side by side in the order of `by`; else None.
        hessian_error: how exact these are, about: the change by the last extrapolation.
        run: the run.
        notes: remarks, in sentences.
    """

    value: float
    by: Mapping[Any, Any]
    method: str
    run: Result
    agrees: float | None = None
    hessian: Array | None = None
    hessian_error: float | None = None
    notes: tuple[str, ...] = field(default_factory=tuple)

    @property
    def flat(self) -> Array:
        """All derivatives side by side, in the order of `by`."""
        return np.concatenate([np.ravel(x) for x in self.by.values()]) if self.by else np.zeros(0)

    def __repr__(self) -> str:
        checked = "" if self.agrees is None else f"; agrees with differences to {self.agrees:.1e}"
        return f"Gradient({self.value:.9g} by {', '.join(str(key) for key in self.by)}; {self.method}{checked})"

    def _repr_html_(self) -> str:
        rows = [(str(key), np.array2string(np.asarray(x), precision=6)) for key, x in self.by.items()]
        return table(["number", "derivative"], rows)
