"""What every test shares: one thread of linear algebra, no window, and no figures left by another test."""

import os
from collections import Counter
from collections.abc import Iterator

# Before NumPy is loaded: on matrices of a hundred rows more threads than one only wait for each other, at full load.
for library in ("OPENBLAS", "MKL", "OMP"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

import matplotlib  # noqa: E402
import moved_drawings  # noqa: E402
import pytest  # noqa: E402

matplotlib.use("Agg")
moved_drawings.install(pytest.MonkeyPatch())


@pytest.fixture(autouse=True)
def no_figures_left() -> Iterator[None]:
    """Close the figures that a test drew, so that none leaks into the next."""
    yield
    from matplotlib import pyplot

    pyplot.close("all")


def pytest_unconfigure(config: pytest.Config) -> None:
    """End with a line that counts what was skipped and why: a suite that is green has not tested that."""
    reporter = config.pluginmanager.get_plugin("terminalreporter")
    skipped = reporter.stats.get("skipped", []) if reporter is not None else []
    reasons = Counter(str(report.longrepr[2]).removeprefix("Skipped: ") for report in skipped)
    listed = "; ".join(f"{count} as {reason}" for reason, count in reasons.most_common())
    if reporter is not None and not hasattr(config, "workerinput"):
        print(f"skipped: {listed}" if listed else "skipped: none")
