"""What every test shares: one thread of linear algebra, no window, and no figures left by another test."""

import os
from collections.abc import Iterator

# Before NumPy is loaded: on matrices of a hundred rows more threads than one only wait for each other, at full load.
for library in ("OPENBLAS", "MKL", "OMP"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

import matplotlib  # noqa: E402
import pytest  # noqa: E402

matplotlib.use("Agg")


@pytest.fixture(autouse=True)
def no_figures_left() -> Iterator[None]:
    """Close the figures that a test drew, so that none leaks into the next."""
    yield
    from matplotlib import pyplot

    pyplot.close("all")
