"""What every test shares: no window is opened, and a test starts without figures left by another."""

from collections.abc import Iterator

import matplotlib
import pytest

matplotlib.use("Agg")


@pytest.fixture(autouse=True)
def no_figures_left() -> Iterator[None]:
    """Close the figures that a test drew, so that none leaks into the next."""
    yield
    from matplotlib import pyplot

    pyplot.close("all")
