"""All runs, their table, and operations on it."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .. import notebook
from ..errors import Interrupted, PartitaError
from ..naming import index_of
from .bench import Bench
from .cases import Case
from .progress import Progress
from .row import Row, lacking, measured, not_run, refused
from .table import CONDITION_NOTE, aligned, notes, to_pandas, write_csv
from .work_precision import WorkPrecision, work_precision

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure

    from ..results import Result

PathLike = str | os.PathLike[str]
TOLERANCES = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10)


class Comparison:
    """Formulations and rules side by side: `rows`, one for each, and `caption`, which describes the runs.

    `print(comparison)` shows the table. `interrupted` says whether Ctrl-C ended it before the last run; finished rows
    are kept, the others are "not run".

    Rows have two kinds of time. `time` is that of the whole run, with set-up, steps and outputs, and
    `time_without_outputs` that of the same run with one output. `time_per_evaluation` is that of one evaluation of the
    accelerations alone: after the runs all formulations are timed at the same five states of the motion, in turn, for
    the stages of a step of their own usual length, and the fastest of 25 short batches counts.
    """

    def __init__(self, bench: Bench, cases: Sequence[Case], rows: Sequence[Row], interrupted: bool) -> None:
        self._bench, self._cases = bench, tuple(cases)
        self.rows: tuple[Row, ...] = tuple(rows)
        self.interrupted = interrupted

    @property
    def title(self) -> str:
        """Name of the mechanism, or "system"."""
        return self._bench.title

    @property
    def reference(self) -> Result | None:
        """The reference run; None if none finished."""
        return self._bench.reference.result if self._bench.reference is not None else None

    @property
    def caption(self) -> str:
        """A description of the runs, and of the measure of errors, in two sentences."""
        bench = self._bench
        against = bench.reference.words if bench.reference is not None else "none: interrupted"
        what = "largest difference of a coordinate"
        if self.reference is not None and self.reference.is_mechanism:
            what = f"largest displacement of a body's frame with axes of {bench.size:.3g} m, [m]"
        return (
            f"{bench.title}: {bench.duration:g} s, {bench.method}, rtol {bench.rtol:g}, atol {bench.atol:g}, "
            f"{len(bench.t_eval)} outputs. Error: {what}; reference: {against}."
        )

    def row(self, name: str) -> Row:
        """The row of this name. `UnknownNameError` with the nearest names."""
        return self.rows[index_of(name, [row.name for row in self.rows], "row")]

    def to_text(self) -> str:
        """The caption, the table, and below it why runs are missing or stopped."""
        return "\n".join([self.caption, aligned(self.rows), CONDITION_NOTE, *notes(self.rows)])

    def _repr_html_(self) -> str:
        """The text, in a notebook."""
        return notebook.lines(str(self))

    def __str__(self) -> str:
        return self.to_text()

    def __repr__(self) -> str:
        done = sum(row.finished for row in self.rows)
        return f"<Comparison of {self.title!r}: {done} of {len(self.rows)} runs finished>"

    def to_pandas(self) -> pandas.DataFrame:
        """One line per row, one column per number. `MissingDependencyError` without pandas."""
        return to_pandas(self.rows, self.caption)

    def to_csv(self, path: PathLike) -> Path:
        """Write the rows as comma-separated values; unknown values are empty. Returns the path."""
        return write_csv(self.rows, path)

    def plot(self, path: PathLike | None = None) -> Figure:
        """A matplotlib figure: error, evaluations and time of every row that finished. `path` saves it too."""
        from ..plots.comparison import plot_comparison

        return plot_comparison(self, path)

    def work_precision(
        self, tolerances: Sequence[float] = TOLERANCES, *, names: Sequence[str] | None = None, progress: Any = False
    ) -> WorkPrecision:
        """Compute errors over evaluations and over time, from runs with each of the `tolerances`.

        Args:
            tolerances: values of rtol; the ratio of atol to rtol is kept.
            names: rows to run again; None: every formulation that finished, "projective" with its default rule only
                unless that is not among the rows.
            progress: as in `compare`.

        Raises:
            ArgumentError: no tolerance, or one that is not above zero. UnknownNameError: a name that no row has.
        """
        names = [self.row(name).name for name in names] if names is not None else self._formulations()
        chosen = [case for case in self._cases if case.name in names and case.needs is None]
        return work_precision(self._bench, chosen, tolerances, progress)

    def _formulations(self) -> list[str]:
        """Rows that finished: one for each formulation, the first."""
        first: dict[str, str] = {}
        for row in self.rows:
            if row.finished:
                first.setdefault(row.formulation, row.name)
        return list(first.values())


def carry_out(bench: Bench, cases: Sequence[Case], reference: Result | None, progress: Any) -> Comparison:
    """Every case, one after the other. A typed error of one does not stop the others; Ctrl-C raises `Interrupted` with
    the rows so far."""
    rows: list[Row] = []
    runs: dict[int, Result] = {}
    report = Progress(progress, len(cases) + 1)
    stopped: KeyboardInterrupt | None = None
    try:
        bench = bench.with_reference(reference, report.part("reference"))
        for case in cases:
            row, result = _row(bench, case, report.part(case.name))
            rows.append(row)
            if result is not None and len(result.t) > 1 and row.steps:
                runs[len(rows) - 1] = result
        dearest = max(((rows[i].time or 0.0) / (rows[i].evaluations or 1) for i in runs), default=0.0)
        for index, cost in zip(runs, bench.costs(list(runs.values()), dearest) if runs else [], strict=True):
            rows[index] = replace(rows[index], time_per_evaluation=cost)
    except KeyboardInterrupt as error:
        stopped = error
    finally:
        report.end()
    left = [not_run(case, "interrupted before its end") for case in cases[len(rows) :]]
    found = Comparison(bench, cases, [*rows, *left], stopped is not None)
    if stopped is not None:
        words = f"interrupted after {len(rows)} of {len(cases)} rows; `result` of this error has them"
        raise Interrupted(words, found) from stopped
    return found


def _row(bench: Bench, case: Case, progress: Any) -> tuple[Row, Result | None]:
    if case.needs is not None:
        return lacking(case), None
    try:
        result, time = bench.run(case, progress)
        bare = bench.run(case, None, bare=True)[1] if result.success else None
    except PartitaError as error:
        return refused(case, error), None
    return measured(case, bench, result, time, bare), result
