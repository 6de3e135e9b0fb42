"""Samples of parameters: low-discrepancy sequences of SciPy, or any sampler of the unit cube."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import options as run_options
from ..errors import ArgumentError
from ..numeric import real, shown

_ENGINES = {"sobol": "Sobol", "halton": "Halton", "latin hypercube": "LatinHypercube"}


def samples(
    ranges: Mapping[str, Any], count: int, *, sampler: Any = "sobol", seed: int | None = 0
) -> list[dict[str, float]]:
    """Draw samples of parameters for `partita.sweep`, spread evenly over their ranges.

    Args:
        ranges: name -> (low, high), between which the parameter is uniform; or a distribution with the method `ppf`,
            such as `scipy.stats.norm(0.5, 0.001)`.
        count: number of samples; for "sobol" preferably a power of two.
        sampler: "sobol", "halton" or "latin hypercube", of `scipy.stats.qmc`; or an object whose `random(count)`
            returns an array of shape (count, number of parameters) with numbers between 0 and 1, such as
            `qmc.PoissonDisk(2)`.
        seed: of a sampler given by its name; None: other samples in each call.

    Returns:
        One dict of parameters for each sample.

    Raises:
        ArgumentError: a range, the count or the sampler is invalid.

    >>> import partita as pt
    >>> drawn = pt.samples({"length": (0.5, 1.0), "mass": (1.0, 3.0)}, 8)
    >>> len(drawn), all(0.5 <= one["length"] <= 1.0 for one in drawn)
    (8, True)
    """
    if not isinstance(ranges, Mapping) or not ranges:
        raise ArgumentError(
            f"ranges must be a dict such as {{'length': (0.5, 1.0)}}, not {shown(ranges)}", argument="ranges"
        )
    if isinstance(count, bool) or not isinstance(count, (int, np.integer)) or count < 1:
        raise ArgumentError(f"count must be a positive integer, not {shown(count)}", argument="count")
    cube = _cube(sampler, seed, int(count), len(ranges))
    columns = {name: _column(name, given, cube[:, i]) for i, (name, given) in enumerate(ranges.items())}
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def _cube(sampler: Any, seed: Any, count: int, size: int) -> NDArray[np.float64]:
    if isinstance(sampler, str):
        if sampler not in _ENGINES:
            raise ArgumentError(
                f'sampler is "{sampler}"; known: {", ".join(_ENGINES)}, or an object with the method random',
                argument="sampler",
            )
        generator = run_options.generator(seed)
        from scipy.stats import qmc  # slow to import

        engine = getattr(qmc, _ENGINES[sampler])
        try:
            sampler = engine(size, rng=generator)
        except TypeError:  # the name of this argument before SciPy 1.15
            sampler = engine(size, seed=generator)
    elif not callable(getattr(sampler, "random", None)):
        raise ArgumentError(
            f"sampler must be a name or an object with the method random, not {shown(sampler)}", argument="sampler"
        )
    try:
        cube = np.asarray(sampler.random(count), dtype=np.float64)
    except (TypeError, ValueError, OverflowError, MemoryError) as error:
        raise ArgumentError(f"the sampler failed: {error}", argument="sampler") from error
    if cube.shape != (count, size):
        raise ArgumentError(
            f"the sampler returned an array of shape {cube.shape}; {count} samples of {size} parameters need "
            f"{(count, size)}",
            argument="sampler",
        )
    if not (cube >= 0.0).all() or not (cube <= 1.0).all():
        raise ArgumentError("the sampler returned numbers outside of 0 to 1", argument="sampler")
    return cube


def _column(name: Any, given: Any, unit: NDArray[np.float64]) -> list[float]:
    """The values of one parameter."""
    quantile = getattr(given, "ppf", None)
    if callable(quantile):
        return [float(value) for value in quantile(unit)]
    try:
        low, high = (real(bound) for bound in given)
    except (TypeError, ValueError) as error:
        raise ArgumentError(
            f"ranges[{name!r}] must be (low, high) or a distribution with the method ppf, not {shown(given)}",
            argument="ranges",
        ) from error
    if not (np.isfinite(low) and np.isfinite(high) and low < high):
        raise ArgumentError(
            f"ranges[{name!r}] must be two finite numbers, the lower first, not {shown(given)}", argument="ranges"
        )
    return [float(value) for value in low + (high - low) * unit]
