"""Error against work, over a range of tolerances."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import ArgumentError, Interrupted, PartitaError
from ..options import positive
from .bench import Bench
from .cases import Case
from .progress import Progress
from .row import FAILED, FINISHED
from .table import grid, write_lines

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PathLike = str | os.PathLike[str]


@dataclass(frozen=True)
class Point:
    """One run: its cost and its error at the end. Numbers are None where it did not finish."""

    name: str
    """Of the formulation, as in `Comparison.row`."""
    rtol: float
    """Relative tolerance of the run."""
    status: str
    """How it ended, as in `Row.status`."""
    error: float | None
    """Largest difference from the reference; see `Comparison.caption`."""
    evaluations: int | None
    """Of accelerations, for the steps."""
    time: float | None
    """Of the whole run [s]; the shortest of several where it is short."""
    message: str = ""
    """Why it did not reach the end; else empty."""


class WorkPrecision:
    """Runs of several formulations over several tolerances: `points`. `print` shows them, `plot` draws them.

    `unit` is that of the errors: "m" for mechanisms, empty for a `System`, whose coordinates have units of their own.
    """

    def __init__(self, title: str, reference: str, points: Sequence[Point], interrupted: bool, unit: str = "") -> None:
        self.title, self.reference, self.unit = title, reference, unit
        self.points: tuple[Point, ...] = tuple(points)
        self.interrupted = interrupted

    @property
    def names(self) -> list[str]:
        """Names of the runs, each once, in order."""
        return list(dict.fromkeys(point.name for point in self.points))

    def of(self, name: str) -> list[Point]:
        """The finished runs of one name, from the coarsest to the finest."""
        return [point for point in self.points if point.name == name and point.status == FINISHED]

    def to_text(self) -> str:
        """An aligned table."""
        cells = [
            [
                point.name,
                point.status,
                f"{point.rtol:g}",
                "-" if point.error is None else f"{point.error:.1e}",
                "-" if point.evaluations is None else str(point.evaluations),
                "-" if point.time is None else f"{point.time:.3f}",
            ]
            for point in self.points
        ]
        table = grid(["formulation", "status", "rtol", "error", "evals", "time [s]"], cells, 2)
        reported = [f"{p.name}, rtol {p.rtol:g}: {p.message}" for p in self.points if p.message]
        return "\n".join([f"{self.title}: reference {self.reference}", table, *reported])

    def __str__(self) -> str:
        return self.to_text()

    def __repr__(self) -> str:
        return f"<WorkPrecision of {self.title!r}: {len(self.names)} formulations, {len(self.points)} runs>"

    def to_csv(self, path: PathLike) -> Path:
        """Write the points as comma-separated values and return the path."""
        return write_lines([f.name for f in fields(Point)], [list(asdict(p).values()) for p in self.points], path)

    def plot(self, path: PathLike | None = None) -> Figure:
        """A matplotlib figure: error over evaluations and over time, a line for each formulation. `path` saves it."""
        from ..plots.comparison import plot_work_precision

        return plot_work_precision(self, path)


def work_precision(bench: Bench, cases: Sequence[Case], tolerances: Sequence[float], progress: Any) -> WorkPrecision:
    """Every case with every tolerance; Ctrl-C raises `Interrupted` with the points so far."""
    wanted = sorted({positive("tolerances", tolerance) for tolerance in tolerances}, reverse=True)
    if not wanted:
        raise ArgumentError("tolerances is empty; give some such as (1e-4, 1e-6, 1e-8)", argument="tolerances")
    points: list[Point] = []
    report = Progress(progress, len(cases) * len(wanted))
    stopped: KeyboardInterrupt | None = None
    try:
        for case in cases:
            for rtol in wanted:
                points.append(_point(bench, case, rtol, report.part(f"{case.name}, rtol {rtol:g}")))
    except KeyboardInterrupt as error:
        stopped = error
    finally:
        report.end()
    words = bench.reference.words if bench.reference is not None else "none: interrupted"
    found = WorkPrecision(bench.title, words, points, stopped is not None, bench.unit)
    if stopped is not None:
        raise Interrupted(f"interrupted after {len(points)} runs; `result` of this error has them", found) from stopped
    return found


def _point(bench: Bench, case: Case, rtol: float, progress: Any) -> Point:
    try:
        result, time = bench.run(case, progress, rtol)
    except PartitaError as error:
        return Point(case.name, rtol, FAILED, None, None, None, str(error))
    if not result.success:
        return Point(case.name, rtol, result.status, None, None, None, result.message)
    return Point(case.name, rtol, FINISHED, bench.error(result), result.counters.get("evaluations"), time)
